"""Detects the faults of one bus: errors, lost frames and refused commands. They show in counts that only grow."""

from control.faults import Fault, FaultKind
from control.records import NEVER_S
from drivers.can.can_port import CanPort
from drivers.can.port_health import BusState

REFUSED_TICKS = 3  # consecutive ticks in which the bus failed to send a command
TROUBLE_S = 2.0  # how long a warning outlasts the last error frame
FAULTS = {
    BusState.WARNING: FaultKind.BUS_WARNING,
    BusState.PASSIVE: FaultKind.BUS_PASSIVE,
    BusState.OFF: FaultKind.BUS_OFF,
}


class BusMonitor:
    """Owns the state and the last counts of one port."""

    def __init__(self, name: str, port: CanPort) -> None:
        self._name, self._port = name, port
        self._last = (BusState.ACTIVE, 0, port.lost_frames, port.failed_sends)
        self._error_s = NEVER_S
        self._refused_ticks = 0

    def update(self, found: list[Fault], now_s: float) -> None:
        """Add the faults of this tick."""
        port = self._port
        present = (port.state, port.error_frames, port.lost_frames, port.failed_sends)
        if present == self._last and not port.state:
            self._refused_ticks = 0
        else:
            self._compare(found, now_s, *present)

    def _compare(
        self, found: list[Fault], now_s: float, state: BusState, error_frames: int, lost_frames: int, failed_sends: int
    ) -> None:
        """A warning ends with the error frames: not every CAN driver reports that its controller has recovered."""
        state_before, errors_before, lost_before, failed_before = self._last
        self._last = (state, error_frames, lost_frames, failed_sends)
        if (state, error_frames) != (state_before, errors_before):
            self._error_s = now_s
        if state is BusState.OFF or (state and now_s - self._error_s < TROUBLE_S):
            reason = self._port.last_error or "the reason is unknown"
            found.append(FAULTS[state].fault(self._name, reason=reason))
        if lost_frames != lost_before:
            found.append(FaultKind.FRAMES_LOST.fault(self._name, frames=lost_frames - lost_before))
        self._refused_ticks = ticks = self._refused_ticks + 1 if failed_sends > failed_before else 0
        if ticks >= REFUSED_TICKS:
            reason = self._port.last_send_error
            found.append(FaultKind.BUS_REFUSES.fault(self._name, ticks=ticks, reason=reason))
