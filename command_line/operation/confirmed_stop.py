"""`mudskipper stop` and `disarm`: they succeed only where every drive has confirmed the result.

A drive confirms by a heartbeat that is newer than the request: of any state where the robot holds its pose, else of an
idle drive. In every other case the torque is unknown, and the operator has to cut the motor power.
"""

import argparse
import time
from typing import Any

from command_line import exit_codes
from command_line.operation.operation import ARMING_S, POLL_S, with_daemon
from command_line.screen import complain
from firmware_host.operator.rpc import FOR_MEMBERS
from firmware_host.operator.status_client import NotPermittedError, StatusClient

RESTING = ("idle", "boot", "fault")
STOPPING_S = 10.0
CONFIRMING_S = 1.5  # after the mode was reached: the longest heartbeat period is 1 s
TORQUE_UNKNOWN = "torque unknown: cut motor power"


def stop(options: argparse.Namespace) -> int:
    return _end_motion(options, "stop", ("hold", *RESTING), STOPPING_S)


def disarm(options: argparse.Namespace) -> int:
    return _end_motion(options, "disarm", RESTING, ARMING_S)


def unconfirmed_drives(report: dict[str, Any], since_request_s: float) -> list[str]:
    """Returns the joints whose drives have not confirmed since the request."""
    holding = report["mode"] == "hold"
    return [drive["joint"] for drive in report["drives"] if not _confirms(drive, holding, since_request_s)]


def _confirms(drive: dict[str, Any], holding: bool, since_request_s: float) -> bool:
    age_s = drive["heartbeat_age_s"]
    return age_s is not None and age_s < since_request_s and (holding or not drive["closed_loop"])


def _end_motion(options: argparse.Namespace, method: str, modes: tuple[str, ...], longest_s: float) -> int:
    status = with_daemon(options, lambda client: _request(client, method, modes, longest_s))
    if status != exit_codes.OK:
        complain(TORQUE_UNKNOWN)
    return status


def _request(client: StatusClient, method: str, modes: tuple[str, ...], longest_s: float) -> int:
    accepted = client.call(method)
    try:
        return _wait_for_drives(client, modes, longest_s)
    except NotPermittedError as problem:
        group = str(problem).partition(FOR_MEMBERS)[2].partition(". ")[0]
        print(f"{accepted}; only members of the group {group} can see whether the robot has stopped")
        return exit_codes.TORQUE_UNKNOWN


def _wait_for_drives(client: StatusClient, modes: tuple[str, ...], longest_s: float) -> int:
    requested_s = time.monotonic()
    reached_s: float | None = None
    while True:
        asked_s = time.monotonic()
        report = client.call("status")
        unconfirmed = unconfirmed_drives(report, asked_s - requested_s)
        reached_s = (reached_s or asked_s) if report["mode"] in modes else None
        if reached_s is None and asked_s - requested_s > longest_s:
            complain(f"still {report['mode']} after {longest_s:g} s")
            return exit_codes.TIMED_OUT
        if reached_s is not None and (not unconfirmed or asked_s - reached_s > CONFIRMING_S):
            return _conclude(report, unconfirmed)
        time.sleep(POLL_S)


def _conclude(report: dict[str, Any], unconfirmed: list[str]) -> int:
    print(report["mode"])
    if report["notice"]:
        complain(report["notice"])
    if not unconfirmed:
        return exit_codes.OK
    what = "that it is idle" if report["mode"] != "hold" else "the stop"
    complain(f"not confirmed {what}: {', '.join(unconfirmed)}")
    return exit_codes.TORQUE_UNKNOWN
