"""The emulated amplifier is read through its tty with only the operating system's calls."""

import os
import termios
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from statistics import fmean, stdev

import pytest

from simulation.test_rig.emulated_instruments import AmplifierParameters, EmulatedAmplifier


@pytest.fixture
def amplifier(tmp_path: Path) -> Iterator[EmulatedAmplifier]:
    made = EmulatedAmplifier(lambda _: 1.0, AmplifierParameters(noise_n=0.01, burst_s=0.0), tmp_path / "cell")
    yield made
    made.close()


def test_it_prints_counts_at_its_rate_with_its_noise(amplifier: EmulatedAmplifier) -> None:
    file, heard = os.open(amplifier.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), b""
    tty.setraw(file)
    settings = termios.tcgetattr(file)
    settings[4] = settings[5] = termios.B115200
    termios.tcsetattr(file, termios.TCSANOW, settings)
    for step in range(1, 251):
        amplifier.step(0.02 * step)
        with suppress(BlockingIOError):
            heard += os.read(file, 65536)
    os.close(file)
    counts = [int(line) for line in heard.split()]
    assert len(counts) == pytest.approx(400, abs=3)
    assert fmean(counts) == pytest.approx(81000.0 + 42000.0, abs=100.0)
    assert stdev(counts) == pytest.approx(420.0, rel=0.15)
