"""Confirms that the robot has stopped or is disarmed, for `mudskipper stop` and `disarm`, the screen and the page.

A drive confirms by a heartbeat that is newer than the request: of any state where the robot holds its pose, else of an
idle drive. In every other case the torque is unknown, and the operator has to cut the motor power.
"""

import time
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from firmware_host.sockets.rpc import FOR_MEMBERS
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

ANSWER_S = 2.0
POLL_S = 0.05
CONFIRMING_S = 1.5  # after the mode was reached: the longest heartbeat period is 1 s
RESTING = ("idle", "boot", "fault")
ENDINGS = {"stop": ("hold", *RESTING), "disarm": RESTING}  # the modes that each may end in
LONGEST_S = {"stop": 10.0, "disarm": 5.0}
TORQUE_UNKNOWN = "torque unknown: cut motor power"


class Confirmation(NamedTuple):
    """What is known after a stop or a disarm was accepted."""

    method: str
    mode: str  # the last one
    notice: str  # of the daemon, in that mode
    reached: bool  # a mode that the method may end in
    unconfirmed: list[str]  # joints

    @property
    def complete(self) -> bool:
        return self.reached and not self.unconfirmed

    @property
    def text(self) -> str:
        if not self.reached:
            advice = "; 'mudskipper disarm' switches torque off at once" if self.method == "stop" else ""
            return f"still {self.mode} after {LONGEST_S[self.method]:g} s{advice}"
        if self.unconfirmed:
            return f"{self.method} is not confirmed by {', '.join(self.unconfirmed)}"
        return f"{self.method}: every drive has confirmed it"


class Answer(NamedTuple):
    confirmed: bool
    text: str  # for the operator


def unconfirmed_drives(report: dict[str, Any], since_request_s: float) -> list[str]:
    """Return the joints whose drives have not confirmed since the request."""
    holding = report["mode"] == "hold"
    return [drive["joint"] for drive in report["drives"] if not _confirms(drive, holding, since_request_s)]


def _confirms(drive: dict[str, Any], holding: bool, since_request_s: float) -> bool:
    age_s = drive["heartbeat_age_s"]
    return age_s is not None and age_s < since_request_s and (holding or not drive["closed_loop"])


def confirm(client: StatusClient, method: str) -> Confirmation:
    """Wait for the drives after the method was accepted. Raises NotPermittedError where the status is not shown."""
    requested_s = time.monotonic()
    reached_s: float | None = None
    while True:
        asked_s = time.monotonic()
        report = client.call("status")
        unconfirmed = unconfirmed_drives(report, asked_s - requested_s)
        reached_s = (reached_s or asked_s) if report["mode"] in ENDINGS[method] else None
        if reached_s is None:
            ended = asked_s - requested_s > LONGEST_S[method]
        else:
            ended = not unconfirmed or asked_s - reached_s > CONFIRMING_S
        if ended:
            return Confirmation(method, report["mode"], report["notice"], reached_s is not None, unconfirmed)
        time.sleep(POLL_S)


def who_may_see(accepted: str, problem: NotPermittedError) -> str:
    """Return the message for a user who may stop the robot, but not see its status."""
    group = str(problem).partition(FOR_MEMBERS)[2].partition(". ")[0]
    return f"{accepted}; only members of the group {group} can see whether the robot has stopped"


def end_motion(path: Path, method: str) -> Answer:
    """Request a stop or a disarm over a connection of its own, and wait for the drives."""
    try:
        with closing(StatusClient(path, ANSWER_S)) as client:
            accepted = client.call(method)
            try:
                confirmation = confirm(client, method)
            except NotPermittedError as problem:
                return _unknown(who_may_see(accepted, problem))
    except (CallRefusedError, NotPermittedError) as problem:
        return _unknown(f"{method} refused: {problem}")
    except NoDaemonError as problem:
        return _unknown(f"{method}: {problem}")
    return Answer(True, confirmation.text) if confirmation.complete else _unknown(confirmation.text)


def _unknown(text: str) -> Answer:
    return Answer(False, f"{TORQUE_UNKNOWN}. {text}")
