"""A user who is only permitted to stop the robot can do nothing else."""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from operator_client.status_client import NotPermittedError, StatusClient
from tests.running_bench import Bench

NOBODY = 65534


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
