"""Sends the orders of the keys, each over a connection of its own: none waits for another, or for the screen.

A stop or a disarm counts as done once every drive has confirmed it, as `mudskipper stop` and `disarm` do.
"""

from contextlib import closing
from pathlib import Path
from typing import Any

from command_line.operation.confirmation import ANSWER_S, ENDINGS, end_motion
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient


def send_order(path: Path, method: str, **params: Any) -> str:
    """Return what became of the order, for the operator."""
    if method in ENDINGS:
        return end_motion(path, method).text
    try:
        with closing(StatusClient(path, ANSWER_S)) as client:
            answer = client.call(method, **params)
            return f"{method}: {answer if isinstance(answer, str) else answer['time']}"
    except (CallRefusedError, NotPermittedError) as problem:
        return f"{method} refused: {problem}"
    except NoDaemonError as problem:
        return f"{method}: {problem}"
