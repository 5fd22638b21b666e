"""Benchmarks run, too briefly for their figures to mean anything, and the stress tests find no defect.

No figure of time or memory is asserted: on a shared machine it would fail by itself. Those that need a daemon in real
time for their figures alone (loop_jitter, viewers_cost) are not run.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from control.modes import Mode
from drivers.can.frames import Frame
from drivers.mit import codec as mit
from drivers.moteus import codec as moteus
from drivers.moteus import registers, settings
from tests.folders import ROOT
from verification.behaviour import differences
from verification.benchmark import Report, measure_in_turns, paired_ratio, run_benchmark, summary_us
from verification.local_robot import LocalRobot
from verification.speed import lockstep_speed, log_length, tick_time, timed_walk
from verification.speed.loop_jitter import time_daemon
from verification.stress import can_fuzz, configuration_fuzz, log_kills, socket_fuzz
from verification.stress.harmless_frames import is_harmless
from verification.wiring import BUSES

TIMEOUT_S = 900.0  # on a machine that others keep busy


def report_of(name: str, *arguments: str) -> Report:
    """Run a stress test in a process of its own and return its report; it ends with status 1 if it misses its bar."""
    command = [sys.executable, "-m", f"verification.stress.{name}", "--json", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert done.stderr == ""
    report: Report = json.loads(done.stdout)
    assert done.returncode == int(not report["reached"])
    return report


# speed


def test_tick_time(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    monkeypatch.setattr(timed_walk, "WARM_UP_S", 1.0)
    monkeypatch.setattr(timed_walk, "BLOCK_TICKS", 50)
    monkeypatch.setattr(timed_walk, "freeze_garbage", lambda: None)  # it switches garbage collection off
    assert run_benchmark(tick_time.measure, ["--seconds", "1", "--picture", str(tmp_path / "tick.png")]) == 0
    report = json.loads(capsys.readouterr().out)
    assert set(report["variants"]) == set(BUSES)
    for figures in report["variants"].values():
        assert set(figures["stages_us"]) == set(timed_walk.STAGES)
        assert figures["ratios"]["hot_to_bare_sockets"] > 1.0 and figures["dropped_rows"] == 0
    assert (tmp_path / "tick.png").stat().st_size > 1000


@pytest.mark.parametrize("arguments", [["--bus", "can7"], ["--drive", "mit:AK80"]])
def test_an_unknown_bus_or_drive_is_refused_with_those_that_exist(arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match=f"{' '.join(arguments)}: must be one of "):
        run_benchmark(tick_time.measure, arguments)


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [("loop_lagging", "this machine is too slow for 4000 Hz: "), ("drive_silent", "the simulated robot does not walk")],
)
def test_a_walk_that_does_not_begin_ends_a_benchmark_with_a_sentence(
    fault: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = LocalRobot.__new__(LocalRobot)
    monkeypatch.setattr(robot, "start_daemon", lambda rate_hz: None, raising=False)
    monkeypatch.setattr(robot, "walk_until", lambda phase: False, raising=False)
    monkeypatch.setattr(robot, "call", lambda method: {"fault": {"name": fault, "message": ""}}, raising=False)
    with pytest.raises(SystemExit, match=f"^{sentence}"):
        time_daemon(robot, 0.5, 4000.0)


def test_lockstep_speed(capsys: pytest.CaptureFixture[str]) -> None:
    """A benchmark of speed ends with status 0 even if it is slow."""
    assert run_benchmark(lockstep_speed.measure, ["--rounds", "1", "--longest", "0.5"]) == 0
    (walk,) = json.loads(capsys.readouterr().out)["rounds"]
    assert walk["simulated_s"] == pytest.approx(0.5, abs=0.01) and walk["times"] > 0.0 and walk["arrived"] is False


def test_log_length(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--walk", "3", "--short", "1", "--long", "2", "--commands", "info"]
    assert run_benchmark(log_length.measure, arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["rows"][1] == pytest.approx(2 * report["rows"][0], rel=0.01)
    assert report["commands"]["info"]["memory_ratio"] > 0.0


def test_things_are_measured_in_turns_and_compared_pair_by_pair() -> None:
    order: list[str] = []
    measured = measure_in_turns({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, 2)
    assert order == ["a", "b", "b", "a"] and measured == {"a": [None, None], "b": [None, None]}
    assert paired_ratio([2.0, 30.0], [1.0, 10.0]) == {"ratio": 2.5, "std_error": pytest.approx(0.627, abs=0.001)}


def test_summary_is_of_ordered_microseconds() -> None:
    durations_s = [number * 1e-6 for number in range(101)]
    assert summary_us(durations_s[::-1]) == {"median": 50.0, "p99": 99.0, "max": 100.0}
    assert summary_us([]) == {"median": 0.0, "p99": 0.0, "max": 0.0}


def test_a_seed_may_be_zero_and_a_count_may_not(capsys: pytest.CaptureFixture[str]) -> None:
    def measure(folder: Path, *, seed: int = 1, walks: int = 2, name: str = "") -> Report:
        return {"seed": seed, "walks": walks, "name": name}

    assert run_benchmark(measure, ["--json", "--seed", "0"]) == 0
    assert json.loads(capsys.readouterr().out)["seed"] == 0
    with pytest.raises(SystemExit, match="^--walks 0: must be more than 0"):
        run_benchmark(measure, ["--walks", "0"])


# stress


@pytest.mark.parametrize("drive", ["odrive", "odrive05", "moteus", "mit", "mit:AK80-9"])
def test_can_fuzz(drive: str) -> None:
    boot, idle = (can_fuzz.fuzz_in_mode(mode, 1200, 1, drive) for mode in (Mode.BOOT, Mode.IDLE))
    assert (boot["first_bugs"], idle["first_bugs"]) == ([], [])
    assert idle["frames_sent"] > 100


def moteus_frame(data: bytes) -> Frame:
    return Frame(0x8001, data, is_extended=True, is_fd=True)


@pytest.mark.parametrize(
    ("drive", "frame", "harmless"),
    [
        ("odrive", Frame(0x00E, bytes(4)), True),
        ("odrive", Frame(0x00E, b"\1\0\0\0"), False),
        ("odrive", Frame(0x007, b"\x08\0\0\0"), False),
        ("odrive", Frame(0x00E, is_remote=True), False),
        ("odrive", Frame(0x004, b"\1\2\0\0"), False),
        ("odrive", Frame(0x00C, bytes(8)), False),
        ("odrive", Frame(0x00E, bytes(4), is_extended=True), False),
        ("odrive05", Frame(0x00A, is_remote=True), True),
        ("odrive05", Frame(0x016, is_remote=True), False),  # a restart
        ("odrive05", Frame(0x006, is_remote=True), False),  # a new node id
        ("odrive05", Frame(0x018), True),
        ("odrive05", Frame(0x004, bytes(4)), False),
        ("moteus", moteus_frame(moteus.STOP_AND_QUERY), True),
        ("moteus", moteus_frame(settings.QUESTIONS[0]), True),
        ("moteus", moteus_frame(moteus.encode_torque(0.0)), False),
        ("moteus", moteus_frame(registers.encode_console(registers.CONSOLE_INPUT, b"conf set a.b 3\n")), False),
        ("moteus", moteus_frame(b"\xff"), False),
        ("mit", Frame(0x001, mit.LEAVE), True),
        ("mit", Frame(0x001, mit.ENTER), False),
        ("mit", Frame(0x001, mit.encode_torque(0.0, 10.0)), False),  # half a step of torque
        ("mit", Frame(0x7FF, mit.encode_read(1, 9)), True),
        ("mit", Frame(0x7FF, mit.encode_register(1, mit.WRITE, 9, bytes(4))), False),
        ("mit", Frame(0x001, mit.LEAVE, is_fd=True), False),
    ],
)
def test_the_fuzz_knows_what_a_disarmed_robot_must_not_send(drive: str, frame: Frame, harmless: bool) -> None:
    assert is_harmless(frame, drive) == harmless


def test_soak() -> None:
    """Released resources and complete rows are asserted; memory is not, because the run is too short."""
    report = report_of("soak", "--hours", "0.0015")
    assert max(report["left"].values()) <= 0
    assert (report["bugs"], report["dropped"], report["ticks_missing"], report["files_not_whole"]) == ([], 0, 0, 0)
    assert report["largest_log_bytes"] <= report["quota_bytes"]
    assert report["ticks_in_files"] > 0 and report["asked"]
    assert report["modes_s"]["walking"] > 0.5
    assert report["garbage"]["objects"] < 1000


def test_daemon_kills() -> None:
    """The daemon is killed once and stopped once. A busy machine only lengthens waits, and no time is asserted."""
    report = report_of("daemon_kills", "--kills", "2")
    assert [made["signal"] for made in report["rounds"]] == ["SIGKILL", "SIGSTOP"]
    for made in report["rounds"]:
        assert (made["phase"], made["idle"], made["moved_again_s"]) == ("insertion", True, 0.0)


def test_configuration_fuzz(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_benchmark(configuration_fuzz.measure, ["--configurations", "100"]) in (0, 1)  # by time and memory
    report = json.loads(capsys.readouterr().out)
    assert report["first_bugs"] == []
    assert 0.2 < report["accepted_fraction"] < 0.6 and report["tried"]["walked"] > 0


def test_socket_fuzz(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(socket_fuzz, "freeze_garbage", lambda: None)
    assert run_benchmark(socket_fuzz.measure, ["--streams", "400"]) in (0, 1)  # by memory
    report = json.loads(capsys.readouterr().out)
    assert (report["first_bugs"], report["most_calls_a_tick"]) == ([], 1)
    assert report["longest_wait_ticks"] <= 17
    assert report["valid_requests"] > 100 and report["counters"]["malformed_requests"] > 50


def test_log_kills() -> None:
    report = report_of("log_kills", "--kills", "2")
    assert [kill["victim"] for kill in report["rounds"]] == ["all", "writer"]
    sums = report["sums"]
    assert (sums["missing_inside"], sums["doubled"], sums["unsound"]) == (0, 0, 0) and sums["ticks"] > 0


@pytest.mark.parametrize(("missing_s", "status"), [(0.5, 0), (1.5, 1)])
def test_a_stress_test_ends_with_a_status_for_its_bar(
    missing_s: float, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures = dict.fromkeys(("ticks", "missing_inside", "doubled", "recovered", "segments"), 0)
    kill: dict[str, Any] = figures | {"victim": "writer", "missing_at_end_s": missing_s, "problems": []}
    monkeypatch.setattr(log_kills, "kill_once", lambda *_: kill)
    monkeypatch.setattr(log_kills, "LocalRobot", Mock())
    assert run_benchmark(log_kills.measure, ["--json", "--kills", "1"]) == status


# behaviour


def test_behaviour_reports_every_difference_and_accepts_new_names() -> None:
    old = {"place_m": 1.0, "rows": [{"a": 1}, {"a": 2}], "version": "0.1", "gone": 0}
    new = {"position_m": 1.0, "rows": [{"a": 1.0}], "version": "0.2", "came": 0}
    found = list(differences(old, new, {"place_m": "position_m"}, frozenset({"version"})))
    assert found == [".came: added", ".gone: missing", ".rows: 1 entries, before 2", ".rows[0].a: 1.0, before 1"]
    assert list(differences({"place_m": 1}, {"place_m": 1}, {"place_m": "position_m"}, frozenset())) == []
