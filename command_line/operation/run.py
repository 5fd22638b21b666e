"""Walks by a control law that its user wrote: a function in a file, which is called once a stride.

    def law(strides):  # the reports of the stride that just closed, one for each flipper
        depth_m = strides[0]["depth_m"] + 0.001
        return {"depth_m": min(depth_m, 0.04), "sweep_angle_deg": 25.0}  # or a depth alone; None: as before

The keys are those of the methods `strides` and `stride` of the socket (docs/reference/socket.md). The law runs in this
process, outside of the loop: the walk is an attended one, whose lease ends while a law takes too long, and what a law
orders is limited as every operator's order is. A law that raises, or answers what is no order, ends the walk.
"""

import runpy
from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from typing import Annotated, Any

from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.operation.attended_walk import LawError, attend
from command_line.operation.operation import TakeOver
from command_line.shared_options import Json, Socket
from experiments.study.option import Option
from operator_client.status_client import CallRefusedError, StatusClient

Report = dict[str, Any]


def run(
    law: Annotated[str, Option("file and function; without one, the function `law`", metavar="FILE[:FUNCTION]")],
    *,
    socket: Socket,
    json: Json = False,
    depth: Annotated[float, Option("of the first stride", unit="cm", low=0.5, high=20.0)] = 2.0,
    strides: Annotated[int, Option("stop after N (default: go on)", low=1, high=100000)] = 0,
    take_over: TakeOver = False,
) -> Answer:
    """Walk by a control law of your own; the robot stops with this command, and with a law that fails or is late."""
    chosen = load_law(law)
    with StatusClient(socket) as client:
        read = client.call("status")["strides_closed"]

        def order(client: StatusClient) -> None:
            nonlocal read
            closed = client.call("strides", since=read)
            read += len(closed)
            if closed and (answer := order_of(chosen, closed)) is not None:
                _give(client, answer)

        return attend(client, json, {"depth_m": depth / 100.0, "strides": strides, "take_over": take_over}, order)


def load_law(target: str) -> Callable[[list[Report]], Any]:
    """Return the function of FILE:FUNCTION. Raises CommandError where there is none."""
    file, colon, name = target.rpartition(":")
    path, name = Path(file if colon else target), name if colon else "law"
    path.stat()  # raises OSError where it is missing
    try:
        found = runpy.run_path(str(path)).get(name)
    except (Exception, SystemExit) as problem:  # noqa: BLE001 - any error of a user's file
        raise usage_error(f"{path}: {type(problem).__name__}: {problem}") from problem
    if not callable(found):
        raise usage_error(f"{path}: it has no function {name!r}")
    return found  # type: ignore[no-any-return]


def order_of(law: Callable[[list[Report]], Any], closed: list[Report]) -> Report | None:
    """Call the law, and return its order for the strides to come. Raises LawError."""
    try:
        answer = law(closed)
    except (Exception, SystemExit) as problem:  # noqa: BLE001 - any error of a user's law
        line = extract_tb(problem.__traceback__)[-1].lineno
        raise LawError(f"the law raised {type(problem).__name__} in line {line}: {problem}") from problem
    if isinstance(answer, float):
        return {"depth_m": answer}
    if answer is None or isinstance(answer, dict):
        return answer
    raise LawError(f"the law returned {answer!r:.60}: must be a depth in m, a dict with depth_m, or None")


def _give(client: StatusClient, order: Report) -> None:
    """Order the strides to come. Raises LawError where the daemon refuses it although the robot walks."""
    try:
        client.call("stride", **order)
    except (CallRefusedError, TypeError) as problem:  # a TypeError: it cannot be sent
        if client.call("status")["mode"] == "walking":
            raise LawError(f"the order {order!r:.80} is refused: {problem}") from problem
