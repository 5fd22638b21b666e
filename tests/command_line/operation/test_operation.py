"""The robot operated as a person does it: processes, a real socket, real time."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import msgpack
import pytest

from command_line import commands, exit_codes, main
from control.modes import Mode
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, StatusParameters
from firmware_host.log_reading.log_reader import read_log
from firmware_host.log_reading.replay import replay_file
from simulation.harness.peer import WATCHDOG_S
from tests.command_line.command_lines import run
from tests.waiting import LONGEST_S


def test_a_whole_session(bench: Any) -> None:
    """status, check, arm, walk, status, stop, disarm; then the daemon ends and the log is whole."""
    assert bench.run("check").returncode == exit_codes.OK
    too_early = bench.run("walk")
    assert too_early.returncode == exit_codes.REFUSED and "arm" in too_early.stderr
    assert bench.run("arm").stdout == "hold\n"
    assert bench.run("move", "left_sweep=10", "right_sweep=10").stdout == "hold\n"
    assert abs(json.loads(bench.run("status", "--json").stdout)["drives"][0]["angle_rad"] - 0.1745) < 0.03
    assert "must be from" in bench.run("move", "left_sweep=170").stderr
    assert bench.run("walk", "--depth", "3").stdout == "walking\n"
    bench.wait_for(lambda report: report["strides_closed"] >= 2)
    status = json.loads(bench.run("status", "--json").stdout)
    assert status["schema"] == "status/2" and status["mode"] == "walking"
    assert all(drive["closed_loop"] for drive in status["drives"])
    table = bench.run("status").stdout
    assert "walking" in table and "left_sweep" in table and "\033" not in table
    assert bench.run("stop").stdout == "hold\n"
    assert bench.run("disarm").stdout == "idle\n"
    bench.daemon.send_signal(signal.SIGTERM)
    assert bench.daemon.wait(LONGEST_S) == 0
    (path,) = (bench.logs / "done").glob("*.mcap")
    assert read_log(path).complete
    assert len(replay_file(path).strides) >= 2


@pytest.mark.parametrize("text", ["left_sweep", "left_sweep=", "left_sweep=far", "left_sweep=nan", "=3"])
def test_what_is_no_angle_of_a_joint_is_wrong_usage(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main.main(["move", text])
    assert "must be a joint and its angle in degrees" in capsys.readouterr().err


def test_sigterm_in_a_walk_finishes_safely(bench: Any) -> None:
    bench.run("arm")
    bench.run("walk")
    bench.wait_for(lambda report: report["phase"] == "stance")
    bench.daemon.send_signal(signal.SIGTERM)
    assert bench.daemon.wait(LONGEST_S) == 0
    (path,) = (bench.logs / "done").glob("*.mcap")
    log = read_log(path)
    texts = [event["text"] for event in log.events]
    assert log.complete
    assert [text for text in texts if text.startswith("mode")][-3:] == [
        "mode walking to stopping",
        "mode stopping to hold",
        "mode hold to idle",
    ]
    assert log.ticks["torque_command_nm"][-1].tolist() == [0.0, 0.0, 0.0, 0.0]
    assert not bench.socket.exists()


def kill_daemon(bench: Any) -> None:
    """And start another one, once only the drives can have acted."""
    bench.daemon.kill()
    bench.daemon.wait(LONGEST_S)
    bench.daemon.stderr.close()
    time.sleep(2.0 * WATCHDOG_S)
    bench.daemon = bench.start("firmware_host.daemon")


def start_walking(bench: Any) -> None:
    """A machine that others keep busy may spoil a start, of which nothing is claimed here."""
    for _ in range(3):
        bench.run("clear")
        bench.wait_until_ready()
        bench.run("arm")
        if bench.run("walk").stdout == "walking\n":
            return
    raise AssertionError("it does not walk")


def test_a_killed_daemon_leaves_idle_drives_and_a_readable_log(bench: Any) -> None:
    start_walking(bench)
    kill_daemon(bench)
    report = bench.wait_for(lambda report: report["mode"] == "idle")
    assert not any(drive["closed_loop"] for drive in report["drives"])
    assert {drive["errors"] for drive in report["drives"]} == {"watchdog expired"}
    assert "watchdog expired" in report["fault"]["message"]
    assert bench.run("arm").returncode == exit_codes.REFUSED
    first = min(bench.logs.glob("*/*.mcap"), key=lambda path: path.name)
    log = read_log(first)
    assert Mode.WALKING in log.ticks["mode"]


def test_after_a_kill_a_person_clears_and_arms_again(bench: Any) -> None:
    """In hold: amid a stride the last torque may push a joint out of its range, from where it is moved by hand."""
    bench.run("arm")
    kill_daemon(bench)
    bench.wait_for(lambda report: report["mode"] == "idle")
    assert bench.run("clear").returncode == exit_codes.OK
    bench.wait_until_ready()  # the new daemon has read the drives' settings
    assert bench.run("arm").stdout == "hold\n"


def test_a_robot_that_vanishes_is_a_fault_with_a_sentence(bench: Any) -> None:
    bench.run("arm")
    bench.robot.kill()
    bench.wait_for(lambda report: report["mode"] == "fault")
    status = bench.run("status")
    assert status.returncode == exit_codes.UNHEALTHY and "drive" in status.stdout
    check = bench.run("check")
    assert check.returncode == exit_codes.UNHEALTHY
    assert "FAIL drive.left_sweep" in check.stdout and "->" in check.stdout


def test_garbled_requests_cost_no_tick(bench: Any) -> None:
    for garbage in (b"\xc1\xc1\xc1", b"\x00" * 5000, msgpack.packb([0, 1, "no such", {}]), b"GET /\n"):
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(bench.socket))
            client.settimeout(LONGEST_S)
            client.sendall(garbage)
            assert client.recv(4096)
    assert bench.wait_for(lambda report: True)["mode"] == "idle"


def test_a_second_daemon_on_the_same_socket_is_refused(bench: Any) -> None:
    second = bench.start("firmware_host.daemon")
    _, said = second.communicate(timeout=LONGEST_S)
    assert second.returncode == 1
    assert "already running" in said and "Traceback" not in said


def test_without_a_daemon_there_is_a_sentence_and_a_status(short_folder: Path) -> None:
    for command in ("status", "arm", "walk", "stop", "disarm", "clear", "watch"):
        ended = run(command, "--socket", str(short_folder / "none"))
        assert ended.returncode == exit_codes.NO_DAEMON, command
        assert ended.stderr.startswith("mudskipper: no daemon answers") and "Traceback" not in ended.stderr


def test_check_without_a_daemon_tells_what_is_missing(short_folder: Path, tmp_path: Path, example_text: str) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(example_text.replace('"can0"', '"nocan0"'), encoding="utf-8")
    ended = run("check", "--socket", str(short_folder / "none"), "--config", str(path), "--json")
    assert ended.returncode == exit_codes.UNHEALTHY
    items = {item["id"]: item for item in json.loads(ended.stdout)}
    assert not items["daemon"]["ok"] and items["configuration"]["ok"]
    assert "nocan0" in items["bus"]["text"] and items["bus"]["fix"]


def test_status_loads_nothing_heavy() -> None:
    """Half a second of imports would make a rescue feel like a hang."""
    program = (
        "import sys; from command_line.main import main; main(['status', '--socket', '/none']);"
        "print([name for name in ('numpy', 'can', 'pydantic', 'matplotlib', 'mcap') if name in sys.modules])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=LONGEST_S, check=True
    )
    assert ended.stdout == "[]\n"


@pytest.mark.parametrize("arguments", [(), ("dance",), ("walk", "--depth", "3", "--adaptive"), ("log",)])
def test_a_wrong_command_line_is_a_usage_error(arguments: tuple[str, ...]) -> None:
    ended = run(*arguments)
    assert ended.returncode == exit_codes.USAGE and "usage:" in ended.stderr


def test_a_depth_out_of_reach_is_refused_with_the_bound(bench: Any) -> None:
    bench.run("arm")
    ended = bench.run("walk", "--depth", "6")
    assert ended.returncode == exit_codes.REFUSED
    assert "depth_m = 0.06: must be more than 0 and at most 0.05" in ended.stderr


def test_a_walk_of_two_strides_ends_by_itself(bench: Any) -> None:
    bench.run("arm")
    bench.run("walk", "--strides", "2")
    report = bench.wait_for(lambda report: report["mode"] == "hold" and report["strides_closed"] == 4)
    assert report["fault"] is None


def test_ctrl_c_ends_a_watch_quietly(bench: Any) -> None:
    command = [sys.executable, "-m", "command_line.main", "watch", "--socket", str(bench.socket)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as watch:
        assert watch.stdout is not None and watch.stderr is not None
        watch.stdout.readline()
        time.sleep(0.1)
        watch.send_signal(signal.SIGINT)
        assert watch.wait(LONGEST_S) == exit_codes.INTERRUPTED
        assert watch.stderr.read() == ""


def test_the_command_line_and_the_daemon_agree() -> None:
    """What the command line must not import from the daemon, since `status` has to start at once."""
    assert exit_codes.CONFIGURATION == EXIT_CONFIGURATION
    assert StatusParameters().socket == commands.DEFAULT_SOCKET
