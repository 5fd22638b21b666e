"""A load cell's serial port over a real tty, with failures of the amplifier at its other end."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from simulation.test_rig.emulated_instruments import AmplifierParameters, EmulatedAmplifier
from tests.drivers.load_cell.instrument_bench import InstrumentBench

FORCE_N = 1.5
COUNTS = LoadCellCalibration("counts", 42000.0, 81000.0)


class Cable(InstrumentBench):
    """An amplifier under a constant load."""

    def __init__(self, folder: Path, name: str = "number", **changes: float | str) -> None:
        parameters = AmplifierParameters(**{"noise_n": 0.0, **changes})  # type: ignore[arg-type]
        amplifier = EmulatedAmplifier(lambda _: FORCE_N, parameters, folder / "cell")
        super().__init__(amplifier, LoadCellPort(str(folder / "cell"), 115200, LineFormat(name), COUNTS))


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    made = Cable(tmp_path)
    yield made
    made.close()


def test_every_line_becomes_a_sample_of_the_force(cable: Cable) -> None:
    samples = cable.run(2.0)
    assert len(samples) >= 157  # of 160: the first may be cut, the last are on their way
    assert {round(sample.force_n, 4) for sample in samples} == {FORCE_N}
    assert cable.port.line.clock.rate_hz == pytest.approx(80.0, rel=0.02)
    assert cable.port.malformed_lines == cable.port.line.unpluggings == 0


def test_malformed_lines_are_counted_and_the_last_one_is_stored(tmp_path: Path) -> None:
    cable = Cable(tmp_path, garbled_fraction=0.25)
    samples = cable.run(4.0)
    port = cable.port
    assert 40 < port.malformed_lines < 120
    assert len(samples) == port.lines - port.malformed_lines
    assert {round(sample.force_n, 4) for sample in samples} == {FORCE_N}
    assert "\\x" in port.last_malformed
    cable.close()


@pytest.mark.parametrize(("style", "name"), [("counts", "number"), ("indicator", "indicator")])
def test_an_overload_is_a_sample_without_a_force(tmp_path: Path, style: str, name: str) -> None:
    cable = Cable(tmp_path, name=name, style=style, range_n=1.0)
    samples = cable.run(1.0)
    assert samples and all(sample.overloaded for sample in samples)
    assert cable.port.overloads == len(samples) == cable.port.lines
    cable.close()


def test_the_unit_of_a_line_is_converted(tmp_path: Path) -> None:
    cable = Cable(tmp_path, name="indicator", style="indicator")
    cable.port.calibration = LoadCellCalibration("N", 1.0)
    assert cable.run(1.0)[-1].force_n == pytest.approx(FORCE_N, abs=1e-3)
    cable.close()
