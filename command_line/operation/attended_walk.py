"""Runs an attended walk: the robot walks for as long as this program renews its lease.

Ctrl-C stops the robot and waits until it holds. If this program dies or hangs for longer than its lease, the daemon
stops the robot. A control law (run.py) may order each stride.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

from command_line import exit_codes
from command_line.json_output import Answer
from command_line.operation.mode_output import mode_answer
from command_line.robot_text import MILD, position_text, stride_text
from command_line.screen import complain
from operator_client.status_client import CallRefusedError, StatusClient

LEASE_S = 1.0
RENEWAL_S = 0.2
POLL_S = 0.03  # for strides that have closed, from which a law orders the next one
MOVING = ("walking", "stopping", "damping")


Law = Callable[[StatusClient], None]


class LawError(Exception):
    """A control law cannot go on; the message says why."""


def attend(client: StatusClient, as_json: bool, params: dict[str, Any], law: Law | None = None) -> Answer:
    """Walk, and return when the robot is at rest. A walk that is refused takes no lease."""
    client.call("walk", lease_s=LEASE_S, **params)
    try:
        report, status = _renew(client, as_json, law), exit_codes.OK
    except LawError as problem:
        complain(f"{problem}; the robot stops")
        client.call("stop")
        report, status = _renew(client, as_json), exit_codes.REFUSED
    except KeyboardInterrupt:
        client.call("stop")
        report, status = _renew(client, as_json), exit_codes.INTERRUPTED
    client.call("release")
    return _conclude(report, status)


def _renew(client: StatusClient, as_json: bool, law: Law | None = None) -> dict[str, Any]:
    """Renew the lease until the walk ends, and return the last status. A law that takes too long loses the lease."""
    line = LiveLine(silent=as_json)
    while True:
        report: dict[str, Any] = client.call("status")
        if report["mode"] not in MOVING:
            line.end()
            return report
        line.show(report)
        try:
            client.call("lease", for_s=LEASE_S)
        except CallRefusedError:
            if client.call("status")["mode"] in MOVING:
                line.end()
                raise
        if law:
            law(client)
        time.sleep(POLL_S if law else RENEWAL_S)


def _conclude(report: dict[str, Any], status: int) -> Answer:
    """Say why the walk ended. It succeeded if the robot holds its pose and no fault ended the walk."""
    fault = report["fault"]
    is_sound = report["mode"] == "hold" and not report["notice"] and (not fault or fault["reaction"] in MILD)
    if not is_sound:
        complain(report["notice"] or (fault["message"] if fault else "the torque was switched off"))
        status = exit_codes.REFUSED
    return mode_answer("walk", report["mode"], status=status)


class LiveLine:
    """Overwrites one line on a terminal; prints one line per stride elsewhere, and nothing if it is silent."""

    def __init__(self, silent: bool = False) -> None:
        self._silent = silent
        self._live = sys.stdout.isatty() and not silent
        self._shown = ""

    def show(self, report: dict[str, Any], hint: str = "Ctrl-C stops") -> None:
        summary = f"{report['mode']}, {stride_text(report)}"
        if self._live:
            print(f"\r\033[K{summary}, {position_text(report)}; {hint}", end="", flush=True)
        elif summary != self._shown and not self._silent:
            print(summary, flush=True)
        self._shown = summary

    def end(self) -> None:
        if self._live and self._shown:
            print("\r\033[K", end="", flush=True)
