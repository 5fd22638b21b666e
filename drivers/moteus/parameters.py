"""The configuration of one moteus."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from control.bounds import Bounds, Meaning
from drivers.drive import DriveParameters

SMALLEST_ID, LARGEST_ID = 1, 126  # this program is 0, and 127 addresses all


@dataclass(frozen=True)
class MoteusParameters(DriveParameters):
    node_id: Annotated[int, Bounds(SMALLEST_ID, LARGEST_ID), Meaning("on that bus", "id")] = SMALLEST_ID
    type: Annotated[str, Meaning("the protocol that the drive speaks")] = "moteus"
    torque_constant_nm_a: Annotated[float, Bounds(0.001, 10.0), Meaning("torque per current")] = 0.0719  # 8.27 / 115
    serial_digits: ClassVar[int] = 24
    answers_only: ClassVar[bool] = True
