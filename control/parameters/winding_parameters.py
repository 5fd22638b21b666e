"""The thermal model of a motor's winding (control/monitors/winding.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class WindingParameters:
    resistance_ohm: Annotated[float, Bounds(0.001, 50.0), Meaning("of one phase to the star point")] = 0.5
    thermal_resistance_k_w: Annotated[float, Bounds(0.01, 100.0), Meaning("from the winding to the air")] = 1.25
    time_constant_s: Annotated[float, Bounds(1.0, 10000.0), Meaning("with which the winding warms and cools")] = 60.0
    room_c: Annotated[float, Bounds(-40.0, 60.0), Meaning("temperature of the air")] = 30.0
