"""`mudskipper stop` and `disarm`: they succeed only where every drive has confirmed the result (confirmation.py)."""

from pathlib import Path

from command_line import exit_codes
from command_line.errors import CommandError, report
from command_line.operation.confirmation import TORQUE_UNKNOWN, Confirmation, confirm, who_may_see
from command_line.operation.mode_output import print_mode
from command_line.operation.operation import connect
from command_line.screen import complain
from command_line.shared_options import Json, Socket
from operator_client.status_client import NotPermittedError, StatusClient


def stop(*, socket: Socket, json: Json = False) -> int:
    return _end_motion("stop", socket, json)


def disarm(*, socket: Socket, json: Json = False) -> int:
    return _end_motion("disarm", socket, json)


def _end_motion(command: str, socket: Path, as_json: bool) -> int:
    try:
        with connect(socket) as client:
            confirmation = _confirmed(client, command)
        print_mode(command, as_json, confirmation.mode, confirmation.notice, reached=confirmation.complete)
        if not confirmation.complete:
            raise CommandError(confirmation.text, status=exit_codes.TORQUE_UNKNOWN)
    except Exception as problem:  # noqa: BLE001 - `report` raises again what it does not know
        status = report(problem)
        complain(TORQUE_UNKNOWN)
        return status
    return exit_codes.OK


def _confirmed(client: StatusClient, command: str) -> Confirmation:
    """Return what the drives confirm. Raise CommandError for a robot that did not get there or cannot be seen."""
    accepted = client.call(command)
    try:
        confirmation = confirm(client, command)
    except NotPermittedError as problem:
        raise CommandError(who_may_see(accepted, problem), status=exit_codes.TORQUE_UNKNOWN) from None
    if not confirmation.reached:
        raise CommandError(confirmation.text, status=exit_codes.TIMED_OUT)
    return confirmation
