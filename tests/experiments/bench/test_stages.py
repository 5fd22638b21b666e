"""The whole bench, as an operator starts it, is refused, passes a sound robot, and finds a reversed encoder."""

import json
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

from command_line.init.new_file import NewRobot, new_file
from control.records import Rig
from simulation.harness.local_setup import write_local_setup
from tests.bench.staged_bench import FAILED, PASSED, SKIPPED, STAGES
from tests.folders import ROOT


def run_bench(report: Path, *options: str) -> tuple[int, str, dict[str, Any]]:
    """Return the exit status, the output and the report."""
    command = [sys.executable, "-m", "pytest", "tests/bench", "-q", "--bench-report", str(report), *options]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    return ended.returncode, ended.stdout, json.loads(report.read_text(encoding="utf-8"))


def test_a_sound_robot_passes_every_stage(tmp_path: Path) -> None:
    status, _, reported = run_bench(tmp_path / "report.json", "--simulated")
    assert reported["stages"] == dict.fromkeys(STAGES, PASSED)
    assert status == 0


def test_a_rig_of_two_motors_passes_every_stage(tmp_path: Path) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(new_file(NewRobot(rig=Rig(("right",)), drive_type="moteus")), encoding="utf-8")
    status, _, reported = run_bench(tmp_path / "report.json", "--simulated", "--config", str(path))
    assert reported["stages"] == dict.fromkeys(STAGES, PASSED)
    assert not any("left" in test["test"] for test in reported["tests"])
    assert status == 0


def test_a_refused_bench_says_why_once_and_reports_it(short_folder: Path, tmp_path: Path) -> None:
    """A running daemon is the reason. The option -rN prevents a summary that would repeat the message."""
    path = write_local_setup(short_folder, tmp_path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
        daemon.bind(str(short_folder / "mudskipper.sock"))
        daemon.listen()
        status, printed, reported = run_bench(tmp_path / "report.json", "-rN", "--config", str(path), "--yes")
    assert (status, printed.count("systemctl stop mudskipper")) == (1, 1)
    assert reported["stages"] == dict.fromkeys(STAGES, SKIPPED) | {"wiring": FAILED}
