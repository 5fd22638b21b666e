"""Every benchmark runs, too briefly for its figures to mean anything, and prints its documented keys.

No figure of time or memory is asserted: on a shared machine it would fail by itself.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from control.modes import Mode
from drivers.can.frames import Frame
from drivers.mit import codec as mit
from drivers.moteus import codec as moteus
from drivers.moteus import registers, settings
from firmware_host.log.recorder import NullRecorder
from tests.folders import ROOT
from verification.behaviour import differences
from verification.example_robot import load_example
from verification.local_robot import LocalRobot
from verification.report import run_benchmark, show_progress, summary_us
from verification.speed import (
    campaign_speed,
    lockstep_speed,
    served_walk,
    serving_time,
    tick_time,
    viewers_cost,
)
from verification.speed.loop_jitter import time_daemon
from verification.speed.paced_loops import LOOPS
from verification.stress import log_kills
from verification.stress.harmless_frames import is_harmless
from verification.walks import timed_walk
from verification.walks.timed_walk import STAGES
from verification.walks.wirings import VARIANTS, make_wiring

TIMEOUT_S = 900.0  # on a machine that others keep busy
ALWAYS = {"benchmark", "reached", "verdict"}
FOLDERS = {
    "speed": ("tick_time", "loop_jitter", "fast_loop", "lockstep_speed", "viewers_cost"),
    "stress": (
        "soak", "daemon_kills", "configuration_fuzz", "socket_fuzz", "corrupted_logs", "log_kills", "can_fuzz",
    ),
}  # fmt: skip
BENCHMARKS = {name: f"verification.{folder}.{name}" for folder, names in FOLDERS.items() for name in names}
SUMMARY = {"median", "p99", "max"}
SERVING = {"idle", "status", "largest"}


def report_of(name: str, *arguments: str) -> dict[str, Any]:
    """Run a benchmark and return its report; a stress test ends with status 1 if it misses its bar.

    It gets a process of its own because a benchmark switches garbage collection off.
    """
    command = [sys.executable, "-m", BENCHMARKS[name], "--json", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert done.stderr == ""
    report: dict[str, Any] = json.loads(done.stdout)
    assert done.returncode == int(name in FOLDERS["stress"] and not report["reached"])
    assert report["benchmark"] == name
    assert report.keys() >= ALWAYS
    return report


def test_tick_time(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(timed_walk, "WARM_UP_S", 1.0)
    monkeypatch.setattr(timed_walk, "BLOCK_TICKS", 50)
    monkeypatch.setattr(served_walk, "BLOCK_TICKS", 50)
    monkeypatch.setattr(serving_time, "STRIDES", 1)
    monkeypatch.setattr(timed_walk, "freeze_garbage", lambda: None)  # it switches garbage collection off
    assert run_benchmark(tick_time.measure, ["--seconds", "1"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["bar_us"] == 200.0
    assert set(report["variants"]) == set(VARIANTS)
    for figures in report["variants"].values():
        assert set(figures["stages_us"]) == set(STAGES)
        assert all(set(stage) == SUMMARY for stage in figures["stages_us"].values())
        assert set(figures["whole_us"]) == SUMMARY | {"ticks"}
        assert figures.keys() >= {"longest_us", "dropped_rows"}
        assert set(figures["cold_us"]) == SUMMARY | {"ticks"} and set(figures["bare_sockets_us"]) == SUMMARY
        assert set(figures["serving_us"]) == SERVING and figures["serving_us"]["largest"]["bytes"] > 1000
        assert set(figures["ratios"]) == {f"serving_{name}_to_hot" for name in (*SERVING, "viewer")} | {
            "hot_to_bare_sockets",
            "cold_to_hot",
            "ends_to_hot",
            "longest_to_hot",
        }


@pytest.mark.parametrize("arguments", [["--bus", "can7"], ["--drive", "mit:AK80"]])
def test_an_unknown_bus_or_drive_is_refused_with_those_that_exist(arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match=f"{' '.join(arguments)}: must be one of "):
        run_benchmark(tick_time.measure, arguments)


def test_drives_that_cannot_report_their_watchdogs_walk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timed_walk, "freeze_garbage", lambda: None)  # it switches garbage collection off
    configuration = load_example("mit:AK80-9")
    walk = timed_walk.TimedWalk(configuration, make_wiring("mock", configuration.bus, tmp_path), NullRecorder())
    walk.warm_up()
    assert walk.walk.loop.mode is Mode.WALKING


def test_loop_jitter() -> None:
    """Processors are held awake for all loops of a half alike. Libraries that are not installed are left out."""
    report = report_of("loop_jitter", "--seconds", "0.5")
    for half in (report["held"], report["sleeping"]):
        assert set(half["ratios"]) == {"p50", "p99"}
        for loop in (half["loop"], half["bare"]):
            assert set(loop["wake_late_us"]) == {"p50", "p99", "max"}
            assert loop["ticks"] > 0
            assert loop["missed_ticks"] >= 0
        assert set(half["paced"]) == {"380", "1000"}
        for paced in half["paced"].values():
            assert set(paced) == set(LOOPS) - set(report["left_out"]) >= {"bare", "ticker"}
            assert all(set(each) == {"jitter_us", "rate_fraction", "to_ticker"} for each in paced.values())
    assert report.keys() >= {"warnings", "faults", "dropped_rows"}


def test_fast_loop() -> None:
    """The daemon walks at a rate that any machine holds; how many ticks it misses is not asserted."""
    report = report_of("fast_loop", "--seconds", "0.5", "--rate-hz", "400")
    assert report.keys() >= {"400", "compiled", "turn_s", "warnings"} and "4000" not in report
    for loop in (report["400"]["loop"], report["400"]["bare"]):
        assert loop["ticks"] > 0 and 0.0 <= loop["missed_fraction"] <= 1.0


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("loop_lagging", "this machine is too slow for 4000 Hz: its ticks take 150 % too long"),
        ("drive_silent", "the simulated robot does not walk at 4000 Hz: its ticks take 150 % too long"),
    ],
)
def test_a_walk_that_does_not_begin_ends_a_benchmark_with_a_sentence(fault: str, sentence: str) -> None:
    class SlowRobot(LocalRobot):
        """A robot whose loop does not reach its rate."""

        def __init__(self) -> None:
            return

        def start_daemon(self, rate_hz: float = 0.0) -> Any:
            return None

        def walk_until(self, phase: str) -> bool:
            return False

        def call(self, method: str, **params: Any) -> Any:
            return {"fault": {"name": fault, "message": "its ticks take 150 % too long"}}

    with pytest.raises(SystemExit, match=f"^{sentence}$"):
        time_daemon(SlowRobot(), 0.5, 4000.0)


def test_viewers_cost(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """`all_run` shows that the screen, `live` and its clients ran until the measurement ended."""
    assert run_benchmark(viewers_cost.measure, ["--seconds", "0.5", "--pairs", "1"]) == 0
    report = json.loads(capsys.readouterr().out)
    figures = {f"{name}_{part}" for name in ("tick_us", "wake_late_us") for part in ("p50", "p99")}
    assert report.keys() >= {*figures, *ALWAYS, "screen_cpu", "missed_ticks"}
    assert report["all_run"] is True
    assert all(set(report[name]) == {"without", "with", "ratio"} for name in figures)


def test_campaign_speed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_benchmark(campaign_speed.measure, ["--rounds", "1", "--seeds", "1", "--strides", "1"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["walks"] == 2 and report["efficiency"] > 0.0


def test_lockstep_speed(capsys: pytest.CaptureFixture[str]) -> None:
    """A benchmark of speed ends with status 0 even if it is slow, and prints its JSON on one line or on many."""
    assert run_benchmark(lockstep_speed.measure, ["--rounds", "1", "--longest", "0.5"]) == 0
    report = json.loads(capsys.readouterr().out)
    (walk,) = report["rounds"]
    assert walk["simulated_s"] == pytest.approx(0.5, abs=0.01)
    assert walk["times"] == report["median_times"] > 0.0
    assert walk["arrived"] is False


@pytest.mark.parametrize("drive", ["odrive", "odrive05", "moteus", "mit", "mit:AK80-9"])
def test_can_fuzz(drive: str) -> None:
    """Its findings depend on no clock, so they are asserted; with so few frames its memory figure is not."""
    frames = 8000 if drive == "odrive" else 2400
    parts = report_of("can_fuzz", "--frames", str(frames), "--drive", drive)["parts"]
    assert {name: part["frames"] for name, part in parts.items()} == {"boot": frames // 2, "idle": frames // 2}
    for part in parts.values():
        assert (part["exceptions"], part["forbidden"], part["ticks_in_another_mode"]) == (0, [], 0)
    assert parts["idle"]["frames_sent"] > 100


@pytest.mark.parametrize("name", ["can_fuzz", "daemon_kills", "log_kills"])
def test_an_unknown_drive_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    measure = import_module(BENCHMARKS[name]).measure
    with pytest.raises(SystemExit, match="mit:AK80-9"):
        run_benchmark(measure, ["--drive", "mit:AK"])


@pytest.mark.parametrize(
    ("frame", "harmless"),
    [
        (Frame(0x00E, bytes(4)), True),
        (Frame(0x00E, b"\1\0\0\0"), False),
        (Frame(0x007, b"\1\0\0\0"), True),
        (Frame(0x007, b"\x08\0\0\0"), False),
        (Frame(0x000, is_remote=True), True),
        (Frame(0x00E, is_remote=True), False),
        (Frame(0x004, bytes(4)), True),
        (Frame(0x004, b"\1\2\0\0"), False),
        (Frame(0x00C, bytes(8)), False),
        (Frame(0x00E, bytes(4), is_extended=True), False),
        (Frame(0x00E, bytes(4), is_error=True), False),
    ],
)
def test_the_fuzz_knows_what_a_disarmed_robot_must_not_send(frame: Frame, harmless: bool) -> None:
    assert is_harmless(frame, "odrive") == harmless


@pytest.mark.parametrize(
    ("frame", "harmless"),
    [
        (Frame(0x00E, bytes(4)), True),
        (Frame(0x00E, b"\1\0\0\0"), False),
        (Frame(0x007, b"\x08\0\0\0"), False),
        (Frame(0x00A, is_remote=True), True),
        (Frame(0x016, is_remote=True), False),  # a restart
        (Frame(0x006, is_remote=True), False),  # a new node id
        (Frame(0x018), True),
        (Frame(0x018, b"\0"), False),
        (Frame(0x004, bytes(4)), False),
    ],
)
def test_the_fuzz_knows_what_a_disarmed_robot_must_not_send_to_firmware_05(frame: Frame, harmless: bool) -> None:
    assert is_harmless(frame, "odrive05") == harmless


@pytest.mark.parametrize(
    ("data", "harmless"),
    [
        (moteus.QUERY_ALONE, True),
        (moteus.STOP_AND_QUERY, True),
        (settings.IDENTITY, True),
        (settings.QUESTIONS[0], True),
        (moteus.encode_torque(0.0), False),
        (registers.encode_console(registers.CONSOLE_INPUT, b"conf set servo.max_current_A 3\n"), False),
        (b"\xff", False),
    ],
)
def test_the_fuzz_knows_what_a_disarmed_robot_must_not_send_to_a_moteus(data: bytes, harmless: bool) -> None:
    assert is_harmless(Frame(0x8001, data, is_extended=True, is_fd=True), "moteus") == harmless


@pytest.mark.parametrize(
    ("frame", "harmless"),
    [
        (Frame(0x001, mit.LEAVE), True),
        (Frame(0x010, mit.LEAVE), False),
        (Frame(0x001, mit.ENTER), False),
        (Frame(0x001, mit.SET_ZERO), False),
        (Frame(0x001, mit.encode_torque(0.0, 10.0)), False),  # half a step of torque
        (Frame(0x7FF, mit.encode_read(1, 9)), True),
        (Frame(0x7FF, mit.encode_register(1, mit.WRITE, 9, bytes(4))), False),
        (Frame(0x7FF, mit.encode_register(1, mit.STORE, 1, bytes(4))), False),
        (Frame(0x001, mit.LEAVE, is_fd=True), False),
    ],
)
def test_the_fuzz_knows_what_a_disarmed_robot_must_not_send_in_mit_mode(frame: Frame, harmless: bool) -> None:
    assert is_harmless(frame, "mit") == harmless


def test_soak() -> None:
    """Released resources and complete rows are asserted; memory is not, because the run is too short."""
    report = report_of("soak", "--hours", "0.002")
    assert max(report["left"].values()) <= 0
    assert (report["bugs"], report["dropped"], report["ticks_missing"], report["files_not_whole"]) == ([], 0, 0, 0)
    assert report["largest_log_bytes"] <= report["quota_bytes"]
    assert report["ticks_in_files"] > 0 and report["asked"]
    assert report["modes_s"]["walking"] > 1.0
    assert report["garbage"]["objects"] < 1000


@pytest.mark.parametrize("drive", ["odrive", "moteus"])
def test_daemon_kills(drive: str) -> None:
    """The daemon is killed once and stopped once. A busy machine only lengthens waits, and no time is asserted."""
    report = report_of("daemon_kills", "--kills", "2", "--drive", drive)
    assert [made["signal"] for made in report["rounds"]] == ["SIGKILL", "SIGSTOP"]
    for made in report["rounds"]:
        assert (made["phase"], made["idle"], made["moved_again_s"]) == ("insertion", True, 0.0)
    assert report.keys() >= {"longest_s", "watchdog_s", "invalid_walks"}


def test_configuration_fuzz() -> None:
    report = report_of("configuration_fuzz", "--configurations", "50")
    assert report["first_bugs"] == []
    assert sum(report["kinds"].values()) == report["configurations"] == 50
    assert 0.2 < report["accepted_fraction"] < 0.6
    assert report["tried"]["walked"] > 0


def test_socket_fuzz() -> None:
    report = report_of("socket_fuzz", "--streams", "400")
    assert sum(report["kinds"].values()) == report["streams"] == 400
    assert (report["unanswered"], report["bugs"], report["most_calls_a_tick"]) == (0, [], 1)
    assert report["longest_wait_ticks"] <= 17
    assert report["valid_requests"] > 100 and report["counters"]["malformed_requests"] > 50
    assert report.keys() >= {"serve_us", "readings_kib", "growth_kib", "ticks", "seconds", "seed"}


def test_corrupted_logs() -> None:
    report = report_of("corrupted_logs", "--logs", "40")
    assert sum(report["outcomes"].values()) == report["logs"] == 40
    assert report.keys() >= {"slowest_s", "peak_in_log_sizes", "seed"}
    assert report["wrong"] == []


def test_log_kills() -> None:
    """Each victim is killed once; with this seed only the first kill waits for a second segment."""
    report = report_of("log_kills", "--kills", "4", "--seed", "2542")
    assert [kill["victim"] for kill in report["rounds"]] == ["daemon", "writer", "both", "all"]
    sums = report["sums"]
    assert (sums["missing_inside"], sums["doubled"], sums["unsound"]) == (0, 0, 0)
    assert sums["segments"] >= 5


@pytest.mark.parametrize(("missing_s", "status"), [(0.5, 0), (1.5, 1)])
def test_log_kills_ends_with_a_status_for_its_bar(
    missing_s: float, status: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = dict.fromkeys(("ticks", "missing_inside", "doubled", "recovered", "segments"), 0)
    kill: dict[str, Any] = figures | {"victim": "writer", "missing_at_end_s": missing_s, "problems": []}
    monkeypatch.setattr(log_kills, "kill_once", lambda *_: kill)
    monkeypatch.setattr(log_kills, "LocalRobot", Mock())
    assert run_benchmark(log_kills.measure, ["--json", "--kills", "1"]) == status
    assert json.loads(capsys.readouterr().out)["reached"] is (status == 0)


def test_a_seed_may_be_zero_and_a_count_may_not(capsys: pytest.CaptureFixture[str]) -> None:
    def measure(folder: Path, *, seed: int = 1, walks: int = 2, name: str = "") -> dict[str, Any]:
        return {"seed": seed, "walks": walks, "name": name}

    assert run_benchmark(measure, ["--json", "--seed", "0"]) == 0
    assert json.loads(capsys.readouterr().out)["seed"] == 0
    with pytest.raises(SystemExit, match="^--walks 0: must be more than 0"):
        run_benchmark(measure, ["--walks", "0"])


@pytest.mark.parametrize("name", BENCHMARKS)
def test_help_describes_the_benchmark(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    module = import_module(BENCHMARKS[name])
    with pytest.raises(SystemExit) as ended:
        run_benchmark(module.measure, ["--help"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert BENCHMARKS[name] in shown
    assert module.__doc__ is not None
    assert module.__doc__.splitlines()[0] in shown


def test_summary_is_of_ordered_microseconds() -> None:
    durations_s = [number * 1e-6 for number in range(101)]
    assert summary_us(durations_s[::-1]) == {"median": 50.0, "p99": 99.0, "max": 100.0}
    assert summary_us([]) == {"median": 0.0, "p99": 0.0, "max": 0.0}


def test_progress_is_silent_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    show_progress(1.0, 2.0, "walking")
    assert capsys.readouterr().err == ""


def test_behaviour_reports_every_difference_and_accepts_new_names() -> None:
    old = {"place_m": 1.0, "rows": [{"a": 1}, {"a": 2}], "version": "0.1", "gone": 0}
    new = {"position_m": 1.0, "rows": [{"a": 1.0}], "version": "0.2", "came": 0}
    found = list(differences(old, new, {"place_m": "position_m"}, frozenset({"version"})))
    assert found == [".came: added", ".gone: missing", ".rows: 1 entries, before 2", ".rows[0].a: 1.0, before 1"]
    assert list(differences({"place_m": 1}, {"place_m": 1}, {"place_m": "position_m"}, frozenset())) == []
