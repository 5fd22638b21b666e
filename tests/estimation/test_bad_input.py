"""Samples that no robot should send: the estimator learns nothing from them and does not fail."""

from collections.abc import Callable
from functools import cache
from math import isfinite, isnan, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.records import BodyPose, Phase, StrideEstimate
from estimation.estimation_parameters import EstimationParameters, Method
from estimation.joint_load import FlipperDrive
from estimation.mud import MudEstimator
from estimation.recorded_states import recorded_states
from estimation.strokes.depth_line import COEFFICIENTS_N_M3
from tests.estimation.synthetic_strides import GEOMETRY, WEIGHTLESS, walked

DRIVE = FlipperDrive(WEIGHTLESS, 0.083, 0.083, current_limit_a=10.0)
STRIDES = 4
METHODS: tuple[Method, ...] = ("default", "paper")
COEFFICIENT = {Phase.INSERTION: "k_p", Phase.STANCE: "k_s", Phase.EXTRACTION: "k_e"}
NO_MUD_N_M3 = COEFFICIENTS_N_M3[0]  # the memory ignores smaller values: here roundings of torques that are zero
Row = tuple[float, Phase, float, float, float, float]  # time, phase, sweep, adduction and their currents


@pytest.fixture(params=METHODS)
def method(request: pytest.FixtureRequest) -> Method:
    chosen: Method = request.param
    return chosen


def new_estimator(method: Method) -> MudEstimator:
    return MudEstimator(GEOMETRY, (DRIVE, DRIVE), EstimationParameters(method=method))


def fed(mud: MudEstimator, rows: list[Row], body_m: float = 0.0) -> list[StrideEstimate]:
    strides: list[StrideEstimate] = []
    for now_s, phase, sweep, adduction, sweep_a, adduction_a in rows:
        angles, currents = (sweep, adduction, sweep, adduction), (sweep_a, adduction_a, sweep_a, adduction_a)
        states = recorded_states(now_s, angles, (nan,) * 4, currents)
        strides += mud.update(now_s, phase, states, BodyPose(now_s, body_m)).strides
    return strides


@cache
def walk() -> list[Row]:
    """Return rows whose currents are in proportion to depth and oppose each stroke, up to 9 A."""
    rows = []
    for moment in walked(strides=STRIDES // 2):
        push = max(0.0, moment.depth_m)
        sweep_a = -300.0 * push if moment.phase is Phase.STANCE else 0.0
        adduction_a = {Phase.INSERTION: -150.0, Phase.EXTRACTION: 150.0}.get(moment.phase, 0.0) * push
        rows.append((*moment[:4], sweep_a, adduction_a))
    return rows


def assert_all_consistent(strides: list[StrideEstimate]) -> None:
    """Check that each estimate is a value, a lower bound with its reason, or nothing with its reason."""
    for stride in strides:
        for estimate in (stride.k_p, stride.k_s, stride.k_e):
            assert estimate.valid == (estimate.reason == "" or estimate.at_least)
            assert not estimate.at_least or estimate.reason
            assert not estimate.valid or (estimate.value > 0.0 and isfinite(estimate.value + estimate.std_error))


@pytest.mark.parametrize("body_m", [0.0, nan])
def test_the_unaltered_walk_gives_every_coefficient_and_without_a_pose_consistent_ones(
    method: Method, body_m: float
) -> None:
    strides = fed(new_estimator(method), walk(), body_m)
    assert len(strides) == STRIDES
    assert_all_consistent(strides)
    for stride in strides:
        estimates = (stride.k_p, stride.k_s, stride.k_e)
        assert isnan(body_m) or all(each.valid and not each.at_least for each in estimates)


# one bad stroke in a good walk


ALTERATIONS: dict[str, Callable[[list[Row]], list[Row]]] = {
    "emptied": lambda rows: [(*row[:2], nan, nan, nan, nan) for row in rows],
    "without angles": lambda rows: [(*row[:2], nan, nan, *row[4:]) for row in rows],
    "without currents": lambda rows: [(*row[:4], nan, nan) for row in rows],
    "held still": lambda rows: [(*row[:2], *rows[-1][2:]) for row in rows],
    "pressed against its limit": lambda rows: [(*row[:2], *rows[-1][2:4], -10.0, -10.0) for row in rows],
    "single": lambda rows: rows[-1:],
    "few": lambda rows: rows[:: len(rows) // 2],
    "without load": lambda rows: [(*row[:4], 0.0, 0.0) for row in rows],
    "drawn along": lambda rows: [(*row[:4], -row[4], -row[5]) for row in rows],  # the force helps the motion
}


def altered_walk(stroke: Phase, alter: Callable[[list[Row]], list[Row]]) -> list[Row]:
    """Return a walk in which `alter` has changed every stroke of one kind."""
    rows, result, batch = walk(), list[Row](), list[Row]()
    for row in rows:
        if row[1] is stroke:
            batch.append(row)
            continue
        result += alter(batch) if batch else []
        batch = []
        result.append(row)
    return result


@pytest.mark.parametrize("altered", ALTERATIONS)
@pytest.mark.parametrize("stroke", COEFFICIENT)
def test_an_altered_stroke_gives_no_value(stroke: Phase, altered: str, method: Method) -> None:
    strides = fed(new_estimator(method), altered_walk(stroke, ALTERATIONS[altered]))
    assert len(strides) == STRIDES
    assert_all_consistent(strides)
    for stride in strides:
        estimate = getattr(stride, COEFFICIENT[stroke])
        assert not estimate.valid or estimate.at_least or estimate.value < NO_MUD_N_M3


def stuck(fraction: float) -> Callable[[list[Row]], list[Row]]:
    """Let the sweep motor give 10 A throughout and the flipper stop after that fraction of the stance."""

    def alter(rows: list[Row]) -> list[Row]:
        stop = rows[int(fraction * len(rows))][2:4]
        return [(*row[:2], *(row[2:4] if row[2] > stop[0] else stop), -10.0, 0.0) for row in rows]

    return alter


@pytest.mark.parametrize("fraction", [0.05, 0.1, 0.2, 0.6])
def test_a_motor_at_its_limit_gives_a_bound_or_the_strength_of_mud_that_it_moved_for_a_while(fraction: float) -> None:
    """The mud withstood 10 A where the walk yields at 9 A, so it is at least that much stronger."""
    good = fed(new_estimator("default"), walk())[0].k_s.value
    for stride in fed(new_estimator("default"), altered_walk(Phase.STANCE, stuck(fraction))):
        moved = fraction > 0.5
        assert stride.k_s.valid if moved else stride.k_s.reason
        assert moved or not stride.k_s.valid or stride.k_s.at_least
        if stride.k_s.valid:
            assert stride.k_s.value == pytest.approx(good * 10.0 / 9.0, rel=0.15 if moved else 0.25)


anything = st.floats()


@settings(max_examples=15)
@given(st.lists(anything, min_size=1, max_size=30), st.sampled_from(METHODS))
def test_no_currents_make_a_good_walk_raise(currents_a: list[float], method: Method) -> None:
    """Every stroke closes here, which random rows hardly ever achieve."""
    rows = [
        (*row[:4], currents_a[i % len(currents_a)], currents_a[-i % len(currents_a)]) for i, row in enumerate(walk())
    ]
    assert_all_consistent(fed(new_estimator(method), rows))
