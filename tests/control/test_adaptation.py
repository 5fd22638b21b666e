"""The choice of the next depth, from strides made up for muds that slip, that hold, and that do both."""

from math import inf, nan, radians

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control.adaptation import GRID_M, AdaptationParameters, DepthAdaptation, DepthChoice
from control.gait import GaitParameters
from control.geometry import FlipperGeometry
from control.records import Estimate, StrideEstimate

GEOMETRY, GAIT, PARAMETERS = FlipperGeometry(), GaitParameters(), AdaptationParameters()
UNKNOWN_K = Estimate(nan, nan, 0, False, "fewer than 5 samples in the mud")
EDGE_M2 = 0.025 * 0.004


def told(value: float, doubt: float = 0.0) -> Estimate:
    return Estimate(value, doubt, 50, True)


def stride(
    k_s: Estimate, k_e: Estimate, depth_m: float = 0.03, released: bool = True, surface_m: float = 0.0
) -> StrideEstimate:
    return StrideEstimate(
        flipper="left",
        index=0,
        t_start_s=0.0,
        t_end_s=1.0,
        insertion_s=0.4,
        stance_s=0.25,
        extraction_s=0.1,
        k_p=told(1e6),
        k_s=k_s,
        k_e=k_e,
        surface_m=surface_m,
        depth_m=depth_m,
        released=released,
        insertion_force_n=3.0,
        stance_force_n=6.0,
        extraction_force_n=-2.0,
        step_m=nan,
    )


def adapted() -> DepthAdaptation:
    return DepthAdaptation(PARAMETERS, GEOMETRY, GAIT)


def chosen(*strides: StrideEstimate) -> DepthChoice:
    return adapted().step(strides)


coefficients = st.floats(0.0, 1e8)
doubts = st.floats(0.0, 1e7)
estimates = st.builds(told, coefficients, doubts) | st.just(UNKNOWN_K)
strides = st.builds(stride, estimates, estimates, st.floats(0.0, 0.06), st.booleans(), st.floats(-0.02, 0.04))


FIRM, SOFT = told(1.5e6), told(0.3e6)
LOOSE, STICKY = told(0.5e6), told(1.6e6)


def test_firm_mud_that_lets_go_is_walked_at_the_shallowest_depth() -> None:
    choice = chosen(stride(FIRM, LOOSE))
    assert choice == DepthChoice(0.025, False, "both conditions hold")


def test_soft_mud_that_slips_is_walked_deeper() -> None:
    choice = chosen(stride(SOFT, LOOSE))
    assert choice.depth_m > PARAMETERS.initial_depth_m
    assert not choice.slips


def test_the_depth_is_the_shallowest_whose_thrust_passes_the_papers_condition() -> None:
    k_s = 0.3e6
    resistance_n = 2.5 + k_s * 0.015 * 0.02**2 / 2.0 + 1.0 * 0.5 / 0.2
    choice = chosen(stride(told(k_s), LOOSE))
    assert 2.0 * k_s * 0.025 * choice.depth_m**2 / 2.0 > 1.5 * resistance_n
    assert 2.0 * k_s * 0.025 * (choice.depth_m - GRID_M) ** 2 / 2.0 <= 1.5 * resistance_n


def test_the_inertial_force_is_the_papers_mass_times_arc_over_its_two_times() -> None:
    sweep_rad, length_m = radians(GAIT.sweep_angle_deg), GEOMETRY.flipper_length_m
    stance_s = 2.0 * sweep_rad * length_m / GAIT.stance_speed_m_s
    expected = PARAMETERS.body_mass_kg * sweep_rad * length_m / (PARAMETERS.acceleration_s * stance_s)
    assert adapted().inertial_force_n == pytest.approx(expected)


def test_sticky_mud_is_walked_no_deeper_than_what_comes_out() -> None:
    choice = chosen(stride(told(0.1e6), STICKY))
    assert STICKY.value * EDGE_M2 * choice.depth_m < 0.8 * 6.25
    assert STICKY.value * EDGE_M2 * (choice.depth_m + GRID_M) >= 0.8 * 6.25
    assert choice.slips


def test_mud_that_grows_sticky_is_walked_shallower() -> None:
    adaptation = adapted()
    before = adaptation.step([stride(told(0.1e6), LOOSE)])
    after = adaptation.step([stride(told(0.1e6), STICKY)])
    assert after.depth_m < before.depth_m


def test_where_nothing_comes_out_the_shallowest_depth_is_taken() -> None:
    choice = chosen(stride(told(0.1e6), told(9e6)))
    assert choice == DepthChoice(PARAMETERS.min_depth_m, True, "extraction")


@pytest.mark.parametrize("depth_m", [0.0325, 0.04, 0.05])
def test_a_stuck_flipper_goes_shallower_than_where_it_stuck(depth_m: float) -> None:
    for k_s in (FIRM, SOFT, told(0.01e6), UNKNOWN_K):
        choice = chosen(stride(k_s, UNKNOWN_K, depth_m, released=False))
        assert choice.depth_m < depth_m
        assert choice.reason == "a flipper was stuck"


def test_a_flipper_that_stuck_at_the_shallowest_depth_stays_there() -> None:
    assert chosen(stride(FIRM, UNKNOWN_K, 0.025, released=False)).depth_m == PARAMETERS.min_depth_m


def test_a_stuck_flipper_is_not_believed_when_it_tells_a_weak_suction() -> None:
    optimistic = stride(told(0.01e6), told(1.0), 0.04, released=False)
    assert chosen(optimistic).depth_m < 0.04


def test_without_a_valid_k_s_the_depth_is_kept() -> None:
    adaptation = adapted()
    adaptation.reset(0.0375)
    choice = adaptation.step([stride(UNKNOWN_K, STICKY), stride(UNKNOWN_K, LOOSE)])
    assert choice == DepthChoice(0.0375, False, "no valid k_s, depth kept")
    assert adaptation.step([]).depth_m == 0.0375


def test_one_flipper_speaks_for_both_where_the_other_does_not_know_k_s() -> None:
    both = chosen(stride(SOFT, LOOSE), stride(SOFT, LOOSE))
    assert chosen(stride(SOFT, LOOSE), stride(UNKNOWN_K, LOOSE)) == both
    assert chosen(stride(UNKNOWN_K, LOOSE), stride(SOFT, LOOSE)) == both


def test_an_extraction_that_told_no_k_e_allows_one_step_deeper_than_it_was() -> None:
    choice = chosen(stride(told(0.05e6), UNKNOWN_K, depth_m=0.03))
    assert choice.depth_m == pytest.approx(0.03 + GRID_M)


def test_a_surface_that_lies_deeper_needs_a_deeper_stride() -> None:
    level, sunk = chosen(stride(SOFT, LOOSE)), chosen(stride(SOFT, LOOSE, surface_m=0.0075))
    assert sunk.depth_m - level.depth_m == pytest.approx(0.0075)


@given(st.floats(0.05e6, 3e6), st.floats(0.0, 3e6), st.tuples(doubts, doubts))
def test_doubt_about_thrust_never_makes_it_shallower(k_s: float, k_e: float, pair: tuple[float, float]) -> None:
    sure, doubtful = (chosen(stride(told(k_s, doubt), told(k_e))) for doubt in sorted(pair))
    assert doubtful.depth_m >= sure.depth_m
    assert doubtful.slips >= sure.slips


@given(st.floats(0.05e6, 3e6), st.floats(0.0, 3e6), st.tuples(doubts, doubts))
def test_doubt_about_suction_never_makes_it_deeper(k_s: float, k_e: float, pair: tuple[float, float]) -> None:
    sure, doubtful = (chosen(stride(told(k_s), told(k_e, doubt))) for doubt in sorted(pair))
    assert doubtful.depth_m <= sure.depth_m


def test_enough_doubt_changes_the_choice() -> None:
    sure = chosen(stride(told(0.4e6), told(1.0e6)))
    assert chosen(stride(told(0.4e6, 0.08e6), told(1.0e6))).depth_m > sure.depth_m
    assert chosen(stride(told(0.4e6), told(1.0e6, 0.4e6))).depth_m < sure.depth_m


@given(estimates, estimates, estimates)
def test_the_flipper_that_the_mud_holds_harder_decides(k_s: Estimate, k_e: Estimate, other: Estimate) -> None:
    assume(k_s.valid)
    alone = [chosen(stride(k_s, each)) for each in (k_e, other)]
    together = chosen(stride(k_s, k_e), stride(k_s, other))
    swapped = chosen(stride(k_s, other), stride(k_s, k_e))
    assert together.depth_m == swapped.depth_m == min(choice.depth_m for choice in alone)


@given(st.lists(st.lists(strides, min_size=1, max_size=2), max_size=5))
def test_the_depth_stays_within_its_bounds_and_within_reach(walk: list[list[StrideEstimate]]) -> None:
    adaptation = adapted()
    for pair in walk:
        choice = adaptation.step(pair)
        assert PARAMETERS.min_depth_m <= choice.depth_m <= PARAMETERS.max_depth_m
        assert GEOMETRY.is_reachable(radians(GAIT.sweep_angle_deg), choice.depth_m)


@given(st.floats(5.0, 45.0), st.floats(0.02, 0.2), st.lists(strides, min_size=1, max_size=2))
def test_a_greatest_depth_out_of_reach_is_never_chosen(
    sweep_deg: float, max_depth_m: float, pair: list[StrideEstimate]
) -> None:
    gait, parameters = GaitParameters(sweep_angle_deg=sweep_deg), AdaptationParameters(max_depth_m=max_depth_m)
    assume(GEOMETRY.is_reachable(radians(sweep_deg), parameters.min_depth_m))
    assume(max_depth_m >= parameters.min_depth_m)
    adaptation = DepthAdaptation(parameters, GEOMETRY, gait)
    assert all(GEOMETRY.is_reachable(radians(sweep_deg), depth) for depth in adaptation.grid_m)
    adaptation.reset(parameters.min_depth_m)
    assert parameters.min_depth_m <= adaptation.step(pair).depth_m <= max_depth_m + 1e-9


def test_the_grid_holds_both_ends_of_its_range() -> None:
    grid = adapted().grid_m
    assert grid[0] == 0.025
    assert grid[-1] == pytest.approx(0.05)
    assert len(grid) == 11


@given(st.floats(0.01, 0.05), st.integers(0, 12), st.floats(0.01, 0.99))
def test_the_grid_never_passes_its_greatest_depth(low_m: float, steps: int, share: float) -> None:
    high_m = low_m + (steps + share) * GRID_M
    assume(high_m < GEOMETRY.deepest_m(30.0))
    grid = DepthAdaptation(AdaptationParameters(min_depth_m=low_m, max_depth_m=high_m), GEOMETRY, GAIT).grid_m
    assert len(grid) == steps + 1
    assert grid[-1] <= high_m


def test_a_stride_of_which_nothing_is_known_is_survived() -> None:
    lost = stride(UNKNOWN_K, Estimate(nan, inf, 0, False), depth_m=nan)
    assert chosen(lost, stride(FIRM, LOOSE)).depth_m == PARAMETERS.min_depth_m
