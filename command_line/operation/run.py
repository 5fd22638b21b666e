"""Moves a robot by a control law that its user wrote: a function in a file, called once a stride, or at a rate.

    def law(strides):  # the reports of the stride that just closed, one for each flipper
        depth_m = strides[0]["depth_m"] + 0.001
        return {"depth_m": min(depth_m, 0.04), "sweep_angle_deg": 25.0}  # or a depth alone; None: as before

    RATE_HZ = 20.0  # the law is called so often while the robot holds its pose, with the status
    def law(status):
        return {"left_sweep_rad": 0.3 * sin(status["now_s"])}  # of any joints

The keys are those of the methods `strides` and `stride`, `status` and `move` of the socket (docs/reference/socket.md).
The law runs in this process, outside of the loop: it has a lease, which ends while a law takes too long, and what it
orders is limited as every operator's order is. A law that raises, or answers what is no order, ends the motion.
"""

import runpy
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from traceback import extract_tb
from typing import Annotated, Any

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.operation.attended_walk import LEASE_S, LawError, attend, attend_pose
from command_line.operation.operation import TakeOver
from command_line.screen import complain
from command_line.shared_options import Json, Socket
from experiments.study.option import Option
from firmware_host.lease import TAKEN_OVER
from operator_client.status_client import CallRefusedError, StatusClient

LOWEST_HZ, HIGHEST_HZ = 1.0, 50.0  # a move of a client of 200 requests a second takes three
FIRST_DEPTH_CM = 2.0
Report = dict[str, Any]
Law = Callable[[Any], Any]


def run(
    law: Annotated[str, Option("file and function; without one, the function `law`", metavar="FILE[:FUNCTION]")],
    *,
    socket: Socket,
    json: Json = False,
    depth: Annotated[
        float | None, Option(f"of the first stride (default: {FIRST_DEPTH_CM:g} cm)", unit="cm", low=0.5, high=20.0)
    ] = None,
    strides: Annotated[int, Option("stop after N (default: go on)", low=1, high=100000)] = 0,
    take_over: TakeOver = False,
) -> Answer:
    """Move by a control law of your own; the robot stops with this command, and with a law that fails or is late."""
    with redirect_stdout(sys.stderr if json else sys.stdout):  # what the law prints is no JSON
        chosen, rate_hz = load_law(law)
        for name, value in (("depth", depth), ("strides", strides)):
            if rate_hz and value:
                raise usage_error(
                    f"--{name} {value:g}: must be left out, as this law has RATE_HZ and moves single joints"
                )
        with StatusClient(socket) as client:
            if rate_hz:
                return _move_joints(client, chosen, rate_hz, take_over)
            read, reached = client.call("status")["strides_closed"], -1

            def order(client: StatusClient, status: Report) -> None:
                nonlocal read, reached
                reached = max(reached, status["stride"])
                closed = client.call("strides", since=read)
                read += len(closed)
                if closed and (answer := order_of(chosen, closed)) is not None:
                    _give(client, "stride", answer, "walking")

            depth_m = (depth or FIRST_DEPTH_CM) / 100.0
            answer = attend(client, json, {"depth_m": depth_m, "strides": strides, "take_over": take_over}, order)
        if answer.status == exit_codes.OK and not 0 < strides <= reached + 1:
            complain("another program stopped the robot")
            return answer._replace(report=None, status=exit_codes.REFUSED)
        return answer


def _move_joints(client: StatusClient, law: Law, rate_hz: float, take_over: bool) -> Answer:
    """Call the law at its rate; each of its moves goes on from the one before. A first one that is refused ends it."""
    begun = {"lease_s": LEASE_S, "take_over": take_over}
    _send(client, "move", angles_of(law, client.call("status")) | begun)

    def move(client: StatusClient, status: Report) -> None:
        _give(client, "move", angles_of(law, status), "hold")

    return attend_pose(client, move, 1.0 / rate_hz)


def load_law(target: str) -> tuple[Law, float]:
    """Return the function of FILE:FUNCTION and its rate, 0 where it is called once a stride. Raises CommandError."""
    file, colon, name = target.rpartition(":")
    path, name = Path(file if colon else target), name if colon else "law"
    path.stat()  # raises OSError where it is missing
    sys.path.append(str(path.absolute().parent))  # a law imports what lies next to it
    try:
        found = runpy.run_path(str(path))
    except (Exception, SystemExit) as problem:  # noqa: BLE001 - any error of a user's file
        raise usage_error(f"{path}: {type(problem).__name__}: {problem}") from problem
    law, rate_hz = found.get(name), found.get("RATE_HZ", 0.0)
    if not callable(law):
        raise usage_error(f"{path}: it has no function {name!r}")
    if not isinstance(rate_hz, int | float) or ("RATE_HZ" in found and not LOWEST_HZ <= rate_hz <= HIGHEST_HZ):
        raise usage_error(f"{path}: RATE_HZ = {rate_hz!r}: must be from {LOWEST_HZ:g} to {HIGHEST_HZ:g} Hz")
    return law, rate_hz


def order_of(law: Law, closed: list[Report]) -> Report | None:
    """Call the law, and return its order for the strides to come. Raises LawError."""
    answer = _answer_of(law, closed)
    if isinstance(answer, float) or hasattr(answer, "tolist"):  # one of numpy is no float
        return {"depth_m": answer}
    if answer is None or isinstance(answer, dict):
        return answer
    raise LawError(f"the law returned {answer!r:.60}: must be a depth in m, a dict with depth_m, or None")


def angles_of(law: Law, status: Report) -> Report:
    """Call the law, and return the angles of its joints. Raises LawError."""
    answer = _answer_of(law, status)
    if isinstance(answer, dict):
        return answer
    raise LawError(f"the law returned {answer!r:.60}: must be a dict of angles, such as left_sweep_rad")


def _answer_of(law: Law, seen: Any) -> Any:
    begun_s = time.monotonic()
    try:
        answer = law(seen)
    except KeyboardInterrupt:
        raise
    except BaseException as problem:  # any error of a user's law, such as SystemExit or asyncio's CancelledError
        calls = extract_tb(problem.__traceback__)[1:]  # after the one above
        own = [f" in line {call.lineno}" for call in calls if call.filename == calls[0].filename]
        raise LawError(f"the law raised {type(problem).__name__}{''.join(own[-1:])}: {problem}") from problem
    took_s = time.monotonic() - begun_s
    if took_s > LEASE_S:
        complain(f"the law took {took_s:.1f} s: a lease lasts {LEASE_S:g} s")
    return answer


def _give(client: StatusClient, method: str, order: Report, mode: str) -> None:
    """Give an order. Raises LawError where the daemon refuses it although the robot is in the mode for it.

    Raises CallRefusedError after a take-over: a stop would then be one of the program that moves the robot now.
    """
    try:
        _send(client, method, order)
    except CallRefusedError as problem:
        if str(problem).startswith(TAKEN_OVER):
            raise
        if client.call("status")["mode"] == mode:
            raise LawError(f"the order {order!r:.80} is refused: {problem}") from problem


def _send(client: StatusClient, method: str, order: Report) -> None:
    try:
        client.call(method, **order)
    except (TypeError, ValueError, OverflowError) as problem:
        raise LawError(f"the order {order!r:.80} cannot be sent: {problem}") from problem
