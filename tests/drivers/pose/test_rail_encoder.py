"""A counter on a serial line: which lines are counts, and what happens when it is unplugged."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import isnan
from pathlib import Path

import pytest

from drivers.pose.pose_port import STALE_S, PoseSourceError
from drivers.pose.rail_encoder import RETRY_S, RailEncoder, RailEncoderParameters
from simulation.devices.rail_encoder_emulator import EmulatedRailEncoder
from tests.waiting import LONGEST_S

pytest.importorskip("serial", reason="pyserial is not installed")

METRES = 1e-5


class Rail:
    """A counter, and the encoder that reads it, with the time given as `now_s`."""

    def __init__(self, device: Path, **changes: object) -> None:
        label = str(changes.get("label", ""))
        self.counter = EmulatedRailEncoder(device, METRES, label)
        parameters = RailEncoderParameters(device=str(device), metres_per_count=METRES)
        self.encoder = RailEncoder(replace(parameters, **changes))  # type: ignore[arg-type]
        self.now_s = 0.0
        self.counter.write(b"\n")  # the end of a line that had begun before

    def send(self, position_m: float) -> float:
        self.counter.send(position_m)
        heard = self.heard
        return self.read_until(lambda: self.heard > heard)

    @property
    def heard(self) -> int:
        return self.encoder.poses + self.encoder.malformed

    def read_until(self, done: Callable[[], bool]) -> float:
        self.now_s += 0.01
        deadline_s = time.monotonic() + LONGEST_S
        x_m = self.encoder.read(self.now_s).x_m
        while not done() and time.monotonic() < deadline_s:
            x_m = self.encoder.read(self.now_s).x_m
        return x_m

    def close(self) -> None:
        self.encoder.close()
        self.counter.unplug()


@pytest.fixture
def rail(tmp_path: Path) -> Iterator[Rail]:
    opened = Rail(tmp_path / "encoder")
    yield opened
    opened.close()


def test_counts_become_metres_and_a_malformed_line_is_counted_and_changes_nothing(rail: Rail) -> None:
    assert rail.send(0.0) == 0.0
    assert rail.send(0.005) == pytest.approx(0.005)
    rail.counter.write(b"12.5\n")
    assert rail.read_until(lambda: rail.encoder.malformed > 0) == pytest.approx(0.005)
    assert rail.send(-0.003) == pytest.approx(-0.003)
    assert rail.encoder.report()[1:] == (3, 1, 0, "", "")


def test_a_counter_that_begins_anew_leaves_a_read_without_a_pose(rail: Rail) -> None:
    """Strokes would count the jump as motion of the body."""
    rail.send(0.3)
    rail.send(0.0)  # may be a garbled line
    assert isnan(rail.send(0.0))
    assert rail.send(0.001) == pytest.approx(0.001)


def test_a_count_ends_when_it_is_stale(rail: Rail) -> None:
    rail.send(0.1)
    assert rail.encoder.read(rail.now_s + 0.9 * STALE_S).x_m == pytest.approx(0.1)
    assert isnan(rail.encoder.read(rail.now_s + 1.1 * STALE_S).x_m)
    assert rail.encoder.report().trouble == f"no count arrives from {rail.counter.device}."


def test_an_encoder_that_is_unplugged_is_none_and_is_opened_again(rail: Rail) -> None:
    rail.send(0.1)
    rail.counter.unplug()
    assert isnan(rail.read_until(lambda: bool(rail.encoder.report().trouble)))
    assert rail.encoder.report().trouble.startswith("the rail encoder is gone: ")
    rail.now_s += 1.1 * RETRY_S
    assert not rail.encoder.reopen(rail.now_s)  # it is not there yet
    assert "No such file" in rail.encoder.report().trouble
    rail.counter.plug_in()
    rail.now_s += 1.1 * RETRY_S
    assert rail.encoder.reopen(rail.now_s)
    rail.counter.write(b"\n")
    assert rail.send(0.002) == pytest.approx(0.002)
    assert rail.encoder.report().trouble == ""


def test_a_device_that_does_not_open_is_reported(tmp_path: Path) -> None:
    parameters = RailEncoderParameters(device=str(tmp_path / "nothing"), metres_per_count=METRES)
    with pytest.raises(PoseSourceError, match="^the rail encoder .*/nothing does not open: No such file or directory$"):
        RailEncoder(parameters)
