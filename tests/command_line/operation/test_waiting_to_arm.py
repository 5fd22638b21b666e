"""`mudskipper arm --wait` arms once what ends by itself has ended, and gives up at once on what a person must end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import operation
from operator_client.status_client import CallRefusedError
from tests.command_line.command_lines import run


class Moving:
    """A daemon that refuses the first three calls of `arm`, in a mode."""

    mode = "idle"

    def __init__(self, path: Path) -> None:
        self.refusals, self.armed = 3, False

    def call(self, method: str, **params: Any) -> Any:
        if method == "arm" and self.refusals:
            self.refusals -= 1
            raise CallRefusedError("The left_sweep joint moves while torque is off.")
        self.armed = self.armed or method == "arm"
        return {"mode": "hold" if self.armed else self.mode, "notice": ""}

    def close(self) -> None:
        return


@pytest.mark.parametrize(
    ("mode", "option", "status"),
    [("idle", "--wait", exit_codes.OK), ("fault", "--wait", exit_codes.REFUSED), ("idle", "", exit_codes.REFUSED)],
)
def test_only_what_ends_by_itself_is_waited_for(
    mode: str, option: str, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operation, "StatusClient", Moving)
    monkeypatch.setattr(Moving, "mode", mode)
    ended = run("arm", *filter(None, [option]))
    assert ended.returncode == status and ended.stderr.count("left_sweep joint moves") == 1
