"""Simulated trials give an estimator realistic samples and can be repeated. Each has one stride, to save time."""

from dataclasses import replace
from functools import cache
from itertools import groupby
from math import isfinite

import pytest

from control.records import FLIPPERS
from estimation.estimation_parameters import EstimationParameters
from estimation.mud import MudEstimator
from experiments.trials.trial import (
    CONSTANTS,
    WALKING,
    Sample,
    Setup,
    Trial,
    configuration_of,
    replay_trial,
    run_trial,
)
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB, NONE
from simulation.mud.track import Track
from tests.experiments.synthetic_strides import strides_of

TRACK = Track([(100.0, clay_of_water(47.6))])
EVERY_ROW_NEW = replace(WALKING, row_period_s=0.0)


@cache
def trial(setup: Setup = WALKING, seed: int = 1, torque_error: float = 0.032) -> Trial:
    return run_trial(setup, TRACK, LAB, 1, seed, torque_error)


def trial_of_new_rows() -> Trial:
    """Return a trial in which every row is new and the motor constants are known exactly."""
    return trial(EVERY_ROW_NEW, torque_error=0.0)


def readings(sample: Sample) -> tuple[object, ...]:
    """Return all fields but time and phase."""
    return sample[2:]


def test_rows_repeat_as_asked() -> None:
    """A row lasts its period in whole ticks of 2.6 ms: two for 5 ms, eight for 20 ms, one if every row is new."""
    for repeated, ticks in ((trial_of_new_rows(), 1), (trial(), 2), (trial(replace(WALKING, row_period_s=0.02)), 8)):
        runs = [len(list(run)) for _, run in groupby(repeated.samples, key=readings)]
        assert set(runs[1:-1]) == {ticks}


def test_repeating_rows_does_not_affect_the_loop() -> None:
    """The robot does the same, and each new row equals the row of that tick without repetition."""
    often, seldom = trial_of_new_rows().samples, trial(replace(WALKING, row_period_s=0.02)).samples
    assert trial_of_new_rows().truths == trial(replace(WALKING, row_period_s=0.02)).truths
    new = [i for i, (a, b) in enumerate(zip(seldom, seldom[1:], strict=False), 1) if readings(a) != readings(b)]
    assert len(new) > 20
    for i in new:
        assert repr(seldom[i]) == repr(often[i])


def test_messages_are_at_most_two_milliseconds_old() -> None:
    """The drives send every 2 ms and are read at the tick; the simulated robot's step is 1 ms."""
    for sample in trial_of_new_rows().samples:
        for state in sample.states:
            assert 0.0 <= sample.now_s - state.angle_stamp_s < 0.0031
            assert 0.0 <= sample.now_s - state.current_stamp_s < 0.0031


def test_there_is_a_truth_of_each_flippers_every_stride() -> None:
    truths = [(truth.flipper, truth.index, truth.ground.name) for truth in trial().truths]
    assert truths == [(flipper, 0, "47.6") for flipper in FLIPPERS]
    assert all(truth.insertion.deepest_m > 0.02 for truth in trial().truths)


def test_a_fixed_base_stays_where_it_is_and_a_free_one_does_not() -> None:
    """The fixed base only shows the pose's noise of 0.1 mm."""
    setups = replace(WALKING, fixed_base=True), WALKING
    fixed, free = ([sample.body.x_m for sample in trial(setup).samples] for setup in setups)
    assert max(map(abs, fixed)) < 0.6e-3
    assert max(map(abs, free)) > 5e-3


# how the robot is set up


def test_torque_constants_are_known_as_wrongly_as_asked() -> None:
    exactly = configuration_of(WALKING).flipper_drives
    assert trial_of_new_rows().drives == exactly
    assert len({getattr(drive, name) for drive in trial().drives for name in CONSTANTS}) == 4
    for known, true in zip(trial().drives, exactly, strict=True):
        wrong = {name: getattr(known, name) for name in CONSTANTS}
        assert known == true._replace(**wrong)
        assert all(constant == pytest.approx(getattr(true, name), rel=0.15) for name, constant in wrong.items())


# estimates of a trial


def test_estimators_see_the_pose_only_if_they_may() -> None:
    with_pose = strides_of(trial(), EstimationParameters())
    without = strides_of(trial(), EstimationParameters(), with_pose=False)
    assert [stride.flipper for stride in with_pose] == list(FLIPPERS)
    assert all(isfinite(stride.step_m) for stride in with_pose)
    assert not any(isfinite(stride.step_m) for stride in without)


def test_mud_estimates_are_those_after_each_stride() -> None:
    parameters = EstimationParameters()
    estimator = MudEstimator(trial().configuration.geometry, trial().drives, parameters)
    for sample in trial().samples:
        estimator.update(*sample)
    assert [estimate for _, estimate in replay_trial(trial(), parameters)][-1] == estimator.mud_estimate


def test_in_a_walk_both_flippers_read_the_same_of_the_same_mud() -> None:
    """They agree to 10 %, although their drives report at different times.

    With currents interpolated along a line, k_e of the quick extraction would differ by 10 to 34 %.
    """
    soft = Track([(100.0, clay_of_water(51.2))])
    walked = run_trial(EVERY_ROW_NEW, soft, NONE, 2, 1)
    strides = strides_of(walked, EstimationParameters())
    k_e = {(stride.flipper, stride.index): stride.k_e.value for stride in strides}
    assert len(k_e) == 4
    assert [k_e["right", index] / k_e["left", index] for index in range(2)] == pytest.approx([1.0] * 2, abs=0.1)
