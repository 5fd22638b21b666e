"""`mudskipper drives zero` writes where a joint stands, keeps the rest of the file, and refuses a joint that moves."""

import re
import sys
from math import radians

import pytest

from command_line import exit_codes
from drivers.drive_types import DRIVE_TYPES
from firmware_host.configuration.loading import load_configuration
from tests.command_line.drives.bench_setup import Bench, MakeBench

ANGLE_DEG = 12.0


@pytest.fixture
def make_turned(make_bench: MakeBench) -> MakeBench:
    """Return a function that makes a robot whose drives all measure the angle."""

    def make(name: str = "odrive") -> Bench:
        bench = make_bench(name)
        for drive in bench.drives.values():
            drive.measure(radians(ANGLE_DEG), 0.0)
        return bench

    return make


@pytest.mark.parametrize("joint", ["left_sweep", "right_sweep"])
@pytest.mark.parametrize("name", DRIVE_TYPES)
def test_the_present_position_becomes_angle_zero(make_turned: MakeBench, name: str, joint: str) -> None:
    """The right sweep's motor is mirrored."""
    bench = make_turned(name)
    before = bench.config.read_text(encoding="utf-8")
    ended = bench.run("zero", joint, "--yes")
    assert ended.returncode == exit_codes.OK, ended.stderr
    drive = load_configuration(bench.config).drive[joint]
    assert drive.zero_turn == pytest.approx(drive.sign * ANGLE_DEG / 360.0, abs=1e-4)
    lines = bench.config.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("zero_turn")] == before.splitlines()
    assert not any(bus.energised for bus in bench.buses.values())
    again = bench.run("zero", joint, "--yes")
    assert "stood at 0.00°" in again.stdout or "stood at -0.00°" in again.stdout
    assert load_configuration(bench.config).drive[joint].zero_turn == pytest.approx(drive.zero_turn, abs=1e-4)


def test_a_comment_on_the_key_stays(make_turned: MakeBench) -> None:
    bench = make_turned()
    bench.change("[drive.left_sweep]", "[drive.left_sweep]\nzero_turn = 0.0  # measured on Monday")
    assert bench.run("zero", "left_sweep", "--yes").returncode == exit_codes.OK
    assert re.search(r"zero_turn = 0\.033\d+  # measured on Monday", bench.config.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("answer", "status"), [("y", exit_codes.OK), ("", exit_codes.REFUSED), ("n", exit_codes.REFUSED)]
)
def test_it_asks_before_it_writes(
    make_turned: MakeBench, monkeypatch: pytest.MonkeyPatch, answer: str, status: int
) -> None:
    bench = make_turned()
    before = bench.config.read_text(encoding="utf-8")
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: answer)
    ended = bench.run("zero", "left_sweep")
    assert ended.returncode == status and "zero_turn 0 -> 0.0333" in ended.stdout
    assert (bench.config.read_text(encoding="utf-8") == before) == (status == exit_codes.REFUSED)


def test_without_a_terminal_nothing_is_written(make_turned: MakeBench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_turned()
    before = bench.config.read_text(encoding="utf-8")
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False)
    ended = bench.run("zero", "left_sweep")
    assert ended.returncode == exit_codes.USAGE and "--yes" in ended.stderr
    assert bench.config.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("name", DRIVE_TYPES)
@pytest.mark.parametrize("case", ["moves", "silent", "torque"])
def test_a_position_that_cannot_be_used_is_refused(make_turned: MakeBench, name: str, case: str) -> None:
    bench = make_turned(name)
    bus, drive = bench.buses["left"], bench.drives["left_sweep"]
    if case == "silent":
        bus.drives.remove(drive)
    elif case == "moves":
        bus.each_step = lambda: drive.measure(radians(bus.now_s), radians(1.0))
    else:
        bus.each_step = lambda: setattr(drive, "energised", True)
    before = bench.config.read_text(encoding="utf-8")
    ended = bench.run("zero", "left_sweep", "--yes")
    words = {"moves": "moved by", "silent": "readings of its position", "torque": "follows torque"}
    assert ended.returncode == exit_codes.UNHEALTHY and words[case] in ended.stderr
    assert bench.config.read_text(encoding="utf-8") == before
