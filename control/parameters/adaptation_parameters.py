"""How the next stride's depth is chosen, and with the method `gait` its sweep (control/depth/depth_choice.py)."""

from dataclasses import dataclass
from typing import Annotated, Literal

from control.bounds import Bounds, Meaning

Method = Literal["default", "paper", "gait"]


@dataclass(frozen=True)
class PaperAdaptationParameters:
    """Parameters of the method `paper` alone."""

    acceleration_s: Annotated[float, Bounds(0.01, 10.0), Meaning("time to reach the stance's speed")] = 0.1


@dataclass(frozen=True)
class GaitAdaptationParameters:
    """Parameters of the method `gait` alone."""

    min_sweep_deg: Annotated[float, Bounds(1.0, 60.0), Meaning("narrowest sweep")] = 30.0
    max_sweep_deg: Annotated[float, Bounds(1.0, 60.0), Meaning("widest sweep")] = 50.0
    swing_duration_s: Annotated[float, Bounds(0.2, 10.0), Meaning("of the swing")] = 0.3


@dataclass(frozen=True)
class AdaptationParameters:
    """The method, the depths that it may choose, and the body and motors that it predicts with."""

    method: Annotated[Method, Meaning("how the next stride is chosen: depth, the paper's rule, or depth and gait")] = (
        "default"
    )
    initial_depth_m: Annotated[float, Bounds(0.005, 0.2), Meaning("insertion depth of the first stride")] = 0.03
    min_depth_m: Annotated[float, Bounds(0.005, 0.2), Meaning("shallowest insertion")] = 0.015
    max_depth_m: Annotated[float, Bounds(0.005, 0.2), Meaning("deepest insertion")] = 0.05
    body_drag_n: Annotated[float, Bounds(0.01, 100.0), Meaning("on the body at rest, without the pad")] = (
        2.5  # the paper's
    )
    body_damping_n_s_m: Annotated[float, Bounds(0.0, 1000.0), Meaning("growth of the body's drag with its speed")] = 6.0
    pad_width_m: Annotated[float, Bounds(0.0, 0.5), Meaning("of the pad that the body slides on, across the track")] = (
        0.015
    )
    pad_depth_m: Annotated[float, Bounds(0.0, 0.5), Meaning("of the pad in the mud")] = 0.02
    body_mass_kg: Annotated[float, Bounds(0.05, 100.0), Meaning("of the whole robot")] = 1.0
    mobilisation_n_m: Annotated[float, Bounds(10.0, 1e5), Meaning("stiffness of a flipper with its servo")] = (
        250.0  # logs: 300 to 700
    )
    motor_force_n: Annotated[float, Bounds(0.1, 100.0), Meaning("that a motor can exert at the plate")] = (
        6.25  # 0.75 N·m at 0.12 m
    )
    lifting_fraction: Annotated[
        float, Bounds(0.1, 1.0), Meaning("of the motor's torque that the mud may take in an extraction")
    ] = 0.95
    insertion_fraction: Annotated[
        float, Bounds(0.1, 10.0), Meaning("of the motor's torque at which an insertion ends early")
    ] = 0.73
    paper: PaperAdaptationParameters = PaperAdaptationParameters()
    gait: GaitAdaptationParameters = GaitAdaptationParameters()
