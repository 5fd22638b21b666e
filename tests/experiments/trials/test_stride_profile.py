"""The profile of a stride contains that stride and flipper of a log, with a limited number of rows."""

import json
from math import nan

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from control.modes import Mode
from control.records import Phase
from experiments.trials.stride_profile import profile_from, profile_lists, profile_of, slip_m, stroke_of, thinned
from tests.experiments.synthetic_strides import make_log, make_profile, make_ticks

STROKE = [Phase.INSERTION] * 30 + [Phase.PAUSE] * 100 + [Phase.STANCE] * 30


def test_a_profile_is_that_of_the_stride_under_way() -> None:
    log = make_log(make_ticks(STROKE, 0, 0.0), make_ticks(STROKE, 1, 2.0), make_ticks(STROKE, 2, 4.0))
    profile = profile_of(log, "right", 2.5)
    assert profile["phase"].tolist() == STROKE
    assert profile["time_s"].tolist() == pytest.approx(0.01 * np.arange(len(STROKE)))


def test_a_profile_is_that_of_the_flipper_asked_for() -> None:
    ticks = make_ticks([Phase.INSERTION])
    ticks["force_z_n"] = [[1.0, 2.0]]
    ticks["angle_rad"] = [[0.1, 0.2, 0.3, 0.4]]
    for flipper, values in (("left", [1.0, 0.1, 0.2]), ("right", [2.0, 0.3, 0.4])):
        row = profile_of(make_log(ticks), flipper, 0.0).iloc[0]
        assert row[["force_z_n", "sweep_rad", "adduction_rad"]].tolist() == values


def test_rows_outside_of_a_stride_are_not_in_its_profile() -> None:
    raised, held = make_ticks([Phase.REST] * 3, -1), make_ticks([Phase.REST] * 3, 0, 0.5)
    held["mode"] = Mode.HOLD
    profile = profile_of(make_log(raised, make_ticks(STROKE, 0, 0.1), held), "left", 0.1)
    assert len(profile) == len(STROKE)


def test_slip_is_the_plates_travel_backwards_in_the_world_not_on_the_robot() -> None:
    """The plate sweeps back by 6 cm while the body advances by 2 cm; then it moves forward with the body."""
    swept = make_profile(Phase.STANCE, [30.0, 0.0, 0.0], [0.03] * 3, body_x_m=[1.0, 1.02, 1.05])
    assert slip_m(swept, 0.12) == pytest.approx(0.04)
    for changes in ({"body_x_m": [nan, 1.0, 1.02]}, {"body_x_m": nan}, {"phase": Phase.SWING}):
        assert slip_m(swept.assign(**changes), 0.12) == 0.0


def test_pauses_are_thinned_more_than_strokes_and_no_phase_is_lost() -> None:
    profile = profile_of(make_log(make_ticks(STROKE)), "left", 0.0)
    thin = thinned(profile)
    for phase, count in ((Phase.INSERTION, 15), (Phase.PAUSE, 6), (Phase.STANCE, 15)):
        assert len(stroke_of(thin, phase)) == count
        assert stroke_of(thin, phase)["time_s"].iloc[0] == stroke_of(profile, phase)["time_s"].iloc[0]


def test_a_profile_is_the_same_when_read_from_the_notebook() -> None:
    ticks = make_ticks(STROKE)
    ticks["force_x_n"] = np.nan
    profile = profile_of(make_log(ticks), "left", 0.0)
    read = profile_from(json.loads(json.dumps({"course": profile_lists(profile)})))
    assert_frame_equal(read, profile, check_dtype=False, atol=1e-6)
    assert read["force_x_n"].isna().all()
