"""A counter on a serial line: which lines are counts, and what happens when it is unplugged."""

from __future__ import annotations

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
        self.written = self.fetched = 0  # bytes: a pseudo-terminal delivers after a while
        self._write, self._fetch = self.counter.write, self.encoder.line._fetch
        self.counter.write = self._count_written  # type: ignore[method-assign]
        self.encoder.line._fetch = self._count_fetched  # type: ignore[method-assign]
        self.write(b"\n")  # the end of a line that had begun before

    def _count_written(self, data: bytes) -> None:
        self.written += len(data)
        self._write(data)

    def _count_fetched(self) -> bytes:
        data = self._fetch()
        self.fetched += len(data)
        return data

    def write(self, data: bytes) -> float:
        """Write bytes, and return x once all of them have been read."""
        if data:
            self.counter.write(data)
        return self.read_until(lambda: not self.encoder.line.is_there or self.fetched >= self.written)

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


def test_counts_become_metres(rail: Rail) -> None:
    assert rail.send(0.0) == 0.0
    assert rail.send(0.005) == pytest.approx(0.005)
    assert rail.send(-0.003) == pytest.approx(-0.003)
    assert rail.encoder.report()[1:] == (3, 0, 0, "", "")


def test_a_malformed_line_is_counted_and_changes_nothing(rail: Rail) -> None:
    rail.send(0.1)
    rail.counter.write(b"12.5\n")
    assert rail.read_until(lambda: rail.encoder.malformed > 0) == pytest.approx(0.1)
    assert (rail.encoder.poses, rail.encoder.malformed) == (1, 1)


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
    lost_s = rail.now_s
    assert not rail.encoder.reopen(lost_s + 0.9 * RETRY_S)
    assert not rail.encoder.reopen(lost_s + 1.1 * RETRY_S)  # it is not there yet
    assert "No such file" in rail.encoder.report().trouble
    rail.counter.plug_in()
    assert not rail.encoder.reopen(lost_s + 1.9 * RETRY_S)  # once in a second
    assert rail.encoder.reopen(lost_s + 2.2 * RETRY_S)
    rail.now_s = lost_s + 2.2 * RETRY_S
    rail.write(b"\n")
    assert rail.send(0.002) == pytest.approx(0.002)
    assert rail.encoder.report().trouble == ""


def test_a_device_that_does_not_open_is_reported(tmp_path: Path) -> None:
    parameters = RailEncoderParameters(device=str(tmp_path / "nothing"), metres_per_count=METRES)
    with pytest.raises(PoseSourceError, match="^the rail encoder .*/nothing does not open: No such file or directory$"):
        RailEncoder(parameters)
