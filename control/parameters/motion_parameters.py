"""Motions outside of the gait (control/controller.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class MotionParameters:
    """Parameters of motions outside the gait."""

    path_speed_rad_s: Annotated[
        float,
        Bounds(0.05, 10.0),
        Meaning(
            "mean speed of the joint with the longest path outside of the gait, also in a stop, which lasts 3 s at most"
        ),
    ] = 1.0
    fade_in_s: Annotated[
        float, Bounds(0.0, 10.0), Meaning("in which stiffness rises to its full value after arming")
    ] = 0.5
    longest_hold_s: Annotated[
        float, Bounds(0.0, 86400.0), Meaning("after which torque goes off by itself; 0: never")
    ] = 600.0
