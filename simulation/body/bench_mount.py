"""A flipper mounted over the edge of a bench, with a calibration weight on it or a hand under it: no mud is in reach.

Either axle can be the horizontal one. Level, as on the robot, the adduction axle is; on its side the sweep axle is,
with the front of the robot up. A point on the arm at the distance r from the axes is then as high as

    level: z = r cos α sin β        on its side: z = r sin α

and a weight W on it does -W ∂z/∂q to the joints. The weight hangs from a thread, which passes on neither a pull to the
side nor a swing; only the joint that lifts it feels its inertia, m r².
"""

from __future__ import annotations

from math import cos

from control.joint_pd import GRAVITY_M_S2, ArmMass


class BenchMount:
    """Owns what hangs on one flipper, and whether a hand holds it still."""

    def __init__(self, on_side: bool = False, held: bool = False) -> None:
        self.on_side = on_side
        self.held = held
        self.take_off()

    def take_off(self) -> None:
        self.mass_kg = self.lever_m = 0.0

    def hang(self, mass_kg: float, lever_m: float) -> None:
        """In place of what hung there. Raises ValueError for what is no weight."""
        if not (mass_kg >= 0.0 and lever_m >= 0.0):
            raise ValueError(f"{mass_kg} kg at {lever_m} m: neither may be negative or no number")
        self.mass_kg, self.lever_m = mass_kg, lever_m

    def gravity_torques_nm(self, arm: ArmMass, sweep_rad: float, adduction_rad: float) -> tuple[float, float]:
        """Of the arm and of the weight on (sweep, adduction)."""
        if self.on_side:
            moment_nm = GRAVITY_M_S2 * (arm.arm_mass_kg * arm.center_of_mass_m + self.mass_kg * self.lever_m)
            return -moment_nm * cos(sweep_rad), 0.0
        sweep_nm, lift_nm = arm.gravity_torques_nm(sweep_rad, adduction_rad)
        if not self.mass_kg:
            return sweep_nm, lift_nm
        weight = ArmMass(arm_mass_kg=self.mass_kg, center_of_mass_m=self.lever_m)
        more_sweep_nm, more_lift_nm = weight.gravity_torques_nm(sweep_rad, adduction_rad)
        return sweep_nm + more_sweep_nm, lift_nm + more_lift_nm

    def inertias_kg_m2(self, arm: ArmMass) -> tuple[float, float]:
        """About the sweep and the adduction axle, with the weight's."""
        weight_kg_m2 = self.mass_kg * self.lever_m * self.lever_m
        if self.on_side:
            return arm.sweep_inertia_kg_m2 + weight_kg_m2, arm.adduction_inertia_kg_m2
        return arm.sweep_inertia_kg_m2, arm.adduction_inertia_kg_m2 + weight_kg_m2
