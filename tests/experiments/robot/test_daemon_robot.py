"""An experiment operates a robot through a daemon's socket in real time: its calls, its lease, and the growing log."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from command_line import exit_codes
from control.controller import UP_RAD
from control.modes import Mode
from experiments.robot.bench_errors import BenchError, RobotInUseError
from experiments.robot.bench_robot import arm, disarm, move, walk
from experiments.robot.daemon_robot import DaemonRobot
from logs.files.log_reader import read_log
from operator_client.status_client import CallRefusedError
from tests.command_line.command_lines import run_process
from tests.running_bench import Bench
from tests.waiting import LONGEST_S


def run_in_another_terminal(robot: DaemonRobot, bench: Bench, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command as in another terminal, while the experiment waits and renews its lease."""
    with ThreadPoolExecutor(1) as terminals:
        command = terminals.submit(run_process, *arguments, MUDSKIPPER_SOCKET=str(bench.socket))
        with suppress(RobotInUseError):
            while not command.done():
                robot.wait(0.05)
        return command.result()


def test_an_experiment_operates_the_daemon_and_reads_its_log(bench: Bench, tmp_path: Path) -> None:
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


def test_an_experiment_that_is_killed_with_its_flippers_in_the_mud_leaves_them_raised_and_without_torque(
    bench: Bench,
) -> None:
    program = (
        "import sys, time\nfrom pathlib import Path\nfrom experiments.robot.bench_robot import arm\n"
        "from experiments.robot.daemon_robot import DaemonRobot\n"
        "robot = DaemonRobot(Path(sys.argv[1]))\narm(robot)\nrobot.call('walk', depth_m=0.03)\nrobot.wait(60.0)\n"
    )
    experiment = subprocess.Popen([sys.executable, "-c", program, str(bench.socket)])
    bench.wait_for(lambda status: bool(status["phase"] == "insertion"))
    experiment.kill()
    assert experiment.wait(LONGEST_S)
    report = bench.wait_for(lambda status: bool(status["mode"] == "idle"))
    assert "lease_lost" in report["notice"]
    watcher = DaemonRobot(bench.socket)
    rows = watcher.record(0.0, report["now_s"]).ticks
    watcher.close()
    raised = rows["mode"] == Mode.STOPPING
    assert raised.any() and abs(rows["angle_rad"][raised][-1, [1, 3]]).max() < UP_RAD
    assert not rows["torque_command_nm"][rows["mode"] == Mode.IDLE].any()


def test_a_missing_daemon_is_reported_with_how_to_start_it(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"no daemon answers on .*Start it with 'systemctl start mudskipper'"):
        DaemonRobot(tmp_path / "none.sock")


def test_the_end_of_a_daemon_is_reported_and_its_log_remains(own_bench: Bench, tmp_path: Path) -> None:
    robot = DaemonRobot(own_bench.socket)
    arm(robot)
    own_bench.daemon.terminate()
    own_bench.daemon.wait(LONGEST_S)
    with pytest.raises(BenchError, match="the daemon on"):
        robot.call("status")
    (copy,) = robot.copy_logs(tmp_path)
    assert read_log(copy).complete
    robot.close()


def test_no_log_is_copied_before_the_robot_obeys_and_a_failed_copy_is_reported(
    bench: Bench,
    tmp_path: Path,
) -> None:
    robot = DaemonRobot(bench.socket)
    try:
        with pytest.raises(CallRefusedError):
            robot.call("walk", depth_m=0.03)
        assert robot.copy_logs(tmp_path) == []
        arm(robot)
        with pytest.raises(BenchError, match=r"/gone/.*: No such file or directory; it remains in .*/logs, copy it"):
            robot.copy_logs(tmp_path / "gone")
    finally:
        robot.close()


def test_a_robot_that_another_program_operates_is_left_to_it(bench: Bench) -> None:
    first = DaemonRobot(bench.socket)
    try:
        with pytest.raises(BenchError, match="operates the robot: wait for its end"):
            DaemonRobot(bench.socket)
        arm(first)
        for command in (("move", "left_sweep=3"), ("walk",), ("walk", "--attended")):
            refused = run_in_another_terminal(first, bench, *command)
            assert refused.returncode == exit_codes.REFUSED and "operates the robot" in refused.stderr
        assert json.loads(run_in_another_terminal(first, bench, "status", "--json").stdout)["lease"]
        move(first, {"right_sweep": 0.05})
        disarm(first)
        assert "operates the robot" in run_in_another_terminal(first, bench, "arm").stderr
    finally:
        first.close()
    bench.wait_for(lambda status: not status["faults"])  # the flippers have come down
    assert bench.run("arm").returncode == exit_codes.OK


def test_a_robot_that_another_program_took_over_is_left_alone(bench: Bench) -> None:
    robot = DaemonRobot(bench.socket)
    arm(robot)
    assert run_in_another_terminal(robot, bench, "move", "--take-over", "left_sweep=3").returncode == exit_codes.OK
    operations = (partial(robot.wait, 0.3), partial(move, robot, {"left_sweep": 0.0}), partial(disarm, robot))
    for operate in operations:
        with pytest.raises(BenchError, match="taken over: uid .* wanted the robot; begin again when it is free"):
            operate()
    robot.close()
    assert bench.run("walk").returncode == exit_codes.OK
    with pytest.raises(BenchError, match="the robot is walking: wait for its end, or 'mudskipper stop'"):
        DaemonRobot(bench.socket)
    assert bench.wait_for(lambda status: status["lease"] is None)["mode"] == "walking"
