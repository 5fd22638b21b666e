"""One drive as one joint: what it reports, and the frames that command it. Each protocol derives its own axis from it.

An axis of a protocol sets the signals as its frames arrive, and sets `_health` to None where the report changes. The
two parts of the report that change without a frame of the drive are compared at each reading.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

from control.records import NEVER_S, UNKNOWN, DriveState
from drivers.drive import DriveHealth, DriveParameters, Outlet
from drivers.setpoint_monitor import SetpointMonitor


class DriveAxis(ABC):
    """Owns the newest value of every signal that arrived."""

    parameters: DriveParameters

    def __init__(self, joint: str, sign: int, outlet: Outlet, setpoints: SetpointMonitor) -> None:
        """`sign`: -1 for a mirrored motor. The protocol's axis calls `reset` at the end of its own."""
        self.joint = joint
        self._sign = sign
        self._outlet = outlet
        self.setpoints = setpoints

    def reset(self) -> None:
        self._angle_rad = self._velocity_rad_s = self._current_a = UNKNOWN
        self._angle_stamp_s = self._current_stamp_s = self._heartbeat_stamp_s = NEVER_S
        self._temperature_c = self._bus_voltage_v = self._bus_current_a = UNKNOWN
        self._temperature_stamp_s = self._bus_voltage_stamp_s = NEVER_S
        self._read_s = self._read_before_s = NEVER_S
        self.closed_loop = False  # by the drive's newest report
        self._error_flags = 0
        self.restarts = 0
        self._foreign_commands = 0
        self.setpoints.reset()
        self._health: DriveHealth | None = None

    @property
    def may_be_on(self) -> bool:
        """Return whether torque may be on in the drive: it reports closed loop, or what cannot be true."""
        return self.closed_loop

    def begin_read(self, now_s: float) -> None:
        """Begin a read: the frames that follow arrived between the previous call and `now_s`."""
        self._read_before_s, self._read_s = self._read_s, now_s

    def forget_commands(self) -> None:
        """The last torques may not have left, so the drive may follow older ones."""
        self.setpoints.forget_commands()

    def limit_commands(self, largest_nm: float) -> None:
        """State the largest torque that is ever commanded: a larger set-point is another program's."""
        self.setpoints.limit_commands(largest_nm)

    def _count_foreign_command(self) -> None:
        self._foreign_commands += 1
        self._health = None

    @property
    def state(self) -> DriveState:
        return DriveState(  # by position: it is built for every drive in every tick
            self._angle_rad,
            self._velocity_rad_s,
            self._angle_stamp_s,
            self._current_a,
            self._current_stamp_s,
            self.closed_loop,
            self._error_flags,
            self._heartbeat_stamp_s,
            self._temperature_c,
            self._temperature_stamp_s,
            self._bus_voltage_v,
            self._bus_voltage_stamp_s,
            self._bus_current_a,
        )

    @property
    def health(self) -> DriveHealth:
        """The drive's report about itself, built again only when it has changed."""
        health = self._health
        if (
            health is None
            or health.duplicate_id is not self.duplicates
            or (health.setpoint_problem != "") is not self.setpoints.found
        ):
            self._health = health = self._build_health()
        return health

    def _build_health(self) -> DriveHealth:
        """Report what is alike with every protocol; a protocol adds the rest."""
        return DriveHealth(
            joint=self.joint,
            restarts=self.restarts,
            duplicate_id=self.duplicates,
            foreign_commands=self._foreign_commands,
            setpoint_problem=self.setpoints.problem(self._sign),
        )

    @property
    @abstractmethod
    def duplicates(self) -> bool:
        """Return whether two drives seem to share this id."""

    @property
    @abstractmethod
    def receivers(self) -> Mapping[int, Callable[[bytes, float], None]]:
        """The handler of payload and stamp for each arbitration id to listen to; with the bit FD for CAN FD frames."""

    def poll(self) -> None:  # noqa: B027 - most drives report by themselves
        """Ask for all signals, where the drive reports only when asked."""

    @abstractmethod
    def send_torque(self, torque_nm: float) -> None: ...

    def prepare(self) -> None:  # noqa: B027 - the commands of some state all that they need
        """Set what the drive needs to follow torque, where its commands do not; it stays idle."""

    @abstractmethod
    def close_loop(self) -> None: ...

    @abstractmethod
    def disarm(self) -> None:
        """Command zero torque and idle."""

    @abstractmethod
    def clear_errors(self) -> None: ...

    @abstractmethod
    def request_supply(self) -> None:
        """Ask for voltage and current of the supply, where no other message reports them."""

    @abstractmethod
    def request_settings(self, now_s: float) -> None:
        """Ask for settings that are unknown or were read long ago. It is called in every tick while idle."""
