"""Two abstract drives under the product's own arming sequence: one that obeys, and one that may do anything.

The drives of all joints (drivers/drives.py) are used as they are; only axes, gate and port are replaced. A drive
here has an axis state, and reports it in heartbeats that may fail to arrive.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from control.records import JOINTS, NEVER_S, DriveState, DriveStates, Joints, Torques
from drivers.can.port_health import BusState
from drivers.drive import DriveHealth
from drivers.drives import Drives

PERIOD_S = 1.5  # long ticks: the modes' durations of 2 and 3 s are then few of them
SILENT_HEARTBEATS = 3  # so many missing ones are a silence, and are not counted further


class Obedience(Enum):
    """The fate of the commands to a drive in one tick."""

    ALL = 0
    NONE = 1  # they are lost unnoticed
    REFUSED = 2  # the port cannot send them, and counts them
    FIRST_REFUSED = 3


class Event(Enum):
    NONE = 0
    TRIPS = 1  # the drive goes idle by itself
    CLOSES = 2  # another program sends it into closed loop


class DriveMemory(NamedTuple):
    """The state on which the future of an abstract drive depends."""

    heard: bool = True
    closed: bool = False
    reported_closed: bool = False
    missing_heartbeats: int = 0
    prepared: bool = False  # since arming began
    was_closed: bool = False  # at some time since arming began


class AbstractAxis:
    """One drive with its axis; it records what it was asked for in this tick."""

    def __init__(self, port: AbstractPort) -> None:
        self._port = port
        self.version, self.watchdog_s = "known", 0.1
        self.restore(DriveMemory())
        self.begin_tick(0.0, Obedience.ALL)

    def restore(self, memory: DriveMemory) -> None:
        self.heard, self.closed, self.closed_loop, self.missing_heartbeats, self.prepared, self.was_closed = memory

    def memory(self, arming: bool) -> DriveMemory:
        return DriveMemory(
            heard=self.heard,
            closed=self.closed,
            reported_closed=self.closed_loop,
            missing_heartbeats=self.missing_heartbeats,
            prepared=arming and self.prepared,
            was_closed=arming and self.was_closed,
        )

    def begin_tick(self, now_s: float, obedience: Obedience) -> None:
        self._now_s = now_s
        self._obedience = obedience
        self.asked_idle = self.asked_unprepared = False
        self.asked_closed = 0
        self.torque_nm = 0.0

    def send_heartbeat(self) -> None:
        """Send a heartbeat."""
        self.heard, self.closed_loop, self.missing_heartbeats = True, self.closed, 0
        self.was_closed = self.was_closed or self.closed

    def miss_heartbeat(self) -> None:
        self.missing_heartbeats = min(self.missing_heartbeats + 1, SILENT_HEARTBEATS)

    @property
    def may_be_on(self) -> bool:
        return self.closed_loop

    @property
    def state(self) -> DriveState:
        """Return the state as of the last heartbeat, which was sent half a tick before it was read."""
        if not self.heard:
            return DriveState()
        stamp_s = self._now_s - (self.missing_heartbeats + 0.5) * PERIOD_S
        return DriveState(0.0, 0.0, self._now_s, 0.0, self._now_s, self.closed_loop, 0, stamp_s)

    def _arrives(self) -> bool:
        obedience = self._obedience
        if obedience is Obedience.FIRST_REFUSED:
            self._obedience = Obedience.ALL
        if obedience in (Obedience.REFUSED, Obedience.FIRST_REFUSED):
            self._port.failed_sends += 1
        return obedience is Obedience.ALL

    def poll(self) -> None:
        """Do nothing: these drives report by themselves."""

    def prepare(self) -> None:
        if self._arrives():
            self.prepared = True

    def close_loop(self) -> None:
        self.asked_closed += 1
        if self._arrives():
            self.asked_unprepared = not self.prepared
            self.closed = self.was_closed = True

    def disarm(self) -> None:
        self.asked_idle = True
        if self._arrives():
            self.closed = self.prepared = False

    def send_torque(self, torque_nm: float) -> None:
        self.torque_nm = torque_nm

    def clear_errors(self) -> None:
        pass


class AbstractPort:
    def __init__(self) -> None:
        self.failed_sends = self.error_frames = self.lost_frames = 0
        self.state = BusState.ACTIVE
        self.last_error = self.last_send_error = ""


class AbstractGate:
    """Records whether torque was commanded while it was closed."""

    def __init__(self) -> None:
        self.is_open = False
        self.refused, self.last_refusal = 0, ""

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def allow_step(self, elapsed_s: float) -> None:
        pass


class AbstractDrives(Drives):
    """Two drives: one obeys, the search decides what the other one does."""

    def __init__(self) -> None:
        self._port = AbstractPort()
        self.ports = {"bus": self._port}  # type: ignore[dict-item]
        self.gate = self.abstract_gate = AbstractGate()  # type: ignore[assignment]
        self.obedient, self.other = AbstractAxis(self._port), AbstractAxis(self._port)
        self.both = (self.obedient, self.other)
        self.axes = self.both  # type: ignore[assignment]
        self._armed_s = self._disarmed_s = NEVER_S

    def begin_tick(self, now_s: float, obedience: Obedience) -> None:
        self._armed_s = self._disarmed_s = NEVER_S  # a tick is longer than the time between two requests
        self.gate.refused = self._port.failed_sends = 0
        self.obedient.begin_tick(now_s, Obedience.ALL)
        self.other.begin_tick(now_s, obedience)

    def read(self, now_s: float) -> DriveStates:
        one, other = self.obedient.state, self.other.state
        return Joints(one, other, one, other)

    def send(self, torques_nm: Torques, elapsed_s: float) -> None:
        for axis, torque_nm in zip(self.both, torques_nm[:2], strict=True):
            axis.send_torque(torque_nm)

    @property
    def health(self) -> Joints[DriveHealth]:
        return Joints(*(DriveHealth(joint) for joint in JOINTS))

    def request_supply(self) -> None:
        """Asks for nothing."""

    def request_settings(self, now_s: float) -> None:
        pass
