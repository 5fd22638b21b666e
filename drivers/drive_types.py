"""The types of motor drive that `[drive.JOINT] type` can name. Adding a protocol adds one line to the table.

The joints of a robot may have drives of different types, as long as those on one bus send frames of the same kind.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from control.parameters.joint_limits import JointLimits
from control.records import JOINTS
from drivers.bench.drive_bench import DriveBench
from drivers.can.bus_load import FrameRate
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.drive import FD, DriveParameters, WatchdogEndpoints
from drivers.drive_type import DriveType, FrameContent
from drivers.drives import Drives
from drivers.mit.drive_type import Mit
from drivers.moteus.drive_type import Moteus
from drivers.odrive.drive_type import Odrive
from drivers.odrive05.drive_type import Odrive05
from drivers.transmit_gate import TransmitGate

DEFAULT = "odrive"
DRIVE_TYPES: Mapping[str, DriveType] = {
    "odrive": Odrive(),
    "moteus": Moteus(),
    "mit": Mit(),
    "odrive05": Odrive05(),
}
# Those that can be found and set up, in the order in which a bus is searched: the first disturb no other drive. On CAN
# FD comes next what speaks it, because drives of classic CAN are on other buses.
DRIVE_BENCHES: Mapping[str, DriveBench] = dict(
    sorted(
        ((name, each.bench) for name, each in DRIVE_TYPES.items() if each.bench is not None),
        key=lambda item: (bool(item[1].disturbs), not item[1].is_fd),
    )
)


def type_of(parameters: DriveParameters) -> DriveType:
    return DRIVE_TYPES[parameters.type]


def make_drives(
    parameters: Mapping[str, DriveParameters],
    ports: Mapping[str, CanPort],
    limits: JointLimits | None = None,
    endpoints: Sequence[WatchdogEndpoints] = (),
) -> Drives:
    """Make the robot's drives from their parameters by joint, on ports by the name of the bus.

    `limits` are what the gate lets pass; `endpoints` belong to further builds of the drives' firmware.
    """
    limits = limits or JointLimits()
    gate = TransmitGate(limits)
    outlets = {
        name: gate.outlet(port, [type_of(each).gate_table(each) for each in parameters.values() if each.bus == name])
        for name, port in ports.items()
    }
    axes = [
        type_of(parameters[joint]).make_axis(joint, parameters[joint], outlets[parameters[joint].bus], endpoints)
        for joint in JOINTS
        if joint in parameters
    ]
    for axis in axes:
        axis.limit_commands(limits.torque_nm)
    return Drives(axes, ports, gate, {name: _other_types(parameters, name) for name in ports})


def _other_types(parameters: Mapping[str, DriveParameters], bus: str) -> dict[int, tuple[str, str]]:
    """Return the joint and the other type of drive that a frame with an arbitration id announces under its node id."""
    return {
        announced.arbitration_id | FD * announced.is_fd: (joint, name)
        for joint, drive in parameters.items()
        if drive.bus == bus
        for name, other in DRIVE_TYPES.items()
        if name != drive.type
        for announced in [other.announces(drive.node_id)]
    }


def collisions(parameters: Mapping[str, DriveParameters]) -> Iterator[tuple[str, str, int]]:
    """Yield two joints and an arbitration id that their drives, of different types on one bus, both use.

    Drives of one type never collide while their node ids differ: what they share, they address by the payload.
    """
    for (first, one), (second, other) in combinations(parameters.items(), 2):
        if one.bus == other.bus and one.type != other.type:
            shared = type_of(one).identifiers(one) & type_of(other).identifiers(other)
            if shared:
                yield first, second, min(shared)


def read_frame(frame: Frame, drives: Iterable[DriveParameters]) -> FrameContent | None:
    """Return the content of a frame on the bus of these drives, by the first of their protocols that knows it."""
    for name in dict.fromkeys(drive.type for drive in drives):
        content = DRIVE_TYPES[name].read_frame(frame)
        if content is not None:
            return content
    return None


def traffic_of(drives: Iterable[DriveParameters]) -> list[FrameRate]:
    """List everything that these drives send and receive all the time."""
    types = (DRIVE_TYPES[drive.type] for drive in drives)
    return [message for each in types for message in (each.command, *each.reports)]
