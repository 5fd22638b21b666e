"""The headline agrees with a known truth: the simulated robot's true position, and strides with known values."""

from math import sqrt
from pathlib import Path
from statistics import fmean, stdev

import numpy as np
import pytest

from control.faults import Reaction
from control.modes import Mode
from control.records import UNKNOWN
from estimation.strokes.origin_fit import student_factor
from estimation.strokes.stroke_fit import TORQUE_REPEATABILITY
from experiments.pictures.mud_layout import MudLayout, layout_of_lengths
from experiments.pictures.stride_choice import Outcome
from experiments.run_report.headline import headline_of, headline_sentences, reaction_of
from experiments.run_report.run import Run, read_run, read_sources
from experiments.run_report.tables import coefficient_cell, counts_cell, mud_rows
from firmware_host.configuration.configuration import Configuration
from logs.fault_history import LoggedCause
from logs.files.log_error import unwatched
from logs.files.log_reader import read_log
from tests.experiments.run_report.synthetic_runs import estimates, run_of, stride
from tests.recorded_walks import record_walks

MUDS = (("48.5", 0.61), ("53.1", 0.61))


def read(path: Path, layout: MudLayout | None = None) -> Run:
    (source,) = read_sources([path], unwatched)
    return read_run(source, layout, unwatched)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory, configuration: Configuration) -> tuple[Run, float]:
    """Record seven strides from the first mud into the second; return the run and the body's true travel."""
    path = tmp_path_factory.mktemp("logs") / "walked.mcap"
    robot = record_walks(path, configuration, 7)
    return read(path, layout_of_lengths(MUDS)), robot.robot.plant.body_m


def test_distance_time_and_strides_are_those_of_the_simulated_robot(walked: tuple[Run, float]) -> None:
    run, travel_m = walked
    headline = headline_of(run)
    assert run.log is not None and headline.motion.distance_m == pytest.approx(travel_m, abs=0.003)
    walking_s = np.count_nonzero(read_log(run.path).ticks["mode"] == Mode.WALKING) / 380.0
    assert headline.motion.duration_s == pytest.approx(walking_s, rel=0.01)
    assert headline.motion.speed_m_s == pytest.approx(travel_m / walking_s, rel=0.02)
    assert (headline.strides, headline.walks, headline.stops) == (7, 1, 0)
    assert f"walked {travel_m:.2f} m" in headline_sentences(run, headline)[0]


def test_each_stride_is_in_the_mud_in_which_the_plates_go_down(walked: tuple[Run, float]) -> None:
    """The true borders are the reference; a stride near a border belongs to no mud."""
    run, _ = walked
    reach_m = run.walks[0].geometric_step_m / 2.0
    muds = {"w = 48.5 %": (-1.0, 0.61), "w = 53.1 %": (0.61, 1.22)}
    named = [each for each in run.strides if each.mud]
    assert 5 <= len(named) <= 7 and {each.mud for each in named} == set(muds)
    for each in named:
        begin_m, end_m = muds[each.mud]
        assert begin_m < each.rows["left"]["position_m"] + reach_m < end_m
    softest = {result.mud: result.both["k_p"].value for result in headline_of(run).muds}
    assert (softest["w = 53.1 %"] or 0.0) < 0.5 * (softest["w = 48.5 %"] or 0.0)


def test_a_stride_lasts_from_insertion_to_insertion(walked: tuple[Run, float]) -> None:
    run, _ = walked
    starts_s = [each.start_s for each in run.strides]
    assert [each.duration_s for each in run.strides[:-1]] == pytest.approx(np.diff(starts_s))
    assert np.isnan(run.strides[-1].duration_s)


def test_the_speed_of_a_mud_and_its_error_by_hand() -> None:
    """Steps of 10, 12 and 11 cm in 2 s each give 5.5 cm/s; the last stride has no duration."""
    good = estimates(1e6)
    strides = [stride("a", good, good, step_m, 2.0) for step_m in (0.10, 0.12, 0.11)]
    (result,) = headline_of(run_of([*strides, stride("a", good, good, 0.10, UNKNOWN)])).muds
    assert result.motion.speed_m_s == pytest.approx(0.055)
    assert result.motion.distance_m == pytest.approx(0.43)
    assert result.motion.speed_std_error_m_s == pytest.approx(student_factor(2) * 0.01 / sqrt(3.0) / 2.0)


def test_the_error_of_a_speed_covers_the_truth() -> None:
    """Two standard errors contain the truth in about 95 of 100 cases, even with five strides."""
    random, covered, count = np.random.default_rng(5), 0, 600
    good = estimates(1e6)
    for _ in range(count):
        durations_s = random.uniform(1.5, 2.5, 5)
        steps_m = 0.05 * durations_s + random.normal(0.0, 0.01, 5)
        strides = [stride("a", good, good, *pair) for pair in zip(steps_m, durations_s, strict=True)]
        motion = headline_of(run_of(strides)).muds[0].motion
        assert motion.speed_m_s is not None and motion.speed_std_error_m_s is not None
        covered += abs(motion.speed_m_s - 0.05) < 2.0 * motion.speed_std_error_m_s
    assert 0.93 < covered / count < 0.985


def test_the_coefficient_of_a_mud_is_the_mean_of_both_flippers_with_its_error_by_hand() -> None:
    values = (1.0e6, 1.1e6, 0.9e6, 1.04e6)
    pairs = [(values[0], values[1]), (values[2], values[3])]
    (result,) = headline_of(run_of([stride("a", estimates(a), estimates(b)) for a, b in pairs])).muds
    k_p = result.both["k_p"]
    assert k_p.value == pytest.approx(fmean(values))
    assert k_p.trials_error == pytest.approx(student_factor(3) * stdev(values) / 2.0)
    assert k_p.shared_error == pytest.approx(TORQUE_REPEATABILITY * fmean(values))
    assert result.flippers["right"]["k_p"].value == pytest.approx(fmean([values[1], values[3]]))


def test_bounds_and_invalid_estimates_are_no_values() -> None:
    bound, invalid = estimates(0.5e6, at_least=True), estimates(0.2e6, valid=False)
    bounds, nothing = headline_of(run_of([stride("a", bound, bound), stride("b", invalid, invalid)])).muds
    assert coefficient_cell(bounds.both["k_s"]) == "≥ 0.50" and coefficient_cell(nothing.both["k_s"]) == "-"


def test_outcomes_are_counted_and_written() -> None:
    good = estimates(1e6)
    outcomes = [Outcome.GOOD, Outcome.GOOD, Outcome.SLIPPING, Outcome.STUCK]
    run = run_of([stride("a", good, good, outcome=outcome) for outcome in outcomes])
    headline = headline_of(run)
    assert counts_cell(headline.outcomes) == "2 / 1 / 1" and len(mud_rows(headline)) == 2
    assert headline_sentences(run, headline)[1] == "4 strides: 2 good, 1 slipped, 1 stuck."


def test_only_faults_with_a_reaction_are_in_the_headline(two_walks: Path) -> None:
    def cause(name: str, *consequences: str) -> LoggedCause:
        return LoggedCause(0.0, 1, name, (), "", "", consequences)

    assert reaction_of(cause("drive_version")) is Reaction.NONE
    assert reaction_of(cause("loop_overrun")) is Reaction.WARN
    assert reaction_of(cause("bus_off", "drive_silent")) > Reaction.WARN
    assert headline_of(read(two_walks)).stops == 0


def test_a_log_s_estimates_stand_even_if_this_version_would_estimate_otherwise(
    two_walks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The report shows the logged values, without R² and residuals, which would belong to another fit."""
    log = read_log(two_walks)
    older = log._replace(strides=[row | {"k_p": 1.01 * row["k_p"]} for row in log.strides])
    monkeypatch.setattr("experiments.run_report.run.scan_log", lambda *_: older)
    run = read(two_walks)
    for each in run.strides:
        assert each.samples("left", "k_p") is None and each.samples("left", "k_e") is not None
    values = [row["k_p"] for row in older.strides]
    assert headline_of(run).muds[0].both["k_p"].value == pytest.approx(fmean(values))
