"""What a person sees who may stop the robot and no more."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes, operation
from firmware_host.status_client import NotPermittedError

REFUSAL = "status is for members of the group mudskipper"


class StoppingClient:
    """To a daemon that lets this user stop the robot, but not look at it."""

    def __init__(self, path: Path) -> None:
        return

    def call(self, method: str, **params: Any) -> str:
        if method not in ("stop", "disarm"):
            raise NotPermittedError(REFUSAL)
        return "accepted"

    def close(self) -> None:
        return


@pytest.fixture
def options(monkeypatch: pytest.MonkeyPatch) -> Namespace:
    monkeypatch.setattr(operation, "StatusClient", StoppingClient)
    return Namespace(socket=Path("/none"), json=False, strides=0, depth=None, attended=False)


@pytest.mark.parametrize("command", [operation.stop, operation.disarm])
def test_a_stop_is_done_although_its_effect_may_not_be_seen(
    options: Namespace, capsys: pytest.CaptureFixture[str], command: Any
) -> None:
    assert command(options) == exit_codes.OK
    said = capsys.readouterr()
    assert said.out == "accepted\n" and REFUSAL in said.err


@pytest.mark.parametrize("attended", [False, True])
@pytest.mark.parametrize("command", [operation.status, operation.arm, operation.walk, operation.clear])
def test_anything_else_is_not_permitted(
    options: Namespace, capsys: pytest.CaptureFixture[str], command: Any, attended: bool
) -> None:
    options.attended = attended
    assert command(options) == exit_codes.NOT_PERMITTED
    assert capsys.readouterr().err == f"mudskipper: {REFUSAL}\n"
