"""The emulated amplifier is read through its tty with only the operating system's calls."""

from __future__ import annotations

import os
import termios
import tty
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean, stdev

import pytest

from simulation.test_rig.emulated_instruments import AmplifierParameters, EmulatedAmplifier


class Listener:
    def __init__(self, folder: Path, parameters: AmplifierParameters, baud: int = termios.B115200) -> None:
        self.force_n = 1.0
        self.amplifier = EmulatedAmplifier(lambda _: self.force_n, parameters, folder / "cell")
        self.file = os.open(folder / "cell", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.file)
        settings = termios.tcgetattr(self.file)
        settings[4] = settings[5] = baud
        termios.tcsetattr(self.file, termios.TCSANOW, settings)

    def hear(self, from_s: float, to_s: float) -> bytes:
        heard, now_s = b"", from_s
        while now_s < to_s:
            now_s += 0.02
            self.amplifier.step(now_s)
            try:
                heard += os.read(self.file, 65536)
            except BlockingIOError:
                continue
        return heard

    def close(self) -> None:
        os.close(self.file)
        self.amplifier.close()


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[Listener]:
    made = Listener(tmp_path, AmplifierParameters(noise_n=0.01, burst_s=0.0))
    yield made
    made.close()


def test_it_prints_counts_at_its_rate_with_its_noise(listener: Listener) -> None:
    counts = [int(line) for line in listener.hear(0.0, 5.0).split()]
    assert len(counts) == pytest.approx(400, abs=3)
    assert fmean(counts) == pytest.approx(81000.0 + 42000.0, abs=100.0)
    assert stdev(counts) == pytest.approx(420.0, rel=0.15)


def test_an_unplugged_amplifier_hangs_up_and_comes_back_by_the_same_name(tmp_path: Path) -> None:
    listener = Listener(tmp_path, AmplifierParameters())
    listener.amplifier.unplug()
    assert not (tmp_path / "cell").exists()
    assert os.read(listener.file, 1) == b""
    listener.amplifier.plug_in()
    assert (tmp_path / "cell").exists()
    listener.close()
