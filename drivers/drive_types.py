"""The types of motor drive that `[drive.JOINT] type` can name. Adding a protocol adds one line to the table.

All drives of a robot are of one type.
"""

from collections.abc import Iterable, Mapping, Sequence

from control.limits import JointLimits
from drivers.can.bus_load import FrameRate
from drivers.can.can_port import CanPort
from drivers.drive import DriveParameters, Drives, DriveType, WatchdogEndpoints
from drivers.odrive.drive_type import Odrive

DEFAULT = "odrive"
DRIVE_TYPES: Mapping[str, DriveType] = {"odrive": Odrive()}


def type_of(parameters: Iterable[DriveParameters]) -> DriveType:
    """Returns the type of all drives of a robot."""
    return DRIVE_TYPES[next(iter(parameters)).type]


def make_drives(
    parameters: Mapping[str, DriveParameters],
    ports: Mapping[str, CanPort],
    limits: JointLimits,
    endpoints: Sequence[WatchdogEndpoints] = (),
) -> Drives:
    """Makes the robot's drives from their parameters by joint, on ports by the name of the bus.

    `limits` are what the gate lets pass; `endpoints` belong to further builds of the drives' firmware.
    """
    return type_of(parameters.values()).make_drives(parameters, ports, limits, endpoints)


def traffic_of(drives: Iterable[DriveParameters]) -> list[FrameRate]:
    """Lists everything that these drives send and receive all the time."""
    types = (DRIVE_TYPES[drive.type] for drive in drives)
    return [message for each in types for message in (each.command, *each.reports)]
