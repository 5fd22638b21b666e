"""An encoder of the stage and the load cell, over both serial ports: measurement, remarks, and continuation."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from experiments.loadcell.preparation import examine_encoder
from experiments.loadcell.recording import load_counted
from experiments.loadcell.trials import KEEP, WITHOUT
from experiments.robot.bench_errors import BenchError
from experiments.study.prompt import GO_ON
from simulation.test_rig.emulated_instruments import EmulatedStageEncoder, StageEncoderParameters
from tests.experiments.loadcell.loadcell_bench import SETTINGS, Laboratory, Make, laboratories
from tests.scripted_operator import ScriptedOperator


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    with laboratories(tmp_path) as build:

        def with_encoder(
            operator: ScriptedOperator | None = None, encoder: dict[str, Any] | None = None, **options: Any
        ) -> Laboratory:
            return build(operator, encoder=StageEncoderParameters(**(encoder or {})), **options)

        yield with_encoder


def counter_of(laboratory: Laboratory) -> EmulatedStageEncoder:
    assert laboratory.bench.encoder is not None
    return laboratory.bench.encoder


def examine(laboratory: Laboratory) -> None:
    laboratory.cell.listen(2.0)
    examine_encoder(laboratory.cell)


def test_an_encoder_unplugged_in_a_trial_costs_its_positions_and_no_force(make: Make) -> None:
    laboratory = make(operator=ScriptedOperator(KEEP))
    laboratory.at(4.5, counter_of(laboratory).unplug)
    laboratory.at(6.0, counter_of(laboratory).plug_in)
    assert any("encoder was unplugged or restarted" in each for each in laboratory.try_once())
    (recorded,) = load_counted(laboratory.folder, laboratory.notebook, SETTINGS)
    assert recorded.positions is None and len(recorded.forces_n) > 400
    assert (laboratory.folder / laboratory.notebook.entries[recorded.key]["position"]["file"]).exists()
    assert laboratory.encoder is not None and laboratory.encoder.line.is_there


def test_an_unplugged_encoder_is_asked_for_and_then_left_out(make: Make) -> None:
    laboratory = make(operator=ScriptedOperator(GO_ON, WITHOUT, KEEP))
    counter_of(laboratory).unplug()
    reported = laboratory.try_once()
    assert [("encoder is unplugged" in each, "plug" in each) for each in reported[:2]] == [(True, True)] * 2
    assert reported[2].startswith("going on without the position")
    assert "position" not in laboratory.notebook.entries["lawful/insertion/1"]


def test_a_drop_out_in_the_stroke_is_reported(make: Make) -> None:
    laboratory = make(operator=ScriptedOperator(KEEP))
    laboratory.at(3.9, lambda: setattr(counter_of(laboratory), "line_at", lambda at_s: b""))
    reported = laboratory.try_once()
    assert any("position is unknown" in each or "the position is not used" in each for each in reported)


@pytest.mark.parametrize(
    ("encoder", "line", "option"),
    [
        ({"baud": 57600}, None, "--position-baud"),
        ({"drop_out_rate_hz": 10.0, "rate_hz": 10.0, "drop_out_s": 10.0}, None, "nothing arrives"),
        ({}, b"12.5 mm\r\n", "--position-label"),
    ],
)
def test_lines_that_cannot_be_read_are_refused_with_what_to_do(
    make: Make, encoder: dict[str, Any], line: bytes | None, option: str
) -> None:
    laboratory = make(encoder=encoder)
    if line is not None:
        counter_of(laboratory).line_at = lambda at_s: line
    with pytest.raises(BenchError, match=f"{option}.*or continue without --position"):
        examine(laboratory)


def test_an_encoder_too_slow_for_the_stroke_is_reported(make: Make) -> None:
    laboratory = make(encoder={"rate_hz": 20.0})
    examine(laboratory)
    assert "20 lines/s, one per 5.0 mm" in laboratory.operator.reported[0]
