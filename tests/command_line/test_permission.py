"""A user who is only permitted to stop the robot can do nothing else."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import operation
from command_line.operation.confirmation import TORQUE_UNKNOWN
from operator_client.status_client import NotPermittedError, StatusClient
from tests.command_line.command_lines import run
from tests.running_bench import Bench

NOBODY = 65534
REFUSAL = "status is for members of the group mudskipper. Have root run 'adduser YOU mudskipper', then log in again"


class StoppingClient:
    """Lets this user stop the robot, but not see its status."""

    def __init__(self, path: Path) -> None:
        return

    def call(self, method: str, **params: Any) -> str:
        if method not in ("stop", "disarm"):
            raise NotPermittedError(REFUSAL)
        return "accepted"

    def close(self) -> None:
        return


@pytest.fixture
def stopping_client(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operation, "StatusClient", StoppingClient)


@pytest.mark.usefixtures("stopping_client")
@pytest.mark.parametrize("command", ["stop", "disarm"])
def test_a_stop_is_accepted_but_not_confirmed_where_the_status_is_not_permitted(command: str) -> None:
    ended = run(command)
    assert ended.returncode == exit_codes.TORQUE_UNKNOWN
    assert "accepted" in ended.stderr and TORQUE_UNKNOWN in ended.stderr


@pytest.mark.usefixtures("stopping_client")
@pytest.mark.parametrize("command", ["status", "arm", "walk", "walk --attended", "clear", "check"])
def test_anything_else_is_not_permitted(command: str) -> None:
    ended = run(*command.split())
    assert (ended.returncode, ended.stderr) == (exit_codes.NOT_PERMITTED, f"mudskipper: {REFUSAL}\n")


def permitted(path: Path, method: str, groups: Sequence[int] = ()) -> bool:
    """Return whether a process of another user with only these groups may call `method`."""
    child = os.fork()
    if child == 0:
        status = 2
        try:
            os.setgroups(groups)
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
def test_a_user_without_a_group_may_stop_a_real_robot_and_no_more(bench: Bench) -> None:
    bench.folder.chmod(0o755)
    assert bench.run("arm").stdout == "hold\n"
    allowed = {method for method in ("hello", "status", "arm", "walk", "lease", "clear", "stop", "disarm")
               if permitted(bench.socket, method)}  # fmt: skip
    assert allowed == {"hello", "stop", "disarm"}
    assert bench.wait_for(lambda report: report["mode"] == "idle")["fault"] is None
