"""Samples as no robot should send them: the estimator may learn nothing from them, and must survive them."""

from math import isfinite, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.gait import Gait, GaitParameters
from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass
from control.records import NO_LOAD, Phase, StrideEstimate
from estimation.mud import MudEstimator, MudReading

GEOMETRY = FlipperGeometry()
TICK_S = 1.0 / 380.0
Row = tuple[float, Phase, float, float, float, float]  # time, phase, sweep, adduction and their currents


def new_estimator() -> MudEstimator:
    return MudEstimator(GEOMETRY, ArmMass(), (0.083, 0.083, 0.083, 0.083))


def fed(mud: MudEstimator, rows: list[Row]) -> list[StrideEstimate]:
    strides: list[StrideEstimate] = []
    for now_s, phase, sweep, adduction, sweep_a, adduction_a in rows:
        angles, currents = (sweep, adduction, sweep, adduction), (sweep_a, adduction_a, sweep_a, adduction_a)
        strides += mud.update(now_s, phase, angles, (nan,) * 4, currents, nan).strides
    return strides


def walk() -> list[Row]:
    gait, rows = Gait(GaitParameters(), GEOMETRY), list[Row]()
    gait.reset(0.03)
    for tick in range(1000):
        target = gait.step(TICK_S)
        adduction = GEOMETRY.adduction_rad(target.sweep_rad, target.depth_m)
        push = max(0.0, target.depth_m)
        rows.append((tick * TICK_S, target.phase, target.sweep_rad, adduction, -300.0 * push, -150.0 * push))
    return rows


def assert_honest(strides: list[StrideEstimate]) -> None:
    for stride in strides:
        for estimate in (stride.k_p, stride.k_s, stride.k_e):
            assert not estimate.valid or (estimate.value > 0.0 and isfinite(estimate.value + estimate.std_error))
            assert estimate.valid == (estimate.reason == "")


def test_the_walk_below_is_a_good_one() -> None:
    strides = fed(new_estimator(), walk())
    assert len(strides) == 4
    assert all(stride.k_p.valid and stride.k_s.valid for stride in strides)


def test_an_estimator_without_samples_knows_nothing() -> None:
    assert MudReading() == MudReading(NO_LOAD, NO_LOAD, ())


@pytest.mark.parametrize("phase", Phase)
def test_a_single_sample_closes_nothing(phase: Phase) -> None:
    assert fed(new_estimator(), [(0.0, phase, 0.1, -0.5, -5.0, -5.0)]) == []


@pytest.mark.parametrize("current_a", [0.0, -10.0, 10.0])
def test_constant_samples_give_no_valid_coefficient(current_a: float) -> None:
    strides = fed(new_estimator(), [(t, phase, 0.1, -0.5, current_a, current_a) for t, phase, *_ in walk()])
    assert len(strides) == 4
    for stride in strides:
        assert not (stride.k_p.valid or stride.k_s.valid or stride.k_e.valid)


def test_samples_of_nothing_but_nan_give_no_valid_coefficient() -> None:
    for stride in fed(new_estimator(), [(t, phase, nan, nan, nan, nan) for t, phase, *_ in walk()]):
        assert not (stride.k_p.valid or stride.k_s.valid or stride.k_e.valid)


def test_a_walk_backward_in_time_is_survived() -> None:
    assert_honest(fed(new_estimator(), walk()[::-1]))


def test_strokes_reversed_under_a_running_clock_are_survived() -> None:
    rows = walk()
    times = [row[0] for row in rows]
    assert_honest(fed(new_estimator(), [(t, *row[1:]) for t, row in zip(times, rows[::-1], strict=True)]))


def test_a_clock_that_stands_still_closes_nothing() -> None:
    assert fed(new_estimator(), [(1.0, *row[1:]) for row in walk()]) == []


def test_phases_in_any_order_leave_the_next_good_stride_as_it_is() -> None:
    mud, rows = new_estimator(), walk()
    fed(mud, [(0.001 * i, phase, 0.1, -0.5, -5.0, -5.0 - i) for i, phase in enumerate([*Phase, *reversed(Phase)])])
    mud.reset()
    assert repr(fed(mud, rows)) == repr(fed(new_estimator(), rows))


anything = st.floats()
rows_of_anything = st.tuples(anything, st.sampled_from(Phase), anything, anything, anything, anything)


@given(st.lists(rows_of_anything, max_size=60))
def test_nothing_makes_the_estimator_raise(rows: list[Row]) -> None:
    fed(new_estimator(), rows)


modest = st.floats(-1.5, 1.5) | st.just(nan)
modest_rows = st.tuples(st.floats(0.0, 10.0), st.sampled_from(Phase), modest, modest, st.floats(-20, 20), modest)


@given(st.lists(modest_rows, max_size=60))
def test_modest_nonsense_never_gives_a_dishonest_estimate(rows: list[Row]) -> None:
    assert_honest(fed(new_estimator(), sorted(rows, key=lambda row: row[0])))


@given(st.lists(st.floats(), min_size=13, max_size=13), st.sampled_from(Phase))
def test_velocities_and_poses_of_any_value_are_survived(values: list[float], phase: Phase) -> None:
    mud = new_estimator()
    a, b, c, d = values[:4]
    for now_s, where in ((values[12], phase), (1.0, Phase.STANCE), (1.0, Phase.EXTRACTION), (2.0, Phase.SWING)):
        mud.update(now_s, where, (0.1, 0.2, 0.3, 0.4), (a, b, c, d), (values[4], values[5], values[6], values[7]), a)
        mud.update(now_s, where, (0.1, 0.2, 0.3, 0.5), (d, c, b, a), (values[8], values[9], 0.0, 0.0), values[11])
