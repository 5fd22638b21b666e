"""A client of a daemon that answers as a test wants."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from command_line.operation import confirmation, failing, joy, operation, run, status, trial
from operator_client.status_client import StatusClient

Answer = Callable[[str], Any]  # of a method


class FakeClient(StatusClient):
    """Records the calls. An answer that is an error is raised."""

    def __init__(self, answer: Answer) -> None:
        self.answer = answer
        self.calls: list[str] = []

    def call(self, method: str, /, **params: Any) -> Any:
        self.calls.append(f"{method} {params.get('depth_m', '')}".strip())
        answer = self.answer(method)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def close(self) -> None:
        self.calls.append("close")


def answer_with(patch: pytest.MonkeyPatch, answer: Answer) -> None:
    """Let the commands of an operator meet a daemon that answers like this."""

    def connect(path: Path, timeout_s: float = 0.0) -> FakeClient:
        return FakeClient(answer)

    for module in (confirmation, failing, joy, operation, run, status, trial):
        patch.setattr(module, "StatusClient", connect)


def next_of(*reports: Any) -> Answer:
    """Answer each `status` with the next report, and repeat the last one."""
    left = list(reports)
    return lambda method: (left.pop(0) if len(left) > 1 else left[0]) if method == "status" else "accepted"
