"""What the loop tells people: a sentence into the log as things happen, and the last one that a person should know.

The log keeps every sentence with its moment. The notice is what somebody finds who asks for the status later: why the
robot stopped, or that its torque went off by itself. It stands until the robot is moved again.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from control.faults import Fault
from control.modes import ENERGISED, Mode, Request
from firmware_host.log.recorder import Recording
from firmware_host.log.rows import EVENT, EVENT_KIND
from firmware_host.operator.fault_texts import fault_advice, fault_message
from firmware_host.operator.request_events import RequestEvents


class ModeChange(NamedTuple):
    before: Mode
    after: Mode
    fault: Fault | None  # that stands and is more than a warning
    rested: bool  # the pose was held for so long that nobody seems to need it
    flippers_up: bool


class LoopEvents:
    """Owns the notice, and which requests were told."""

    def __init__(self, recorder: Recording, longest_hold_s: float) -> None:
        self._recorder = recorder
        self._longest_hold_s = longest_hold_s
        self.requests = RequestEvents()
        self.reset()

    def reset(self) -> None:
        self.notice = ""
        self.requests.reset()

    def report(self, now_s: float, message: str) -> None:
        """Into the log."""
        self._recorder.put(EVENT_KIND, EVENT.encode(now_s, message))

    def _notify(self, now_s: float, message: str) -> None:
        """Into the log, and to whoever asks for the status."""
        self.notice = message
        self.report(now_s, message)

    def tell_faults(self, now_s: float, begun: Iterable[Fault], over: Iterable[Fault]) -> None:
        for fault in begun:
            self.report(now_s, f"fault {fault.name} ({fault.kind.reaction.name.lower()}): {fault_message(fault)}")
        for fault in over:
            self.report(now_s, f"over: {fault.name} {fault.subject}".rstrip())

    def tell_request(self, now_s: float, request: Request, forced: bool, by: str, changes: bool) -> None:
        """Once, with who asked."""
        text = f"request {request.name.lower()}{' by force' if forced else ''}{f' by {by}' if by else ''}"
        reported = self.requests.update(text, changes, now_s)
        if reported:
            self.report(now_s, reported)

    def tell_overruled(self, now_s: float, faults: Iterable[Fault]) -> None:
        for fault in faults:
            self.report(now_s, f"armed by force despite {fault.name}: {fault_message(fault)}")

    def tell_end_of_move(self, now_s: float, why: str) -> None:
        self._notify(now_s, f"the joints stopped on their way: {why}")

    def tell_change(self, now_s: float, change: ModeChange) -> None:
        """Of the mode, and what a person should know of its cause."""
        before, after, fault = change.before, change.after, change.fault
        because = f": {fault_message(fault)}" if fault else ""
        self.report(now_s, f"mode {before.name.lower()} to {after.name.lower()}{because}")
        if after in (Mode.ARMING, Mode.WALKING):
            self.notice = ""
        if fault and before in ENERGISED:
            self.notice = f"stopped by {fault.name}: {fault_advice(fault)}"
        if before is Mode.HOLD and after is Mode.IDLE and change.rested:
            held_s = self._longest_hold_s
            self._notify(now_s, f"the pose was held for {held_s:g} s without a request: torque went off by itself")
        if before is Mode.STOPPING and after is Mode.HOLD and not change.flippers_up:
            self._notify(now_s, "the flippers did not come out of the mud")
