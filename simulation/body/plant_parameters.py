"""The parameters of the robot's mechanics (plant.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds
from control.geometry import FlipperGeometry
from control.parameters.arm_mass import ArmMass
from control.records import TWO_FLIPPERS, Rig
from simulation.body.free_body import BodyShape
from simulation.mud.disturbances import NONE, Disturbances


@dataclass(frozen=True)
class PlantParameters:
    rig: Rig = TWO_FLIPPERS
    geometry: FlipperGeometry = FlipperGeometry()
    arm_mass: ArmMass = ArmMass()
    joint_friction_nm_s: Annotated[float, Bounds(0.0, 0.1)] = 0.002
    joint_coulomb_nm: Annotated[float, Bounds(0.0, 0.5)] = 0.0
    body_mass_kg: Annotated[float, Bounds(0.05, 100.0)] = 1.0
    rail_drag_n: Annotated[float, Bounds(0.0, 100.0)] = 2.5  # the paper's, without the pad
    rail_damping_n_s_m: Annotated[float, Bounds(0.0, 1000.0)] = 6.0  # how that grows with speed: fitted to Table I
    pad_width_m: Annotated[float, Bounds(0.0, 0.5)] = 0.015
    pad_depth_m: Annotated[float, Bounds(0.0, 0.5)] = 0.02
    disturbances: Disturbances = NONE
    fixed_base: bool = False  # the body never moves, as in the paper's trials of a single flipper
    free_body: bool = False  # without a rail, of this shape
    body: BodyShape = BodyShape()

    def __post_init__(self) -> None:
        """Raise ValueError where the options contradict each other."""
        if self.fixed_base and self.free_body:
            raise ValueError("a body on a fixed base cannot be free")
