"""A flipper mounted over the edge of a bench, out of reach of mud, loaded by a calibration weight or held by hand.

Either axle can be the horizontal one. With the robot level it is the adduction axle; with the robot on its side, front
up, it is the sweep axle. A point on the arm at the distance r from the axes has the height

    level: z = r cos α sin β        on its side: z = r sin α

and a weight W at that point exerts the torque -W ∂z/∂q on the joints. The weight hangs from a thread, which transmits
neither a sideways pull nor a swing; only the joint that lifts the weight has to accelerate its inertia, m r².
"""

from math import cos

from control.parameters.arm_mass import GRAVITY_M_S2, ArmMass


class BenchMount:
    """Owns the weight on one flipper, and whether a hand holds the flipper still."""

    def __init__(self, on_side: bool = False, held: bool = False) -> None:
        self.on_side = on_side
        self.held = held
        self.take_off()

    def take_off(self) -> None:
        self.mass_kg = self.lever_m = 0.0

    def hang(self, mass_kg: float, lever_m: float) -> None:
        """Hang a weight in place of the previous one. Raises ValueError for a negative mass or lever, or for NaN."""
        if not (mass_kg >= 0.0 and lever_m >= 0.0):
            raise ValueError(f"{mass_kg} kg at {lever_m} m: mass and lever must be numbers of at least 0")
        self.mass_kg, self.lever_m = mass_kg, lever_m

    def gravity_torques_nm(self, arm: ArmMass, sweep_rad: float, adduction_rad: float) -> tuple[float, float]:
        """Return the torques of arm and weight on (sweep, adduction)."""
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
        """Return the inertias about the sweep and the adduction axle, weight included."""
        weight_kg_m2 = self.mass_kg * self.lever_m * self.lever_m
        if self.on_side:
            return arm.sweep_inertia_kg_m2 + weight_kg_m2, arm.adduction_inertia_kg_m2
        return arm.sweep_inertia_kg_m2, arm.adduction_inertia_kg_m2 + weight_kg_m2
