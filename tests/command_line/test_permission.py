"""What a person sees who may stop the robot and no more."""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes, operation
from firmware_host.status_client import NotPermittedError, StatusClient

NOBODY = 65534
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


def permitted(path: Path, method: str) -> bool:
    """Of a process of another user, in no group of the daemon's."""
    child = os.fork()
    if child == 0:
        status = 2
        try:
            os.setgroups([])
            os.setresgid(NOBODY, NOBODY, NOBODY)
            os.setresuid(NOBODY, NOBODY, NOBODY)
            StatusClient(path).call(method)
            status = 0
        except NotPermittedError:
            status = 1
        finally:
            os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in (0, 1)
    return status == 0


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_a_real_stranger_may_stop_a_real_daemon_s_robot_and_no_more(bench: Any) -> None:
    bench.folder.chmod(0o755)
    assert bench.run("arm").stdout == "hold\n"
    allowed = {method for method in ("hello", "status", "arm", "walk", "lease", "clear", "stop", "disarm")
               if permitted(bench.socket, method)}  # fmt: skip
    assert allowed == {"hello", "stop", "disarm"}
    assert bench.wait_for(lambda report: report["mode"] == "idle")["fault"] is None
