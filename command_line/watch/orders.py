"""Sends the orders of the keys, each over a connection of its own: none waits for another, or for the screen.

A stop or a disarm counts as done once every drive has confirmed it, as `mudskipper stop` and `disarm` do.
"""

import time
from pathlib import Path
from typing import Any

from command_line.operation.confirmed_stop import (
    CONFIRMING_S,
    RESTING,
    STOPPING_S,
    TORQUE_UNKNOWN,
    unconfirmed_drives,
)
from command_line.operation.operation import ARMING_S
from firmware_host.operator.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

ANSWER_S = 2.0
POLL_S = 0.1
ENDINGS = {"stop": (("hold", *RESTING), STOPPING_S), "disarm": (RESTING, ARMING_S)}  # modes, and the longest time


def send_order(path: Path, method: str, **params: Any) -> str:
    """Return what became of the order, for the operator."""
    unknown = f"{TORQUE_UNKNOWN}. " if method in ENDINGS else ""
    try:
        client = StatusClient(path, ANSWER_S)
        try:
            answer = client.call(method, **params)
            return _confirm(client, method) if method in ENDINGS else f"{method}: {answer}"
        finally:
            client.close()
    except (CallRefusedError, NotPermittedError) as problem:
        return f"{unknown}{method} refused: {problem}"
    except NoDaemonError as problem:
        return f"{unknown}{method}: {problem}"


def _confirm(client: StatusClient, method: str) -> str:
    modes, longest_s = ENDINGS[method]
    requested_s = time.monotonic()
    deadline_s = requested_s + longest_s
    reached = False
    while True:
        asked_s = time.monotonic()
        report = client.call("status")
        unconfirmed = unconfirmed_drives(report, asked_s - requested_s)
        if report["mode"] in modes and not reached:
            reached, deadline_s = True, asked_s + CONFIRMING_S
        if report["mode"] in modes and not unconfirmed:
            return f"{method}: every drive has confirmed it"
        if asked_s > deadline_s:
            return f"{TORQUE_UNKNOWN}. {method} is not confirmed by {', '.join(unconfirmed) or report['mode']}"
        time.sleep(POLL_S)
