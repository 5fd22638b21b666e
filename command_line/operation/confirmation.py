"""`mudskipper stop` and `disarm`, and orders of the screen and the page: a stop counts once every drive confirmed it.

A drive confirms by a heartbeat that is newer than the request: of any state where the robot holds its pose, else of an
idle drive. In every other case the torque is unknown, and the operator has to cut the motor power.
"""

import time
from typing import Any, NamedTuple

from command_line import exit_codes
from command_line.errors import explain
from command_line.json_output import Answer
from command_line.operation.mode_output import mode_answer
from command_line.screen import complain
from command_line.shared_options import Socket
from firmware_host.sockets.rpc import FOR_MEMBERS
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

ANSWER_S = 2.0
POLL_S = 0.05
CONFIRMING_S = 1.5  # after the mode was reached: the longest heartbeat period is 1 s
RESTING = ("idle", "boot", "fault")
ENDINGS = {"stop": ("hold", *RESTING), "disarm": RESTING}  # the modes that each may end in
LONGEST_S = {"stop": 10.0, "disarm": 5.0}
TORQUE_UNKNOWN = "torque unknown: cut motor power"


class Ended(NamedTuple):
    """What became of a stop or a disarm. Only with the status OK has every drive confirmed it."""

    status: int  # of the command's exit
    text: str
    mode: str = ""  # that was reached
    notice: str = ""  # of the daemon, in that mode

    @property
    def answer(self) -> str:
        return self.text if self.status == exit_codes.OK else f"{TORQUE_UNKNOWN}. {self.text}"


def unconfirmed_drives(report: dict[str, Any], since_request_s: float) -> list[str]:
    """Return the joints whose drives have not confirmed since the request."""
    holding = report["mode"] == "hold"
    return [drive["joint"] for drive in report["drives"] if not _confirms(drive, holding, since_request_s)]


def _confirms(drive: dict[str, Any], holding: bool, since_request_s: float) -> bool:
    age_s = drive["heartbeat_age_s"]
    return age_s is not None and age_s < since_request_s and (holding or not drive["closed_loop"])


def _confirm(client: StatusClient, method: str) -> Ended:
    """Wait for the drives after the method was accepted. Raises NotPermittedError where the status is not shown."""
    requested_s = time.monotonic()
    reached_s: float | None = None
    while True:
        asked_s = time.monotonic()
        report = client.call("status")
        unconfirmed = unconfirmed_drives(report, asked_s - requested_s)
        mode, notice = report["mode"], report["notice"]
        reached_s = (reached_s or asked_s) if mode in ENDINGS[method] else None
        if reached_s is None and asked_s - requested_s > LONGEST_S[method]:
            advice = "; 'mudskipper disarm' switches torque off at once" if method == "stop" else ""
            return Ended(exit_codes.TIMED_OUT, f"still {mode} after {LONGEST_S[method]:g} s{advice}")
        if reached_s is not None and not unconfirmed:
            return Ended(exit_codes.OK, f"{method}: every drive has confirmed it", mode, notice)
        if reached_s is not None and asked_s - reached_s > CONFIRMING_S:
            text = f"{method} is not confirmed by {', '.join(unconfirmed)}"
            return Ended(exit_codes.TORQUE_UNKNOWN, text, mode, notice)
        time.sleep(POLL_S)


def end_motion(path: Socket, method: str) -> Ended:
    """Request a stop or a disarm over a connection of its own, and wait for the drives."""
    try:
        with StatusClient(path, ANSWER_S) as client:
            accepted = client.call(method)
            try:
                return _confirm(client, method)
            except NotPermittedError as problem:  # a user who may stop the robot, but not see its status
                group = str(problem).partition(FOR_MEMBERS)[2].partition(". ")[0]
                text = f"{accepted}; only members of the group {group} can see whether the robot has stopped"
                return Ended(exit_codes.TORQUE_UNKNOWN, text)
    except Exception as problem:  # noqa: BLE001 - `explain` raises again what it does not know
        messages, status = explain(problem)
        return Ended(status, "; ".join(messages))


def stop(*, socket: Socket) -> Answer:
    return _end("stop", socket)


def disarm(*, socket: Socket) -> Answer:
    return _end("disarm", socket)


def _end(command: str, socket: Socket) -> Answer:
    try:
        ended = end_motion(socket, command)
    except KeyboardInterrupt:
        complain(TORQUE_UNKNOWN)
        raise
    if ended.status != exit_codes.OK:
        complain(ended.text, TORQUE_UNKNOWN)
    return mode_answer(command, ended.mode, ended.notice, ended.status)


def send_order(path: Socket, method: str, **params: Any) -> str:
    """Send an order over a connection of its own, and return what became of it: none waits for another."""
    return end_motion(path, method).answer if method in ENDINGS else send_call(path, method, **params)[1]


def send_call(path: Socket, method: str, **params: Any) -> tuple[bool, str]:
    """Send an order that ends no motion; return whether the daemon accepted it, and what became of it."""
    try:
        with StatusClient(path, ANSWER_S) as client:
            answer = client.call(method, **params)
            return True, f"{method}: {answer if isinstance(answer, str) else answer['time']}"
    except (CallRefusedError, NotPermittedError) as problem:
        return False, f"{method} refused: {problem}"
    except NoDaemonError as problem:
        return False, f"{method}: {problem}"
