"""Benchmarks run, too briefly for their figures to mean anything, and the stress tests find no defect.

No figure of time or memory is asserted: on a shared machine it would fail by itself. Those that need a daemon in real
time for their figures alone (loop_jitter, viewers_cost) are not run.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.folders import ROOT
from verification.behaviour import differences, main
from verification.benchmark import Report, measure_in_turns, paired_ratio, run_benchmark
from verification.speed import lockstep_speed, log_length, tick_time, timed_walk
from verification.stress import daemon_kills
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


def test_lockstep_speed(capsys: pytest.CaptureFixture[str]) -> None:
    """A benchmark of speed ends with status 0 even if it is slow."""
    assert run_benchmark(lockstep_speed.measure, ["--rounds", "1", "--longest", "0.5"]) == 0
    (walk,) = json.loads(capsys.readouterr().out)["rounds"]
    assert walk["simulated_s"] == pytest.approx(0.5, abs=0.01) and walk["times"] > 0.0 and walk["arrived"] is False


def test_log_length(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--walk", "1", "--short", "1", "--long", "2", "--commands", "info"]
    assert run_benchmark(log_length.measure, arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["rows"][1] == pytest.approx(2 * report["rows"][0], rel=0.01)
    assert report["commands"]["info"]["memory_ratio"] > 0.0


def test_things_are_measured_in_turns_and_compared_pair_by_pair() -> None:
    order: list[str] = []
    measured = measure_in_turns({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, 2)
    assert order == ["a", "b", "b", "a"] and measured == {"a": [None, None], "b": [None, None]}
    assert paired_ratio([2.0, 30.0], [1.0, 10.0]) == {"ratio": 2.5, "std_error": pytest.approx(0.627, abs=0.001)}


def test_a_seed_may_be_zero_and_a_count_may_not(capsys: pytest.CaptureFixture[str]) -> None:
    def measure(folder: Path, *, seed: int = 1, walks: int = 2, name: str = "") -> Report:
        return {"seed": seed, "walks": walks, "name": name}

    assert run_benchmark(measure, ["--json", "--seed", "0"]) == 0
    assert json.loads(capsys.readouterr().out)["seed"] == 0
    with pytest.raises(SystemExit, match="^--walks 0: must be more than 0"):
        run_benchmark(measure, ["--walks", "0"])


# stress


def test_soak() -> None:
    """Released resources and complete rows are asserted; memory is not, because the run is too short."""
    report = report_of("soak", "--hours", "0.0015")
    assert max(report["left"].values()) <= 0
    assert (report["bugs"], report["dropped"], report["ticks_missing"], report["files_not_whole"]) == ([], 0, 0, 0)
    assert report["largest_log_bytes"] <= report["quota_bytes"]
    assert report["ticks_in_files"] > 0 and report["asked"]
    assert report["modes_s"]["walking"] > 0.5
    assert report["garbage"]["objects"] < 1000


def test_daemon_kills(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A session of commands kills the daemon alone. A busy machine only lengthens waits, and no time is asserted."""
    monkeypatch.setattr(daemon_kills, "ROUNDS", [("insertion", victim) for victim in ("stopped daemon", "writer")])
    run_benchmark(daemon_kills.measure, ["--json", "--kills", "2"])
    report = json.loads(capsys.readouterr().out)
    assert [made["victim"] for made in report["rounds"]] == ["stopped daemon", "writer"]
    for made in report["rounds"]:
        assert (made["phase"], made["idle"], made["moved_again_s"]) == ("insertion", True, 0.0)
        assert (made["complaints"], made["files_not_whole"], made["ticks_missing"]) == ([], 0, 0)
        assert made["ticks_in_files"] > 0


@pytest.mark.parametrize(("sound", "status"), [(True, 0), (False, 1)])
def test_a_stress_test_ends_with_a_status_for_its_bar(
    sound: bool, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(daemon_kills, "kill_once", lambda *_: {"driven_s": 0.0, "sound": sound})
    assert run_benchmark(daemon_kills.measure, ["--json", "--kills", "1"]) == status


# behaviour


def test_behaviour_reports_every_difference_and_accepts_new_names() -> None:
    old = {"place_m": 1.0, "rows": [{"a": 1}, {"a": 2}], "version": "0.1", "gone": 0}
    new = {"position_m": 1.0, "rows": [{"a": 1.0}], "version": "0.2", "came": 0}
    found = list(differences(old, new, {"place_m": "position_m"}, frozenset({"version"})))
    assert found == [".came: added", ".gone: missing", ".rows: 1 entries, before 2", ".rows[0].a: 1.0, before 1"]
    assert list(differences({"place_m": 1}, {"place_m": 1}, {"place_m": "position_m"}, frozenset())) == []


def test_behaviour_that_only_one_folder_has_differs(tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    assert main(["compare", str(old), str(new)]) == 1  # as with a wrong name
    for folder in (old, new):
        folder.mkdir()
        (folder / "walk.json").write_text("{}", encoding="utf-8")
    assert main(["compare", str(old), str(new)]) == 0
    (new / "sweep.json").write_text("{}", encoding="utf-8")
    assert main(["compare", str(old), str(new)]) == main(["compare", str(new), str(old)]) == 1
