"""The choice of the next depth, from beliefs made up of muds that slip, that hold, and that do both.

What a depth bears is computed here by numpy over the plate's pieces, not by the formulas of control/plate.py.
"""

from math import inf, nan, radians

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control.adaptation import GRID_M, AdaptationParameters, DepthAdaptation, DepthChoice
from control.coefficient import NOTHING_KNOWN, Coefficient, FlipperBelief, MudBelief
from control.gait import GaitParameters
from control.geometry import FlipperGeometry
from control.records import Estimate, StrideEstimate

GEOMETRY, GAIT, PARAMETERS = FlipperGeometry(), GaitParameters(), AdaptationParameters()
REAR_RAD = -radians(30.0)
LIFTING_NM = 0.75
NOT_TOLD = Estimate(nan, nan, 0, False, "fewer than 5 samples in the mud")


def told(
    value: float,
    doubt: float = 0.0,
    depth_m: float = 0.03,
    exponent: float = 0.0,
    exponent_doubt: float = 0.0,
    at_least: bool = False,
) -> Coefficient:
    """By the paper's own law (one k at every depth), unless told otherwise."""
    return Coefficient(value, doubt, depth_m, exponent, exponent_doubt, 8, at_least)


def bound(value: float, depth_m: float = 0.03) -> Coefficient:
    return told(value, depth_m=depth_m, at_least=True)


def believed(k_s: Coefficient | None, k_e: Coefficient | None) -> MudBelief:
    """By both flippers alike."""
    flipper = FlipperBelief(None, k_s, k_e)
    return MudBelief(None, k_s, k_e, flipper, flipper)


def apart(left: tuple[Coefficient | None, Coefficient | None], right: tuple[Coefficient | None, ...]) -> MudBelief:
    """(k_s, k_e) of flippers in two muds."""
    return MudBelief(left=FlipperBelief(None, *left), right=FlipperBelief(None, *right))


def stride(
    flipper: str = "left", depth_m: float = 0.03, released: bool = True, surface_m: float = 0.0
) -> StrideEstimate:
    return StrideEstimate(
        flipper=flipper,
        index=0,
        t_start_s=0.0,
        t_end_s=1.0,
        insertion_s=0.4,
        stance_s=0.25,
        extraction_s=0.1,
        k_p=NOT_TOLD,
        k_s=NOT_TOLD,
        k_e=NOT_TOLD,
        surface_m=surface_m,
        depth_m=depth_m,
        released=released,
        insertion_force_n=3.0,
        stance_force_n=6.0,
        extraction_force_n=-2.0,
        step_m=nan,
    )


def both(depth_m: float = 0.03, released: bool = True, surface_m: float = 0.0) -> list[StrideEstimate]:
    return [stride(flipper, depth_m, released, surface_m) for flipper in ("left", "right")]


def adapted() -> DepthAdaptation:
    return DepthAdaptation(PARAMETERS, GEOMETRY, GAIT)


def chosen(belief: MudBelief, strides: list[StrideEstimate] | None = None) -> DepthChoice:
    return adapted().step(belief, both() if strides is None else strides)


def plate_pieces(sweep_rad: float, depth_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Depth ζ, and u outward and s up from the lower edge's middle, of small pieces under the surface; one's area."""
    adduction_rad = GEOMETRY.adduction_rad(sweep_rad, depth_m)
    width_m, height_m = GEOMETRY.plate_width_m, GEOMETRY.plate_height_m
    u, s = np.meshgrid((np.arange(400) + 0.5) / 400 * width_m - width_m / 2, (np.arange(1400) + 0.5) / 1400 * height_m)
    outward = np.cos(sweep_rad) * np.sin(adduction_rad)
    depths = depth_m - u * outward - s * np.cos(adduction_rad)
    wet = depths > 0.0
    return depths[wet], u[wet], s[wet], width_m * height_m / u.size


def thrust_m3(depth_m: float) -> float:
    """∫ζ dA with the flipper straight out."""
    depths, _, _, piece_m2 = plate_pieces(0.0, depth_m)
    return float(np.sum(depths)) * piece_m2


def lift_m4(depth_m: float) -> float:
    """Submerged volume times the way of its centre per radian, at the rear."""
    _, u, s, piece_m2 = plate_pieces(REAR_RAD, depth_m)
    volume_m3 = GEOMETRY.plate_thickness_m * u.size * piece_m2
    way_m = np.hypot(GEOMETRY.flipper_length_m + np.mean(u), GEOMETRY.drop_m - np.mean(s)) * np.cos(REAR_RAD)
    return volume_m3 * float(way_m)


def resistance_n(k_s: float) -> float:
    return 2.5 + k_s * 0.015 * 0.02**2 / 2.0 + 1.0 * 0.5 / 0.2


def bears(share: float, depth_m: float) -> float:
    """The k_s with which both flippers' thrust at this depth is `share` of the resistance."""
    return share * 5.0 / (2.0 * thrust_m3(depth_m) - share * 0.015 * 0.02**2 / 2.0)


FIRM, SOFT, SLIPPERY = told(1.5e6), told(0.3e6), told(0.1e6)
LOOSE, STICKY = told(0.5e6), told(1.6e6)


class TestTheTwoConditions:
    def test_firm_mud_that_lets_go_is_walked_at_the_shallowest_depth(self) -> None:
        assert chosen(believed(FIRM, LOOSE)) == DepthChoice(0.025, False, "both conditions hold")

    def test_soft_mud_that_slips_is_walked_deeper(self) -> None:
        choice = chosen(believed(SOFT, LOOSE))
        assert choice.depth_m > PARAMETERS.initial_depth_m
        assert not choice.slips

    @pytest.mark.parametrize("k_s", [0.15e6, 0.2e6, 0.3e6, 0.45e6])
    def test_the_depth_is_the_shallowest_whose_thrust_passes_the_papers_condition(self, k_s: float) -> None:
        choice = chosen(believed(told(k_s), LOOSE))
        assert 2.0 * k_s * thrust_m3(choice.depth_m) > 1.5 * resistance_n(k_s)
        assert 2.0 * k_s * thrust_m3(choice.depth_m - GRID_M) <= 1.5 * resistance_n(k_s)
        assert not choice.slips

    def test_the_inertial_force_is_the_papers_mass_times_arc_over_its_two_times(self) -> None:
        sweep_rad, length_m = radians(GAIT.sweep_angle_deg), GEOMETRY.flipper_length_m
        stance_s = 2.0 * sweep_rad * length_m / GAIT.stance_speed_m_s
        expected = PARAMETERS.body_mass_kg * sweep_rad * length_m / (PARAMETERS.acceleration_s * stance_s)
        assert adapted().inertial_force_n == pytest.approx(expected)

    @pytest.mark.parametrize("k_e", [0.9e6, 1.2e6, 1.6e6])
    def test_sticky_mud_is_walked_no_deeper_than_the_lifting_torque_pulls_out(self, k_e: float) -> None:
        choice = chosen(believed(SLIPPERY, told(k_e)))
        assert k_e * lift_m4(choice.depth_m) < 0.8 * LIFTING_NM
        assert k_e * lift_m4(choice.depth_m + GRID_M) >= 0.8 * LIFTING_NM
        assert (choice.slips, choice.reason) == (True, "thrust")

    def test_mud_that_grows_sticky_is_walked_shallower(self) -> None:
        adaptation = adapted()
        before = adaptation.step(believed(SLIPPERY, LOOSE), both())
        after = adaptation.step(believed(SLIPPERY, STICKY), both())
        assert after.depth_m < before.depth_m

    def test_where_nothing_comes_out_the_shallowest_depth_is_taken(self) -> None:
        assert chosen(believed(SLIPPERY, told(9e6))) == DepthChoice(PARAMETERS.min_depth_m, True, "extraction")
        assert chosen(believed(FIRM, told(9e6))) == DepthChoice(PARAMETERS.min_depth_m, False, "extraction")

    def test_a_surface_that_lies_deeper_needs_a_deeper_stride(self) -> None:
        level, sunk = chosen(believed(SOFT, LOOSE)), chosen(believed(SOFT, LOOSE), both(surface_m=0.0075))
        assert sunk.depth_m - level.depth_m == pytest.approx(0.0075, abs=GRID_M + 1e-9)
        assert sunk.depth_m > level.depth_m


class TestWhatIsNotKnown:
    def test_without_a_k_s_the_depth_is_kept(self) -> None:
        adaptation = adapted()
        adaptation.reset(0.0375)
        choice = adaptation.step(believed(None, STICKY), both())
        assert choice == DepthChoice(0.0375, False, "no k_s known, depth kept")
        assert adaptation.step(NOTHING_KNOWN, both()).depth_m == 0.0375

    def test_where_no_stride_closed_the_depth_is_kept(self) -> None:
        adaptation = adapted()
        adaptation.reset(0.0375)
        assert adaptation.step(believed(FIRM, LOOSE), []).depth_m == 0.0375

    def test_what_was_learned_in_earlier_strides_counts_as_well(self) -> None:
        assert all(not each.k_s.valid and not each.k_e.valid for each in both())
        assert chosen(believed(FIRM, LOOSE)).depth_m == 0.025

    def test_one_flipper_speaks_for_both_where_the_other_does_not_know_k_s(self) -> None:
        sure = chosen(believed(SOFT, LOOSE))
        assert chosen(apart((SOFT, LOOSE), (None, LOOSE))) == sure
        assert chosen(apart((None, LOOSE), (SOFT, LOOSE))) == sure

    def test_an_extraction_without_any_k_e_allows_one_step_deeper_than_it_was(self) -> None:
        choice = chosen(believed(SLIPPERY, None), both(depth_m=0.03))
        assert choice.depth_m == pytest.approx(0.03 + GRID_M)

    def test_a_stride_of_which_nothing_is_known_is_survived(self) -> None:
        lost = stride(depth_m=nan, surface_m=nan)
        assert chosen(believed(FIRM, None), [lost, stride("right")]).depth_m == PARAMETERS.min_depth_m
        assert chosen(NOTHING_KNOWN, [lost]).depth_m == PARAMETERS.initial_depth_m


class TestDoubt:
    @given(st.floats(0.05e6, 3e6), st.floats(0.0, 3e6), st.tuples(*[st.floats(0.0, 1e7)] * 2))
    def test_doubt_about_thrust_never_makes_it_shallower(
        self, k_s: float, k_e: float, pair: tuple[float, float]
    ) -> None:
        sure, doubtful = (chosen(believed(told(k_s, doubt), told(k_e))) for doubt in sorted(pair))
        assert doubtful.depth_m >= sure.depth_m
        assert doubtful.slips >= sure.slips

    @given(st.floats(0.05e6, 3e6), st.floats(0.0, 3e6), st.tuples(*[st.floats(0.0, 1e7)] * 2))
    def test_doubt_about_suction_never_makes_it_deeper(self, k_s: float, k_e: float, pair: tuple[float, float]) -> None:
        sure, doubtful = (chosen(believed(told(k_s), told(k_e, doubt))) for doubt in sorted(pair))
        assert doubtful.depth_m <= sure.depth_m

    @given(st.floats(0.05e6, 3e6), st.floats(0.0, 3e6), st.tuples(*[st.floats(0.0, 2.0)] * 2), st.floats(0.02, 0.05))
    def test_doubt_about_the_depth_law_never_makes_it_bolder(
        self, k_s: float, k_e: float, pair: tuple[float, float], depth_m: float
    ) -> None:
        def learned(value: float, doubt: float) -> Coefficient:
            return told(value, depth_m=depth_m, exponent=-0.5, exponent_doubt=doubt)

        thrust = [chosen(believed(learned(k_s, doubt), told(k_e))) for doubt in sorted(pair)]
        suction = [chosen(believed(told(k_s), learned(k_e, doubt))) for doubt in sorted(pair)]
        assert thrust[1].depth_m >= thrust[0].depth_m
        assert suction[1].depth_m <= suction[0].depth_m

    def test_two_standard_errors_change_the_choice(self) -> None:
        sure = chosen(believed(told(0.4e6), told(1.0e6)))
        assert chosen(believed(told(0.4e6, 0.08e6), told(1.0e6))) == chosen(believed(told(0.4e6 - 0.16e6), told(1.0e6)))
        assert chosen(believed(told(0.4e6, 0.08e6), told(1.0e6))).depth_m > sure.depth_m
        assert chosen(believed(told(0.4e6), told(1.0e6, 0.4e6))).depth_m < sure.depth_m

    def test_mud_that_reads_softer_in_deeper_strides_is_walked_deeper_than_the_papers_law_says(self) -> None:
        def depth_m(exponent: float, doubt: float) -> float:
            return chosen(believed(told(0.25e6, exponent=exponent, exponent_doubt=doubt), LOOSE)).depth_m

        assert depth_m(0.0, 0.0) < depth_m(-0.8, 0.0) < depth_m(-0.8, 0.2)

    def test_suction_learned_in_shallow_strides_is_doubted_in_deep_ones(self) -> None:
        def depth_m(doubt: float) -> float:
            return chosen(believed(SLIPPERY, told(0.85e6, exponent=-0.4, exponent_doubt=doubt))).depth_m

        assert depth_m(0.3) < depth_m(0.0)

    def test_what_comes_out_of_a_deep_place_comes_out_of_every_shallower_one(self) -> None:
        deep = told(0.55e6, depth_m=0.05, exponent=-0.5, exponent_doubt=2.0)
        shallow_k, shallow_doubt = deep.at(0.025)
        assert (shallow_k + 2.0 * shallow_doubt) * lift_m4(0.025) > 0.8 * LIFTING_NM
        assert chosen(believed(FIRM, deep)) == DepthChoice(0.025, False, "both conditions hold")


class TestStuck:
    @pytest.mark.parametrize("depth_m", [0.0325, 0.04, 0.05])
    @pytest.mark.parametrize("k_s", [FIRM, SOFT, told(0.01e6), None])
    def test_a_stuck_flipper_goes_shallower_than_where_it_stuck(self, depth_m: float, k_s: Coefficient | None) -> None:
        choice = chosen(believed(k_s, None), both(depth_m, released=False))
        assert choice.depth_m < depth_m
        assert choice.reason == "a flipper was stuck"

    def test_one_stuck_flipper_is_enough(self) -> None:
        strides = [stride("left", 0.04), stride("right", 0.04, released=False)]
        assert chosen(believed(SLIPPERY, LOOSE), strides).depth_m <= 0.8 * 0.04

    def test_a_flipper_that_stuck_at_the_shallowest_depth_stays_there(self) -> None:
        assert chosen(believed(FIRM, None), both(0.025, released=False)).depth_m == PARAMETERS.min_depth_m

    @pytest.mark.parametrize("reached_m", [nan, inf, -inf])
    def test_one_that_stuck_nobody_knows_where_goes_to_the_shallowest_depth(self, reached_m: float) -> None:
        choice = chosen(believed(SLIPPERY, LOOSE), both(reached_m, released=False))
        assert choice.depth_m == PARAMETERS.min_depth_m

    def test_a_stuck_flipper_is_not_believed_when_it_tells_a_weak_suction(self) -> None:
        assert chosen(believed(told(0.01e6), told(1.0)), both(0.04, released=False)).depth_m < 0.04

    def test_a_depth_that_stuck_stays_out_of_bounds_whatever_is_believed(self) -> None:
        adaptation = adapted()
        free = adaptation.step(believed(SLIPPERY, LOOSE), both(0.03)).depth_m
        for strides in (both(0.04, released=False), both(0.025), both(0.03)):
            assert adaptation.step(believed(SLIPPERY, LOOSE), strides).depth_m <= 0.8 * 0.04 < free

    def test_a_flipper_that_comes_out_of_where_it_stuck_may_go_deeper_again(self) -> None:
        adaptation = adapted()
        adaptation.step(believed(SLIPPERY, LOOSE), both(0.0252, released=False))
        assert adaptation.choice.depth_m == 0.025
        adaptation.step(believed(SLIPPERY, LOOSE), [stride("left", 0.0249)])
        assert adaptation.step(believed(SLIPPERY, LOOSE), both(0.0249)) == chosen(believed(SLIPPERY, LOOSE))

    def test_where_a_flipper_stuck_is_forgotten_in_another_mud_and_in_another_walk(self) -> None:
        other_mud, other_walk = adapted(), adapted()
        for adaptation in (other_mud, other_walk):
            adaptation.step(believed(SLIPPERY, LOOSE), both(0.04, released=False))
        other_walk.reset(0.03)
        free = chosen(believed(SLIPPERY, LOOSE))
        assert other_mud.step(believed(SLIPPERY, LOOSE)._replace(boundary=True), both()) == free
        assert other_walk.step(believed(SLIPPERY, LOOSE), both()) == free

    def test_a_flipper_that_sticks_in_the_first_stride_in_another_mud_is_remembered(self) -> None:
        adaptation = adapted()
        adaptation.step(believed(SLIPPERY, LOOSE)._replace(boundary=True), both(0.04, released=False))
        assert adaptation.step(believed(SLIPPERY, LOOSE), both(0.03)).depth_m <= 0.8 * 0.04

    def test_the_least_depth_that_stuck_counts(self) -> None:
        adaptation = adapted()
        for depth_m in (0.04, 0.05):
            choice = adaptation.step(believed(SLIPPERY, LOOSE), both(depth_m, released=False))
        assert choice.depth_m <= 0.8 * 0.04

    def test_a_lower_bound_of_suction_never_says_that_a_flipper_comes_out(self) -> None:
        unknown, at_least = (chosen(believed(SLIPPERY, k_e), both(0.03)) for k_e in (None, bound(0.1e6)))
        assert at_least == unknown

    def test_a_lower_bound_of_suction_says_where_a_flipper_sticks(self) -> None:
        assert chosen(believed(SLIPPERY, bound(2.5e6)), both(0.03)) == DepthChoice(0.025, True, "extraction")


class TestMudThatHeld:
    """Its k_s is only a lower bound."""

    def test_where_the_body_was_borne_the_depth_is_kept_without_the_margin(self) -> None:
        k_s = bears(1.2, 0.03)
        assert chosen(believed(told(k_s), LOOSE)).depth_m > 0.03
        choice = chosen(believed(bound(k_s), LOOSE))
        assert choice.depth_m == pytest.approx(0.03)
        assert not choice.slips

    @pytest.mark.parametrize("reached_m", [0.0291, 0.0309])
    def test_a_stride_that_did_not_reach_its_depth_exactly_does_not_move_it(self, reached_m: float) -> None:
        k_s = bears(1.2, reached_m)
        assert chosen(believed(bound(k_s, reached_m), LOOSE), both(reached_m)).depth_m == pytest.approx(0.03)

    def test_a_force_that_could_not_move_the_body_proves_nothing(self) -> None:
        k_s = bears(0.95, 0.03)
        assert chosen(believed(bound(k_s), LOOSE)) == chosen(believed(told(k_s), LOOSE))

    def test_a_shallower_depth_needs_the_margin(self) -> None:
        assert chosen(believed(bound(bears(1.2, 0.04), 0.04), LOOSE), both(0.04)).depth_m == pytest.approx(0.04)
        assert chosen(believed(bound(1.5e6, 0.04), LOOSE), both(0.04)).depth_m == 0.025

    def test_both_flippers_must_have_been_held(self) -> None:
        held, slipped = bound(bears(1.2, 0.03)), told(0.2e6)
        assert chosen(apart((held, LOOSE), (slipped, LOOSE))).depth_m > 0.03
        assert chosen(apart((held, LOOSE), (held, LOOSE))).depth_m == pytest.approx(0.03)

    def test_a_deeper_surface_moves_the_depth_that_held(self) -> None:
        choice = chosen(believed(bound(bears(1.3, 0.03)), LOOSE), both(surface_m=0.01))
        assert choice.depth_m == pytest.approx(0.04)


class TestTwoMuds:
    coefficients = st.floats(0.05e6, 3e6).map(told)
    suctions = coefficients | st.just(None)

    def test_each_flippers_own_suction_counts(self) -> None:
        loose, sticky = (SLIPPERY, LOOSE), (SLIPPERY, STICKY)
        assert chosen(apart(loose, loose)).depth_m == pytest.approx(0.05)
        assert chosen(apart(loose, sticky)) == chosen(apart(sticky, loose)) == chosen(believed(*sticky))

    @given(coefficients, suctions, suctions)
    def test_the_flipper_that_the_mud_holds_harder_decides(
        self, k_s: Coefficient, k_e: Coefficient | None, other: Coefficient | None
    ) -> None:
        alone = [chosen(apart((k_s, each), (k_s, each))) for each in (k_e, other)]
        together = chosen(apart((k_s, k_e), (k_s, other)))
        swapped = chosen(apart((k_s, other), (k_s, k_e)))
        assert together.depth_m == swapped.depth_m == min(choice.depth_m for choice in alone)

    @given(st.floats(0.05e6, 3e6), st.floats(0.05e6, 3e6))
    def test_their_thrusts_add_up(self, one: float, other: float) -> None:
        mean = told((one + other) / 2.0)
        assume(one != other)
        assert chosen(apart((told(one), LOOSE), (told(other), LOOSE))) == chosen(believed(mean, LOOSE))


numbers = st.floats() | st.floats(0.0, 1e8)
anything = st.builds(Coefficient, numbers, numbers, st.floats() | st.floats(0.0, 0.06), numbers, numbers, st.just(3))
plausible = st.builds(
    told,
    st.floats(0.0, 1e8),
    st.floats(0.0, 1e7),
    st.floats(0.005, 0.06),
    st.floats(-1.5, 0.5),
    st.floats(0.0, 0.5),
    st.booleans(),
)
coefficients = plausible | anything | st.none()
beliefs = st.builds(MudBelief, *[coefficients] * 3, *[st.builds(FlipperBelief, *[coefficients] * 3)] * 2)
strides = st.builds(
    stride,
    st.sampled_from(["left", "right"]),
    st.floats() | st.floats(0.0, 0.06),
    st.booleans(),
    st.floats() | st.floats(-0.02, 0.04),
)
pairs = st.lists(strides, min_size=1, max_size=2)


class TestRange:
    @given(st.lists(st.tuples(beliefs, pairs), max_size=5))
    def test_the_depth_stays_within_its_bounds_and_within_reach(
        self, walk: list[tuple[MudBelief, list[StrideEstimate]]]
    ) -> None:
        adaptation = adapted()
        for belief, pair in walk:
            choice = adaptation.step(belief, pair)
            assert PARAMETERS.min_depth_m <= choice.depth_m <= PARAMETERS.max_depth_m
            assert GEOMETRY.is_reachable(radians(GAIT.sweep_angle_deg), choice.depth_m)

    @given(st.floats(5.0, 45.0), st.floats(0.02, 0.2), beliefs, pairs)
    def test_a_greatest_depth_out_of_reach_is_never_chosen(
        self, sweep_deg: float, max_depth_m: float, belief: MudBelief, pair: list[StrideEstimate]
    ) -> None:
        gait, parameters = GaitParameters(sweep_angle_deg=sweep_deg), AdaptationParameters(max_depth_m=max_depth_m)
        assume(GEOMETRY.is_reachable(radians(sweep_deg), parameters.min_depth_m))
        assume(max_depth_m >= parameters.min_depth_m)
        adaptation = DepthAdaptation(parameters, GEOMETRY, gait)
        assert all(GEOMETRY.is_reachable(radians(sweep_deg), depth) for depth in adaptation.grid_m)
        adaptation.reset(parameters.min_depth_m)
        assert parameters.min_depth_m <= adaptation.step(belief, pair).depth_m <= max_depth_m + 1e-9

    def test_a_least_depth_out_of_reach_raises_nothing(self) -> None:
        parameters = AdaptationParameters(min_depth_m=0.15, max_depth_m=0.2)
        choice = DepthAdaptation(parameters, GEOMETRY, GAIT).step(believed(FIRM, LOOSE), both())
        assert (choice.slips, choice.reason) == (True, "extraction")

    def test_the_grid_holds_both_ends_of_its_range(self) -> None:
        grid = adapted().grid_m
        assert grid[0] == 0.025
        assert grid[-1] == pytest.approx(0.05)
        assert len(grid) == 11

    @given(st.floats(0.01, 0.05), st.integers(0, 12), st.floats(0.01, 0.99))
    def test_the_grid_never_passes_its_greatest_depth(self, low_m: float, steps: int, share: float) -> None:
        high_m = low_m + (steps + share) * GRID_M
        assume(high_m < GEOMETRY.deepest_m(30.0))
        grid = DepthAdaptation(AdaptationParameters(min_depth_m=low_m, max_depth_m=high_m), GEOMETRY, GAIT).grid_m
        assert len(grid) == steps + 1
        assert grid[-1] <= high_m
