"""`mudskipper stop` and `disarm`: they succeed only where every drive has confirmed the result (confirmation.py)."""

import argparse

from command_line import exit_codes
from command_line.operation.confirmation import TORQUE_UNKNOWN, confirm, who_may_see
from command_line.operation.mode_output import print_mode
from command_line.operation.operation import with_daemon
from command_line.screen import complain
from operator_client.status_client import NotPermittedError, StatusClient


def end_motion(options: argparse.Namespace) -> int:
    """Stops or disarms, by the command's name."""
    status = with_daemon(options, lambda client: _request(client, options))
    if status != exit_codes.OK:
        complain(TORQUE_UNKNOWN)
    return status


def _request(client: StatusClient, options: argparse.Namespace) -> int:
    accepted = client.call(options.command)
    try:
        confirmation = confirm(client, options.command)
    except NotPermittedError as problem:
        complain(who_may_see(accepted, problem))
        return exit_codes.TORQUE_UNKNOWN
    if not confirmation.reached:
        complain(confirmation.text)
        return exit_codes.TIMED_OUT
    print_mode(options, confirmation.mode, confirmation.notice, reached=confirmation.complete)
    if not confirmation.complete:
        complain(confirmation.text)
        return exit_codes.TORQUE_UNKNOWN
    return exit_codes.OK
