"""ODrives as joints, and the far ends of their two buses, whose frames the tests write."""

from collections.abc import Mapping, Sequence

from control.parameters.joint_limits import JointLimits
from control.records import NEVER_S, DriveState
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.drive import DriveHealth, WatchdogEndpoints
from drivers.drive_types import make_drives
from drivers.odrive.axis import OdriveAxis
from drivers.odrive.codec import HEARTBEAT, Message, arbitration_id
from drivers.odrive.parameters import OdriveParameters

PARAMETERS = {
    "left_sweep": OdriveParameters("left", 0),
    "left_adduction": OdriveParameters("left", 1, sign=-1, zero_turn=0.25),
    "right_sweep": OdriveParameters("right", 3, sign=-1),
    "right_adduction": OdriveParameters("right", 2, velocity_limit_turn_s=8.0, current_limit_a=6.0),
}


class OdriveBench:
    def __init__(
        self,
        parameters: Mapping[str, OdriveParameters] = PARAMETERS,
        limits: JointLimits | None = None,
        endpoints: Sequence[WatchdogEndpoints] = (),
    ) -> None:
        buses = {"left": MockBus(), "right": MockBus()}
        self.parameters = parameters
        self.far = {name: bus.open() for name, bus in buses.items()}
        ports = {name: bus.open() for name, bus in buses.items()}
        self.drives = make_drives(parameters, ports, limits, endpoints)

    @property
    def axis(self) -> OdriveAxis:
        """Return the first drive, node 0 of the left bus."""
        axis = self.drives.axes[0]
        assert isinstance(axis, OdriveAxis)
        return axis

    @property
    def state(self) -> DriveState:
        return self.drives.axes[0].state

    @property
    def health(self) -> DriveHealth:
        return self.drives.health[0]

    def report(self, message: Message, *values: float, joint: str = "left_sweep", stamp_s: float = NEVER_S) -> None:
        drive = self.parameters[joint]
        frame = Frame(arbitration_id(drive.node_id, message), message.encode(*values), stamp_s=stamp_s)
        self.far[drive.bus].send(frame)

    def heartbeat(self, state: int = 1, error: int = 0, joint: str = "left_sweep", stamp_s: float = NEVER_S) -> None:
        self.report(HEARTBEAT, error, state, 0, 0, joint=joint, stamp_s=stamp_s)
