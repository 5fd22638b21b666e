"""The same through a daemon's socket, in real time: the calls, the lease, and the log that is being written."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.bench_robot import BenchError, arm, disarm, move, walk
from experiments.daemon_robot import DaemonRobot
from firmware_host.log_reader import read_log
from tests.command_line.conftest import Bench, bench  # noqa: F401 - the fixture


def test_an_experiment_operates_the_daemon_and_reads_its_log(bench: Bench, tmp_path: Path) -> None:  # noqa: F811
    robot = DaemonRobot(bench.socket)
    try:
        assert robot.configuration.robot.name == "simulated"
        arm(robot)
        move(robot, {"right_adduction": 0.1})
        robot.wait(0.3)
        assert robot.call("status")["lease"]
        walked = walk(robot, 0.03, 1)
        rows = robot.record(walked.from_s, walked.to_s)
        assert {stride["flipper"] for stride in walked.strides} == {"left", "right"}
        assert len(rows.strides) == 2 and rows.ticks["stamp_s"][-1] > walked.to_s - 0.02
        disarm(robot)
        (copy,) = robot.copy_logs(tmp_path)
        assert read_log(copy).complete
    finally:
        robot.close()


def test_the_robot_stops_where_the_experiment_dies(bench: Bench) -> None:  # noqa: F811
    robot = DaemonRobot(bench.socket)
    arm(robot)
    robot.wait(0.3)
    robot._client.close()
    report = bench.wait_for(lambda status: bool(status["mode"] not in ("hold", "stopping")), 10.0)
    assert "lease" in report["notice"]


def test_without_a_daemon_it_is_told_how_to_start_one(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"no daemon answers on .*Start it with 'systemctl start mudskipper'"):
        DaemonRobot(tmp_path / "none.sock")


def test_a_daemon_that_ends_is_told_and_its_log_is_there(bench: Bench, tmp_path: Path) -> None:  # noqa: F811
    robot = DaemonRobot(bench.socket)
    assert robot.configuration
    bench.daemon.terminate()
    bench.daemon.wait(20)
    with pytest.raises(BenchError, match="the daemon on"):
        robot.call("status")
    (copy,) = robot.copy_logs(tmp_path)
    assert read_log(copy).complete
    robot.close()


def test_a_robot_that_another_program_operates_is_left_to_it(bench: Bench) -> None:  # noqa: F811
    first, second = DaemonRobot(bench.socket), DaemonRobot(bench.socket)
    second._name = "somebody else"  # both are this process
    try:
        arm(first)
        first.wait(0.3)
        with pytest.raises(BenchError, match="operates the robot: wait until it has ended"):
            walk(second, 0.03, 1)
        second.close()
        assert first.call("status")["mode"] == "hold"
        disarm(first)  # its lease is not over yet
        first.wait(0.3)
    finally:
        first.close()
