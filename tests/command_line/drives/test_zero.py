"""`mudskipper drives zero` writes where a joint stands, keeps the rest of the file, and refuses a joint that moves."""

import re
import sys
from math import radians
from pathlib import Path

import pytest

from command_line import exit_codes
from drivers.drive_types import DRIVE_TYPES
from firmware_host.configuration.loading import load_configuration
from tests.command_line.command_lines import run
from tests.command_line.drives.bench_setup import Bench

ANGLE_DEG = 12.0


def make_bench(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str = "odrive") -> Bench:
    bench = Bench(folder, name, monkeypatch)
    for drive in bench.drives.values():
        drive.measure(radians(ANGLE_DEG), 0.0)
    return bench


@pytest.mark.parametrize("joint", ["left_sweep", "right_sweep"])
@pytest.mark.parametrize("name", DRIVE_TYPES)
def test_the_present_position_becomes_angle_zero(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, joint: str
) -> None:
    """The right sweep's motor is mirrored."""
    bench = make_bench(short_folder, monkeypatch, name)
    before = bench.config.read_text(encoding="utf-8")
    ended = run("drives", "zero", joint, "--config", str(bench.config), "--yes")
    assert ended.returncode == exit_codes.OK, ended.stderr
    drive = load_configuration(bench.config).drive[joint]
    assert drive.zero_turn == pytest.approx(drive.sign * ANGLE_DEG / 360.0, abs=1e-4)
    lines = bench.config.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("zero_turn")] == before.splitlines()
    assert not any(bus.energised for bus in bench.buses.values())
    again = run("drives", "zero", joint, "--config", str(bench.config), "--yes")
    assert "stood at 0.00°" in again.stdout or "stood at -0.00°" in again.stdout
    assert load_configuration(bench.config).drive[joint].zero_turn == pytest.approx(drive.zero_turn, abs=1e-4)


def test_a_comment_on_the_key_stays(short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(short_folder, monkeypatch)
    bench.change("[drive.left_sweep]", "[drive.left_sweep]\nzero_turn = 0.0  # measured on Monday")
    assert run("drives", "zero", "left_sweep", "--config", str(bench.config), "--yes").returncode == exit_codes.OK
    assert re.search(r"zero_turn = 0\.033\d+  # measured on Monday", bench.config.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("answer", "status"), [("y", exit_codes.OK), ("", exit_codes.REFUSED), ("n", exit_codes.REFUSED)]
)
def test_it_asks_before_it_writes(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch, answer: str, status: int
) -> None:
    bench = make_bench(short_folder, monkeypatch)
    before = bench.config.read_text(encoding="utf-8")
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: answer)
    ended = run("drives", "zero", "left_sweep", "--config", str(bench.config))
    assert ended.returncode == status and "zero_turn 0 -> 0.0333" in ended.stdout
    assert (bench.config.read_text(encoding="utf-8") == before) == (status == exit_codes.REFUSED)


def test_without_a_terminal_nothing_is_written(short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(short_folder, monkeypatch)
    before = bench.config.read_text(encoding="utf-8")
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False)
    ended = run("drives", "zero", "left_sweep", "--config", str(bench.config))
    assert ended.returncode == exit_codes.USAGE and "--yes" in ended.stderr
    assert bench.config.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("name", DRIVE_TYPES)
@pytest.mark.parametrize("case", ["moves", "silent", "torque"])
def test_a_position_that_cannot_be_used_is_refused(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, case: str
) -> None:
    bench = make_bench(short_folder, monkeypatch, name)
    bus, drive = bench.buses["left"], bench.drives["left_sweep"]
    if case == "silent":
        bus.drives.remove(drive)
    elif case == "moves":
        bus.each_step = lambda: drive.measure(radians(bus.now_s), radians(1.0))
    else:
        bus.each_step = lambda: setattr(drive, "energised", True)
    before = bench.config.read_text(encoding="utf-8")
    ended = run("drives", "zero", "left_sweep", "--config", str(bench.config), "--yes")
    words = {"moves": "moved by", "silent": "readings of its position", "torque": "follows torque"}
    assert ended.returncode == exit_codes.UNHEALTHY and words[case] in ended.stderr
    assert bench.config.read_text(encoding="utf-8") == before
