"""A walk that somebody stays with: it goes on for as long as this program renews its lease.

Ctrl-C stops the robot and waits until it holds. Where this program dies, hangs, or loses its machine's attention for
longer than it has promised, the daemon stops the robot by itself.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from command_line import exit_codes
from command_line.screen import complain
from experiments.reports.text_tables import number
from firmware_host.operator.status_client import CallRefusedError, StatusClient

PROMISE_S = 1.0
RENEWAL_S = 0.2
UNDER_WAY = ("walking", "stopping", "damping")
MILD = ("none", "warn")  # reactions that leave a walk alone


def attend(client: StatusClient, params: dict[str, Any]) -> int:
    """Walk, and return when the robot is at rest. Only a walk that is accepted takes the lease, and with it."""
    client.call("walk", lease_s=PROMISE_S, **params)
    try:
        report, status = _stay(client), exit_codes.OK
    except KeyboardInterrupt:
        client.call("stop")
        report, status = _stay(client), exit_codes.INTERRUPTED
    client.call("release")
    return _conclude(report, status)


def _stay(client: StatusClient) -> dict[str, Any]:
    """The status at the walk's end."""
    line = LiveLine()
    while True:
        report: dict[str, Any] = client.call("status")
        if report["mode"] not in UNDER_WAY:
            line.end()
            return report
        line.show(report)
        try:
            client.call("lease", for_s=PROMISE_S)
        except CallRefusedError:
            if client.call("status")["mode"] in UNDER_WAY:
                line.end()
                raise
        time.sleep(RENEWAL_S)


def _conclude(report: dict[str, Any], status: int) -> int:
    """It has ended well where the robot holds its pose, and nothing is to be told: no fault kept it from walking."""
    print(report["mode"])
    fault = report["fault"]
    if report["mode"] == "hold" and not report["notice"] and (not fault or fault["reaction"] in MILD):
        return status
    complain(report["notice"] or (fault["message"] if fault else "the torque was switched off"))
    return exit_codes.REFUSED


class LiveLine:
    """Written over again and again on a terminal; a line each stride anywhere else."""

    def __init__(self) -> None:
        self._live = sys.stdout.isatty()
        self._shown = ""

    def show(self, report: dict[str, Any]) -> None:
        place = f"{report['mode']}, stride {report['stride']}"
        if self._live:
            depth_cm, x_m = 100.0 * report["depth_m"], number(report["body_x_m"])
            text = f"{place}, {report['phase']}, depth {depth_cm:.1f} cm, body {x_m} m; Ctrl-C stops"
            print(f"\r\033[K{text}", end="", flush=True)
        elif place != self._shown:
            print(place, flush=True)
        self._shown = place

    def end(self) -> None:
        if self._live and self._shown:
            print("\r\033[K", end="", flush=True)
