"""The demo, once to its end and once interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import exit_codes
from firmware_host.log_reading.log_reader import read_log
from tests.waiting import LONGEST_S


def start_demo(out: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-u", "-m", "command_line.main", "demo", "--out", str(out), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def children_of(out: Path) -> list[str]:
    """Command lines of processes that still use the demo's files."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                line = (entry / "cmdline").read_bytes().decode(errors="replace")
            except OSError:
                continue
            if str(out) in line and "pytest" not in line:
                found.append(line)
    return found


def test_the_demo_walks_three_muds_and_sums_up(tmp_path: Path) -> None:
    with start_demo(tmp_path / "out", "--json", str(tmp_path / "demo.json")) as demo:
        printed, complaints = demo.communicate(timeout=LONGEST_S)
    assert (demo.returncode, complaints) == (exit_codes.OK, "")
    summary = json.loads((tmp_path / "demo.json").read_text(encoding="utf-8"))
    assert set(summary) >= {
        "ticks", "rate_hz", "missed_ticks", "wake_late_us", "tick_us", "strides", "speed_cm_s", "log", "plot"
    }  # fmt: skip
    assert set(summary["wake_late_us"]) == set(summary["tick_us"]) == {"p50", "p99", "max"}
    assert {stride["mud"] for stride in summary["strides"]} == {"48.5", "53.1", "45.3"}
    assert {stride["flipper"] for stride in summary["strides"]} == {"left", "right"}
    assert all(speed > 3.0 for speed in summary["speed_cm_s"].values())
    assert summary["log"] in printed and summary["plot"] in printed
    assert Path(summary["plot"]).read_bytes().startswith(b"\x89PNG")
    log = read_log(Path(summary["log"]))
    assert log.complete and len(log.strides) == len(summary["strides"])
    lines = [line for line in printed.splitlines() if line.startswith(("left ", "right "))]
    assert len(lines) == len(summary["strides"])


def test_the_demo_walks_the_ground_that_a_file_describes(tmp_path: Path) -> None:
    """The same mud twice, which is told apart by its place, and another by its strength."""
    world = tmp_path / "world.toml"
    borders_m, muds = (0.0, 0.1, 0.2, 0.3), ("water_percent = 48.5", "strength_pa = 1500", "water_percent = 48.5")
    world.write_text(
        "".join(
            f"[[segment]]\nstart_m = {start_m}\nend_m = {end_m}\n{mud}\n"
            for start_m, end_m, mud in zip(borders_m[:-1], borders_m[1:], muds, strict=True)
        ),
        encoding="utf-8",
    )
    with start_demo(tmp_path / "out", "--world", str(world), "--json", str(tmp_path / "demo.json")) as demo:
        printed, complaints = demo.communicate(timeout=LONGEST_S)
    assert (demo.returncode, complaints) == (exit_codes.OK, "")
    assert "Walking 0.30 m over mud with 48.5 %, 1500 Pa, 48.5 % water." in printed
    summary = json.loads((tmp_path / "demo.json").read_text(encoding="utf-8"))
    assert set(summary["speed_cm_s"]) == {"48.5", "1500 Pa", "48.5 at 0.20 m"}
    assert "48.5 % at 0.20 m: " in printed
    assert {stride["mud"] for stride in summary["strides"]} <= {"48.5", "1500 Pa"}


def test_ctrl_c_ends_the_demo_cleanly(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with start_demo(out) as demo:
        assert demo.stdout is not None
        for line in demo.stdout:
            if line.startswith("left "):
                break
        demo.send_signal(signal.SIGINT)
        printed, complaints = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode == exit_codes.INTERRUPTED
    assert "torque is off" in complaints and "Traceback" not in complaints
    (path,) = (out / "done").glob("*.mcap")
    assert str(path) in printed
    log = read_log(path)
    modes = [event["text"] for event in log.events if event["text"].startswith("mode ")]
    assert log.complete and modes[-1] == "mode hold to idle"
    assert children_of(out) == []


def test_an_early_ctrl_c_says_that_nothing_moved(tmp_path: Path) -> None:
    with start_demo(tmp_path / "out") as demo:
        assert demo.stdout is not None
        demo.stdout.readline()
        demo.send_signal(signal.SIGINT)
        _, complaints = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode == exit_codes.INTERRUPTED
    assert "stopped" in complaints and "Traceback" not in complaints
    assert children_of(tmp_path / "out") == []


def test_sigterm_ends_the_demo_as_ctrl_c_does(tmp_path: Path) -> None:
    with start_demo(tmp_path / "out") as demo:
        assert demo.stdout is not None
        for line in demo.stdout:
            if line.startswith("Arming"):
                break
        demo.send_signal(signal.SIGTERM)
        _, complaints = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode == exit_codes.INTERRUPTED and "Traceback" not in complaints
    assert children_of(tmp_path / "out") == []


@pytest.mark.parametrize("arguments", [("--depth", "nan"), ("--depth", "-1"), ("--json", "/nonexistent/x.json")])
def test_what_cannot_work_is_told_before_anything_starts(tmp_path: Path, arguments: tuple[str, str]) -> None:
    with start_demo(tmp_path / "out", *arguments) as demo:
        printed, complaints = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode in (exit_codes.USAGE, exit_codes.UNHEALTHY)
    assert printed == "" and complaints and "Traceback" not in complaints
