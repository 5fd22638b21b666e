"""The gait's speeds and durations (control/gait/gait.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class GaitParameters:
    sweep_angle_deg: Annotated[float, Bounds(1.0, 60.0), Meaning("the stance sweeps from plus to minus this angle")] = (
        30.0
    )
    insertion_speed_m_s: Annotated[float, Bounds(0.005, 1.0), Meaning("of the plate's lower edge, downward")] = 0.1
    stance_speed_m_s: Annotated[float, Bounds(0.005, 2.0), Meaning("of the plate along its arc, backward")] = 0.5
    extraction_speed_m_s: Annotated[float, Bounds(0.005, 2.0), Meaning("of the plate's lower edge, upward")] = 0.5
    swing_speed_m_s: Annotated[
        float, Bounds(0.005, 2.0), Meaning("of the plate along its arc, where swing_duration_s is 0")
    ] = 0.5
    swing_duration_s: Annotated[float, Bounds(0.0, 10.0), Meaning("0 derives it from swing_speed_m_s")] = (
        0.8  # the authors' robot
    )
    pause_s: Annotated[float, Bounds(0.0, 60.0), Meaning("after insertion, after stance and after extraction")] = 0.0
