"""An experiment begins only if it is permitted to, and handles a lease that expired while its computer slept."""

import errno
from pathlib import Path
from typing import Any

import pytest

from experiments.robot import daemon_robot
from experiments.robot.bench_errors import AccessDeniedError, RobotInUseError
from experiments.robot.daemon_robot import DaemonRobot
from operator_client.status_client import CallRefusedError
from tests.experiments.synthetic_strides import make_log, make_ticks

ME = "uid 1 (process 2)"
LOST = {"name": "lease_lost"}


class ScriptedDaemon:
    """A StatusClient with a scripted daemon, whose lease expires when a test calls `lapse`."""

    def __init__(self) -> None:
        self.lease: str | None = None
        self.mode = "idle"
        self.faults: list[dict[str, str]] = []
        self.called: list[str] = []
        self.overruled = self.closed = False

    def call(self, method: str, **params: Any) -> Any:
        self.called.append(method)
        if method == "lease" and self.overruled:
            raise CallRefusedError("taken over: uid 3 wanted the robot")
        if method in ("lease", "release"):
            self.lease = ME if method == "lease" else None
        log = {"path": "/logs/active/run-0000.mcap"}
        return {"now_s": 1.0, "lease": self.lease, "mode": self.mode, "faults": self.faults, "log": log}

    def lapse(self, mode: str, faults: list[dict[str, str]]) -> None:
        self.lease, self.mode, self.faults = None, mode, faults
        self.called.clear()

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def daemon(monkeypatch: pytest.MonkeyPatch) -> ScriptedDaemon:
    made = ScriptedDaemon()
    monkeypatch.setattr(daemon_robot, "StatusClient", lambda socket: made)
    monkeypatch.setattr(daemon_robot, "RENEWAL_S", 0.0)
    monkeypatch.setattr(DaemonRobot, "_read", lambda self, segments, from_s: make_log(make_ticks([])))
    monkeypatch.setattr(daemon_robot, "run_files", lambda path: [path])
    return made


def test_who_may_not_read_the_log_is_refused_before_anything_moves_and_leaves_no_lease(
    daemon: ScriptedDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lease that expires later would switch off the torque of an operator who uses the robot without a lease."""

    def refuse(path: Path) -> list[Path]:
        raise PermissionError(errno.EACCES, "Permission denied", "/logs")

    monkeypatch.setattr(daemon_robot, "run_files", refuse)
    with pytest.raises(AccessDeniedError, match="not read its log, .* have root add you to the group of /logs"):
        DaemonRobot(Path("x"))
    assert set(daemon.called) == {"status", "lease", "release"} and daemon.closed
    assert daemon.lease is None


@pytest.mark.parametrize("overruled", [False, True])
@pytest.mark.parametrize("mode", ["arming", "hold", "walking"])
def test_a_robot_that_another_program_armed_is_left_alone(daemon: ScriptedDaemon, mode: str, overruled: bool) -> None:
    """The experiment's open question may say that torque is off, and hands may be in the mud."""
    robot = DaemonRobot(Path("x"))
    daemon.lapse(mode, [])
    daemon.overruled = overruled
    reported = "taken over: uid 3" if overruled else "the robot was armed by another program"
    for method in ("arm", "disarm", "stop"):
        with pytest.raises(RobotInUseError, match=reported):
            robot.call(method)
    with pytest.raises(RobotInUseError):
        robot.wait(0.0)
    robot.close()
    assert set(daemon.called) <= {"status", "lease", "release"} and daemon.lease is None


@pytest.mark.parametrize(("mode", "faults"), [("idle", []), ("fault", []), ("stopping", [LOST]), ("hold", [LOST])])
def test_an_expired_lease_of_a_free_robot_is_taken_again(
    daemon: ScriptedDaemon, mode: str, faults: list[dict[str, str]]
) -> None:
    robot = DaemonRobot(Path("x"))
    daemon.lapse(mode, faults)
    robot.call("arm")
    assert daemon.called[-1] == "arm" and daemon.lease == ME
