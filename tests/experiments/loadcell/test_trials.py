"""Trials are measured, checked and recovered over the serial ports of an emulated amplifier and a stage's encoder."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.loadcell.preparation import CellSettings, examine_encoder, examine_lines
from experiments.loadcell.recording import AVERAGED, RAW, load_counted
from experiments.loadcell.stage import CellTrial, Stage
from experiments.loadcell.strokes import INSERTION, SHEAR, AnalysedTrial
from experiments.loadcell.trials import KEEP, WITHOUT, list_problems, record
from experiments.robot.bench_errors import BenchError
from experiments.study.prompt import GO_ON, REDO, SKIP
from simulation.test_rig.emulated_instruments import AmplifierParameters, EmulatedStageEncoder, StageEncoderParameters
from tests.experiments.loadcell.loadcell_bench import SETTINGS, Laboratory
from tests.scripted_operator import ScriptedOperator

Make = Callable[..., Laboratory]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    """Yield a function that makes a calibrated laboratory with a mud that follows the laws; close all at the end."""
    made: list[Laboratory] = []

    def build(operator: ScriptedOperator | None = None, **options: Any) -> Laboratory:
        folder = tmp_path / str(len(made))
        folder.mkdir()
        made.append(Laboratory(folder, operator or ScriptedOperator(), **options))
        return made[-1]

    yield build
    for laboratory in made:
        laboratory.close()


class Idle(Stage):
    """A stage that does not move."""

    patience_s = 0.5

    def lower(self) -> None: ...

    def start(self, trial: CellTrial) -> None: ...

    def lift(self) -> None: ...


def test_an_amplifier_that_averages_four_samples_is_reported_once(make: Make) -> None:
    smeared, sharp = make(amplifier=AmplifierParameters(averaged=4)), make()
    for laboratory in (smeared, sharp):
        bench = laboratory.cell
        bench.stage = Idle(SETTINGS, laboratory.operator, bench.drain)
        for number in (1, 2):
            record(bench, CellTrial("lawful", INSERTION, number), 1)
    assert [each for each in smeared.operator.reported if AVERAGED in each] == [f"lawful/insertion/1: {AVERAGED}"]
    assert sharp.operator.reported == []


def test_a_trial_with_an_unplugged_cell_is_repeated_and_both_files_remain(make: Make) -> None:
    laboratory = make()
    laboratory.at(4.5, laboratory.bench.amplifier.unplug)
    laboratory.at(6.5, laboratory.bench.amplifier.plug_in)
    reported = "\n".join(laboratory.try_once())
    assert "in again" in reported and "connected again" in reported and "unplugged during the trial" in reported
    assert laboratory.notebook.entries["lawful/insertion/1"]["file"].endswith("_2.csv")
    assert len(list((laboratory.folder / RAW).iterdir())) == 2
    assert len(load_counted(laboratory.folder, laboratory.notebook, SETTINGS)) == 1


@pytest.mark.parametrize(
    ("amplifier", "kind", "message"),
    [
        (AmplifierParameters(drift_n_s=0.03), INSERTION, "the zero moved by"),
        (AmplifierParameters(range_n=2.0), INSERTION, "at its limit"),
        (AmplifierParameters(garbled_fraction=0.2), SHEAR, "lines were garbled"),
        (AmplifierParameters(drop_out_rate_hz=2.0, drop_out_s=0.3), SHEAR, "are missing"),
        (AmplifierParameters(rate_hz=10.0), INSERTION, "fewer than 6 samples"),
    ],
)
def test_an_invalid_trial_is_reported_and_left_out(
    make: Make, amplifier: AmplifierParameters, kind: str, message: str
) -> None:
    laboratory = make(amplifier=amplifier, operator=ScriptedOperator(SKIP))
    assert any(message in each for each in laboratory.try_once(kind))
    (entry,) = laboratory.notebook.entries.values()
    assert entry["skipped"] and any(message in each for each in entry["why"])
    assert (laboratory.folder / entry["file"]).exists()
    assert load_counted(laboratory.folder, laboratory.notebook, SETTINGS) == []


def test_a_cell_that_stays_at_its_largest_force_is_at_its_limit(make: Make) -> None:
    laboratory = make()
    laboratory.try_once()
    (recorded,) = load_counted(laboratory.folder, laboratory.notebook, SETTINGS)
    clipped = recorded._replace(forces_n=recorded.forces_n.clip(-1.0, 1.0))
    stretch = laboratory.cell.record(0.01, 0.1, 0.1)
    assert any("at its limit" in each for each in list_problems(AnalysedTrial(clipped), stretch, 0.0))
    # a coarse cell repeats its smallest force at rest, and any recording may end with its largest
    coarse = recorded._replace(forces_n=np.abs(recorded.forces_n).round(2))
    peak_n = recorded.forces_n.max() + 1.0
    ended = recorded._replace(forces_n=np.append(recorded.forces_n, peak_n), times_s=np.append(recorded.times_s, 1e3))
    for sound in (recorded, coarse, ended):
        assert list_problems(AnalysedTrial(sound), stretch, 0.0) == []


def measured(laboratory: Laboratory, *answers: str) -> list[CellTrial]:
    """Measure with these answers before each trial; return the trials for which they were asked."""
    stage, left, asked = laboratory.cell.stage, [*answers], list[CellTrial]()
    prepare = stage.prepare

    def answer(trial: CellTrial, trials: int) -> str:
        asked.append(trial)
        prepare(trial, trials)
        return left.pop(0)

    stage.prepare = answer  # type: ignore[method-assign]
    laboratory.measure(CellSettings(scale_n=1.0 / 42000.0))
    return asked


def test_the_operator_skips_a_trial_and_repeats_the_one_before(make: Make) -> None:
    laboratory = make(trials=2)
    asked = [trial.key for trial in measured(laboratory, GO_ON, REDO, GO_ON, SKIP, GO_ON, GO_ON)]
    first, second, third, fourth = (trial.key for trial in laboratory.cell.plan.list_trials())
    assert asked == [first, second, first, second, third, fourth]
    assert laboratory.notebook.entries[second] == {"skipped": True}
    assert laboratory.notebook.entries[first]["file"].endswith("_2.csv")
    assert len(list((laboratory.folder / RAW).iterdir())) == 4  # the first recording of the first trial remains


def test_before_an_invalid_trial_is_repeated_the_one_before_can_be(make: Make) -> None:
    laboratory = make(trials=1, amplifier=AmplifierParameters(rate_hz=10.0))  # too slow for an insertion
    asked = [trial.kind for trial in measured(laboratory, GO_ON, GO_ON, REDO, GO_ON, SKIP)]
    assert asked == [SHEAR, INSERTION, INSERTION, SHEAR, INSERTION]


def test_the_lines_are_examined_first(make: Make) -> None:
    assert examine_lines(make().cell, "auto") == "number"
    indicator = make(amplifier=AmplifierParameters(style="indicator"))
    assert examine_lines(indicator.cell, "auto") == "indicator"
    with pytest.raises(BenchError, match="--format indicator"):
        examine_lines(indicator.cell, "number")
    with pytest.raises(BenchError, match="--format column1"):
        examine_lines(make(amplifier=AmplifierParameters(style="columns")).cell, "auto")


@pytest.mark.parametrize(
    ("amplifier", "line", "message"),
    [
        ({"baud": 57600}, None, "own rate with --baud"),
        ({"drop_out_rate_hz": 10.0, "rate_hz": 10.0, "drop_out_s": 10.0}, None, "nothing arrives"),
        ({}, b"hello world\r\n", "hello world"),
        ({"range_n": 1.0}, None, "not calibrated"),  # the heavier weight overloads it
    ],
)
def test_a_cell_that_cannot_be_read_is_refused(
    make: Make, amplifier: dict[str, Any], line: bytes | None, message: str
) -> None:
    laboratory = make(operator=ScriptedOperator("q"), amplifier=AmplifierParameters(**amplifier))
    if line is not None:
        laboratory.bench.amplifier._line = lambda force_n, at_s: line  # type: ignore[method-assign]
    with pytest.raises(BenchError, match=message):
        laboratory.measure()


def test_a_cell_that_stays_unplugged_ends_the_recording(make: Make) -> None:
    laboratory = make()
    laboratory.cell.listen(0.5)
    laboratory.bench.amplifier.unplug()
    with pytest.raises(BenchError, match="did not come back"):
        laboratory.cell.tare()


def test_the_stage_prompts_for_every_step_and_attends_the_ports_meanwhile() -> None:
    drained = list[int]()
    stage = Stage(SETTINGS, ScriptedOperator(GO_ON, SKIP), lambda: drained.append(1))
    assert stage.weigh(0) == 0.0
    assert stage.prepare(CellTrial("a", SHEAR, 1), 5) == GO_ON
    assert stage.prepare(CellTrial("a", INSERTION, 1), 5) == SKIP
    stage.lower()
    stage.lift()
    stage.start(CellTrial("a", INSERTION, 1))
    assert len(drained) == 4


# the encoder of the stage


@pytest.fixture
def make_with_encoder(make: Make) -> Make:
    def build(operator: ScriptedOperator | None = None, **parameters: Any) -> Laboratory:
        return make(operator, encoder=StageEncoderParameters(**parameters))

    return build


def counter_of(laboratory: Laboratory) -> EmulatedStageEncoder:
    assert laboratory.bench.encoder is not None
    return laboratory.bench.encoder


def examine(laboratory: Laboratory) -> None:
    laboratory.cell.listen(2.0)
    examine_encoder(laboratory.cell)


def test_an_encoder_unplugged_in_a_trial_costs_its_positions_and_no_force(make_with_encoder: Make) -> None:
    laboratory = make_with_encoder(ScriptedOperator(KEEP))
    laboratory.at(4.5, counter_of(laboratory).unplug)
    laboratory.at(6.0, counter_of(laboratory).plug_in)
    assert any("encoder was unplugged or restarted" in each for each in laboratory.try_once())
    (recorded,) = load_counted(laboratory.folder, laboratory.notebook, SETTINGS)
    assert recorded.positions is None and len(recorded.forces_n) > 400
    assert (laboratory.folder / laboratory.notebook.entries[recorded.key]["position"]["file"]).exists()
    assert laboratory.encoder is not None and laboratory.encoder.line.is_there


def test_an_unplugged_encoder_is_asked_for_and_then_left_out(make_with_encoder: Make) -> None:
    laboratory = make_with_encoder(ScriptedOperator(GO_ON, WITHOUT, KEEP))
    counter_of(laboratory).unplug()
    reported = laboratory.try_once()
    assert [("encoder is unplugged" in each, "plug" in each) for each in reported[:2]] == [(True, True)] * 2
    assert reported[2].startswith("going on without the position")
    assert "position" not in laboratory.notebook.entries["lawful/insertion/1"]


def test_a_drop_out_in_the_stroke_is_reported(make_with_encoder: Make) -> None:
    laboratory = make_with_encoder(ScriptedOperator(KEEP))
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
def test_lines_of_an_encoder_that_cannot_be_read_are_refused_with_what_to_do(
    make_with_encoder: Make, encoder: dict[str, Any], line: bytes | None, option: str
) -> None:
    laboratory = make_with_encoder(**encoder)
    if line is not None:
        counter_of(laboratory).line_at = lambda at_s: line
    with pytest.raises(BenchError, match=f"{option}.*or continue without --position"):
        examine(laboratory)


def test_an_encoder_too_slow_for_the_stroke_is_reported(make_with_encoder: Make) -> None:
    laboratory = make_with_encoder(rate_hz=20.0)
    examine(laboratory)
    assert "20 lines/s, one per 5.0 mm" in laboratory.operator.reported[0]
