"""Runs an attended walk: the robot walks for as long as this program renews its lease.

Ctrl-C stops the robot and waits until it holds; a second one does not wait. If this program dies or hangs for longer
than its lease, the daemon stops the robot. A control law (run.py) may order each stride, or move the joints of a robot
that holds its pose.
"""

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.json_output import Answer
from command_line.operation.mode_output import mode_answer
from command_line.robot_text import MILD, mode_word, position_text, stride_text
from command_line.screen import complain, drop_output
from operator_client.status_client import CallRefusedError, StatusClient

LEASE_S = 1.0
RENEWAL_S = 0.2
POLL_S = 0.03  # for strides that have closed, from which a law orders the next one
MOVING = ("walking", "stopping", "damping")


LawStep = Callable[[StatusClient, dict[str, Any]], None]  # asks the law, and gives its order


class LawError(CommandError):
    """A control law cannot go on; the message says why."""

    def __init__(self, message: str) -> None:
        super().__init__(message, status=exit_codes.REFUSED)


def attend(client: StatusClient, as_json: bool, params: dict[str, Any], law: LawStep | None = None) -> Answer:
    """Walk, and return when the robot is at rest. A walk that is refused takes no lease."""
    client.call("walk", lease_s=LEASE_S, **params)
    return _attend(client, as_json, law)


def attend_pose(client: StatusClient, law: LawStep, period_s: float) -> Answer:
    """Let a law move the joints while the robot holds its pose under a lease of this client."""
    return _attend(client, True, law, ("hold",), period_s)


def _attend(
    client: StatusClient, as_json: bool, law: LawStep | None, modes: Sequence[str] = MOVING, period_s: float = 0.0
) -> Answer:
    """Renew the lease until the robot is at rest: a law that fails, Ctrl-C and a closed output stop it."""
    status = exit_codes.OK
    try:
        _renew(client, as_json, law, modes, period_s)
    except LawError as problem:
        complain(str(problem))
        client.call("lease", for_s=LEASE_S)  # refused after a take-over: the stop would be one of the other program
        client.call("stop")
        status = exit_codes.REFUSED
    except KeyboardInterrupt:
        client.call("stop")
        status = exit_codes.INTERRUPTED
    except BrokenPipeError:
        drop_output()
        complain("the reader of the output has closed it: the robot stops")
        client.call("stop")
        status = exit_codes.INTERRUPTED
    try:
        report = _renew(client, as_json)
    except KeyboardInterrupt:
        complain("the robot was still stopping: it goes on without this command, and then its torque goes off")
        raise
    client.call("release")
    return _conclude("run" if law else "walk", report, status)


def _renew(
    client: StatusClient,
    as_json: bool,
    law: LawStep | None = None,
    modes: Sequence[str] = MOVING,
    period_s: float = 0.0,
) -> dict[str, Any]:
    """Renew the lease until the walk ends, and return the last status. A law that takes too long loses the lease."""
    line, due_s = LiveLine(silent=as_json), time.monotonic()
    pause_s = period_s or (POLL_S if law else RENEWAL_S)
    while True:
        report: dict[str, Any] = client.call("status")
        if report["mode"] not in modes:
            line.end()
            return report
        line.show(report)
        try:
            client.call("lease", for_s=LEASE_S)
        except CallRefusedError:
            if client.call("status")["mode"] in modes:
                line.end()
                raise
        if law:
            law(client, report)
        now_s = time.monotonic()
        due_s = max(due_s + pause_s, now_s)
        time.sleep(due_s - now_s)


def _conclude(command: str, report: dict[str, Any], status: int) -> Answer:
    """Say why the motion ended. It succeeded if the robot holds its pose and no fault ended it."""
    fault = report["fault"]
    if fault and fault["reaction"] in MILD:  # it ended nothing
        fault = None
    if report["mode"] != "hold" or report["notice"] or fault:
        complain(report["notice"] or (fault["message"] if fault else "the torque was switched off"))
        status = status or exit_codes.REFUSED
    return mode_answer(command, report["mode"], status=status)


class LiveLine:
    """Overwrites one line on a terminal; prints one line per stride elsewhere, and nothing if it is silent."""

    def __init__(self, silent: bool = False) -> None:
        self._silent = silent
        self._live = sys.stdout.isatty() and not silent
        self._shown = ""

    def show(self, report: dict[str, Any], hint: str = "Ctrl-C stops") -> None:
        summary = f"{mode_word(report)}, {stride_text(report)}"
        if self._live:
            print(f"\r\033[K{summary}, {position_text(report)}; {hint}", end="", flush=True)
        elif summary != self._shown and not self._silent:
            print(summary, flush=True)
        self._shown = summary

    def end(self) -> None:
        if self._live and self._shown:
            print("\r\033[K", end="", flush=True)
