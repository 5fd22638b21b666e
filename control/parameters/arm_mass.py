"""The mass of a flipper arm, and the torques of its weight."""

from dataclasses import dataclass
from math import cos, sin
from typing import Annotated

from control.bounds import Bounds, Meaning

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class ArmMass:
    """Mass and inertia of one flipper arm with all parts that its adduction joint lifts: a point mass on the arm."""

    arm_mass_kg: Annotated[float, Bounds(0.0, 20.0), Meaning("everything that one adduction joint lifts")] = 0.08
    center_of_mass_m: Annotated[float, Bounds(0.0, 1.0), Meaning("from the axes, along the arm")] = 0.06
    sweep_inertia_kg_m2: Annotated[float, Bounds(1e-5, 1.0), Meaning("about the sweep axis")] = (
        0.0004  # arm and plate of PLA, rotor of a 60 mm motor
    )
    adduction_inertia_kg_m2: Annotated[float, Bounds(1e-5, 1.0), Meaning("about the adduction axis")] = (
        0.0006  # the same, and the sweep motor at the axis
    )

    def gravity_torques_nm(self, sweep_rad: float, adduction_rad: float) -> tuple[float, float]:
        """Return gravity's torques on (sweep, adduction): -∂/∂q of m g r cos α sin β."""
        moment_nm = self.arm_mass_kg * GRAVITY_M_S2 * self.center_of_mass_m
        sweep_nm = moment_nm * sin(sweep_rad) * sin(adduction_rad)
        return sweep_nm, -moment_nm * cos(sweep_rad) * cos(adduction_rad)
