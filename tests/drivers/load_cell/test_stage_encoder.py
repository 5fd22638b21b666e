"""A stage's encoder over a real tty, with failures of the counter at its other end."""

from collections.abc import Iterator
from math import inf
from pathlib import Path

import pytest

from drivers.load_cell.stage_encoder import StageEncoder, StageEncoderSettings
from simulation.test_rig.emulated_instruments import EmulatedStageEncoder, StageEncoderParameters
from tests.drivers.load_cell.instrument_bench import InstrumentBench

pytest.importorskip("serial", reason="pyserial is not installed")

SPEED_M_S = 0.1


class Rail(InstrumentBench):
    """A stage that moves evenly, its counter, and the encoder that reads it; the counter may begin at zero again."""

    def __init__(self, folder: Path, restarts_s: float = inf, **changes: float) -> None:
        parameters = StageEncoderParameters(**changes)  # type: ignore[arg-type]
        counter = EmulatedStageEncoder(lambda at_s: SPEED_M_S * (at_s % restarts_s), parameters, folder / "encoder")
        super().__init__(counter, StageEncoder(StageEncoderSettings(str(folder / "encoder"), 1e-5)))


@pytest.fixture
def rail(tmp_path: Path) -> Iterator[Rail]:
    made = Rail(tmp_path)
    yield made
    made.close()


def test_positions_are_stamped_with_their_times_except_for_a_constant_delay(rail: Rail) -> None:
    positions = rail.run(3.0)[100:]
    late_s = [each.stamp_s - each.position_m / SPEED_M_S for each in positions]
    assert len(positions) > 190
    assert max(late_s) - min(late_s) < 0.002
    assert rail.port.line.clock.rate_hz == pytest.approx(100.0, rel=0.01)


def test_an_encoder_that_was_unplugged_reports_that_its_zero_changed(rail: Rail) -> None:
    rail.run(1.0)
    rail.instrument.unplug()
    assert rail.run(1.0) == [] and not rail.port.line.is_there
    assert rail.port.last_problem == "No such file or directory"
    rail.instrument.plug_in()
    positions = rail.run(1.5)
    assert rail.port.breaks == 1
    assert positions[0].position_m < 0.5 * SPEED_M_S  # a counter begins at zero


def test_a_counter_that_begins_at_zero_again_reports_that_its_zero_changed(tmp_path: Path) -> None:
    rail = Rail(tmp_path, restarts_s=1.5)
    rail.run(2.5)
    assert rail.port.breaks == 1
    rail.close()


def test_an_encoder_without_messages_is_silent(tmp_path: Path) -> None:
    rail = Rail(tmp_path, drop_out_rate_hz=10.0, rate_hz=10.0, drop_out_s=10.0)
    rail.run(2.0)
    assert rail.port.silent_for_s(rail.now_s) > 1.9
    rail.close()
