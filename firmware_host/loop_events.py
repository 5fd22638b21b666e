"""Writes what happens into the log, and remembers the notice: the last event that an operator should know.

The notice answers a later `status`: why the robot stopped, or that its torque went off by itself. It stays until the
robot is moved again.
"""

from collections.abc import Iterable, Mapping
from math import inf

from control.fault_causes import AgedFault, group_by_cause, is_settling
from control.faults import Fault
from control.modes import ENERGISED, PREVENTED, Mode, Request
from firmware_host.log.recorder import Recording
from firmware_host.log.rows import EVENT, EVENT_KIND, STRIDE_KIND, stride_row
from firmware_host.mud_learning import LearningReport

REQUEST_PERIOD_S = 1.0
ENDING = (Mode.STOPPING, Mode.DAMPING)  # what is detected meanwhile did not stop the robot
MAX_REQUESTS = 64  # texts to remember; each names its sender


class RequestEvents:
    """Limits the log to requests that change something, and to one a second of the same kind.

    A client may send 200 requests for a stop in a second. Requests that are left out are counted: the next logged
    request says how many preceded it, and the status gives the total.
    """

    def __init__(self) -> None:
        self.unlogged = 0  # since the start
        self._unlogged_before = 0  # since the last request that was logged
        self._logged_s: dict[str, float] = {}

    def update(self, text: str, changes: bool, now_s: float) -> str:
        """Return the message for the log, or an empty text."""
        if not changes or now_s - self._logged_s.get(text, -inf) < REQUEST_PERIOD_S:
            self.unlogged += 1
            self._unlogged_before += 1
            return ""
        if len(self._logged_s) >= MAX_REQUESTS:
            self._logged_s.clear()
        self._logged_s[text] = now_s
        before, self._unlogged_before = self._unlogged_before, 0
        return f"{text}; {before} before it changed nothing or were repeated" if before else text


class LoopEvents:
    """Owns the notice, which requests were logged, and the faults that are logged only if they last."""

    def __init__(self, recorder: Recording, longest_hold_s: float, bus_of: Mapping[str, str]) -> None:
        """`bus_of` names the bus of each joint."""
        self._recorder = recorder
        self._longest_hold_s = longest_hold_s
        self._bus_of = bus_of
        self.requests = RequestEvents()
        self.forget_notice()
        self._heard_s = inf  # the stamp at which all drives were heard for the first time
        self._settling: dict[tuple[str, str], Fault] = {}

    def forget_notice(self) -> None:
        self.notice = ""
        self.notice_s = -inf
        self.stop_fault: Fault | None = None  # the first cause of the last stop

    def report(self, now_s: float, message: str) -> None:
        """Write a message into the log."""
        self._recorder.put(EVENT_KIND, EVENT.encode(now_s, message))

    def _notify(self, now_s: float, message: str) -> None:
        """Write a message into the log and keep it as the notice."""
        self.notice, self.notice_s = message, now_s
        self.report(now_s, message)

    def report_learning(self, now_s: float, learned: LearningReport) -> None:
        """Write the strides that closed, and what was chosen after them."""
        for message in learned.messages:
            self.report(now_s, message)
        for stride in learned.strides:
            row = stride_row(now_s, stride.estimate, stride.chosen_depth_m, stride.supply_min_v)
            self._recorder.put(STRIDE_KIND, row)

    def report_faults(self, now_s: float, begun: Iterable[Fault], over: Iterable[Fault]) -> None:
        """Write the faults that began or are over; those that may settle once they have not."""
        heard_s = now_s - self._heard_s
        for fault in begun:
            self._settling[fault.name, fault.subject] = fault
        for key, fault in list(self._settling.items()) if self._settling else ():
            if not is_settling(fault, heard_s):
                del self._settling[key]
                self._report_fault(now_s, fault)
        for fault in over:
            if self._settling.pop((fault.name, fault.subject), None) is None:
                self.report(now_s, f"over: {fault.name} {fault.subject}".rstrip())

    def is_settling(self, fault: Fault) -> bool:
        """Return whether a present fault is not logged, because its drive may still answer."""
        return (fault.name, fault.subject) in self._settling

    def _report_fault(self, now_s: float, fault: Fault) -> None:
        self.report(now_s, f"fault {fault.name} ({fault.kind.reaction.name.lower()}): {fault.message}")
        if self.stop_fault is None:
            return
        stop, cause = AgedFault(self.stop_fault, now_s - self.notice_s), AgedFault(fault, 0.0)
        first = group_by_cause([stop, cause], self._bus_of)[0]
        if first.root is fault and first.consequences:  # the stop follows from this one, which takes longer to detect
            self._notify_stop(self.notice_s, fault)

    def _notify_stop(self, stopped_s: float, fault: Fault) -> None:
        self.notice, self.notice_s = f"stopped by {fault.name}: {fault.advice}", stopped_s
        self.stop_fault = fault

    def report_request(self, now_s: float, request: Request, forced: str, by: str, changes: bool) -> None:
        """Log a request with its sender, unless it changes nothing or was logged just now."""
        force = f" by force against {forced}" if forced else ""
        text = f"request {request.name.lower()}{force}{f' by {by}' if by else ''}"
        message = self.requests.update(text, changes, now_s)
        if message:
            self.report(now_s, message)

    def report_prevented(self, now_s: float, request: Request, reason: str) -> None:
        """Log and keep why a request that was accepted changed nothing."""
        self._notify(now_s, f"{request.name.lower()} {PREVENTED}{reason}")

    def report_move(self, now_s: float, path: str, by: str) -> None:
        """Log a move; of a program that sends many, one a second."""
        if self.requests.update(f"move by {by}", True, now_s):
            self.report(now_s, f"move {path} by {by}")
        self.forget_notice()

    def report_overruled(self, now_s: float, faults: Iterable[Fault]) -> None:
        for fault in faults:
            self.report(now_s, f"armed by force despite {fault.name}: {fault.message}")

    def report_end_of_move(self, now_s: float, reason: str) -> None:
        self._notify(now_s, f"the joints stopped on their way: {reason}")

    def report_mode_change(
        self, now_s: float, before: Mode, after: Mode, fault: Fault | None, rested: bool, flippers_up: bool
    ) -> None:
        """Log a change of mode with its cause; the notice says why torque went off or a walk ended.

        `fault` is the worst that is more than a warning; `rested`: the pose was held for the longest permitted time.
        """
        if before is Mode.BOOT:
            self._heard_s = now_s
        because = f": {fault.message}" if fault else ""
        self.report(now_s, f"mode {before.name.lower()} to {after.name.lower()}{because}")
        if after in (Mode.ARMING, Mode.WALKING):
            self.forget_notice()
        if fault and before in ENERGISED and not (self.stop_fault and before in ENDING):
            self._notify_stop(now_s, fault)
        if before is Mode.HOLD and after is Mode.IDLE and rested:
            held_s = self._longest_hold_s
            self._notify(now_s, f"the pose was held for {held_s:g} s without a request: torque went off by itself")
        if before is Mode.STOPPING and after is Mode.HOLD and not flippers_up:
            self._notify(now_s, "the flippers did not come out of the mud")
