"""What the axes of all protocols have in common: the newest signals of one drive, and its report, built on a change.

An axis of a protocol sets the signals as its frames arrive, and sets `_health` to None where the report changes. The
two parts of the report that change without a frame of the drive are compared at each reading.
"""

from abc import ABC, abstractmethod

from control.records import NEVER_S, UNKNOWN, DriveState
from drivers.drive import DriveHealth, Outlet
from drivers.setpoint_monitor import SetpointMonitor


class DriveSignals(ABC):
    """Owns the newest value of every signal that arrived; a protocol derives its `DriveAxis` from it."""

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

    def begin_read(self, now_s: float) -> None:
        """Begin a read: the frames that follow arrived between the previous call and `now_s`."""
        self._read_before_s, self._read_s = self._read_s, now_s

    def forget_commands(self) -> None:
        self.setpoints.forget_commands()

    def limit_commands(self, largest_nm: float) -> None:
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
