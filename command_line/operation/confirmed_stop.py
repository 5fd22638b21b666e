"""`mudskipper stop` and `disarm`: they succeed only where every drive has confirmed the result (confirmation.py)."""

import argparse

from command_line import exit_codes
from command_line.operation.confirmation import TORQUE_UNKNOWN, confirm, who_may_see
from command_line.operation.operation import with_daemon
from command_line.screen import complain
from firmware_host.operator.status_client import NotPermittedError, StatusClient


def stop(options: argparse.Namespace) -> int:
    return _end_motion(options, "stop")


def disarm(options: argparse.Namespace) -> int:
    return _end_motion(options, "disarm")


def _end_motion(options: argparse.Namespace, method: str) -> int:
    status = with_daemon(options, lambda client: _request(client, method))
    if status != exit_codes.OK:
        complain(TORQUE_UNKNOWN)
    return status


def _request(client: StatusClient, method: str) -> int:
    accepted = client.call(method)
    try:
        confirmation = confirm(client, method)
    except NotPermittedError as problem:
        print(who_may_see(accepted, problem))
        return exit_codes.TORQUE_UNKNOWN
    if not confirmation.reached:
        complain(confirmation.text)
        return exit_codes.TIMED_OUT
    print(confirmation.mode)
    complain(*filter(None, [confirmation.notice]))
    if not confirmation.complete:
        complain(confirmation.text)
        return exit_codes.TORQUE_UNKNOWN
    return exit_codes.OK
