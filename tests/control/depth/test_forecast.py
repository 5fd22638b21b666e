"""Thrust and extraction torque at other depths, forecast in synthetic muds.

The plate's sums over pieces of 0.25 by 0.05 mm are accurate to a thousandth (PIECES).
"""

from math import log, nan, sqrt

import pytest

from control.depth.forecast import THRUST_UNCERTAINTY, DepthForecast
from control.mud_estimate import NOTHING_KNOWN, Coefficient, FlipperEstimate, MudEstimate
from control.records import StrideEstimate
from tests.control.synthetic_muds import (
    GAIT,
    GEOMETRY,
    LIFTING_NM,
    MOTOR_FORCE_N,
    apart,
    both,
    bound,
    estimated,
    lift_m4,
    measured,
    reported,
    stride,
    thrust_m3,
)

PIECES = 1e-3
DEPTHS_M = (0.015, 0.02, 0.03, 0.04, 0.05)
SOFT, FIRM = reported(0.2e6), reported(0.6e6)


def new_forecast() -> DepthForecast:
    return DepthForecast(GEOMETRY, GAIT, MOTOR_FORCE_N)


def forecast(
    mud_estimate: MudEstimate, strides: list[StrideEstimate] | None = None, commanded_m: float | None = None
) -> DepthForecast:
    """Return the forecast after one stride, which reached its commanded depth unless `commanded_m` is given."""
    forecast = new_forecast()
    strides = both() if strides is None else strides
    reached_m = [stride.depth_m + stride.surface_m for stride in strides]
    forecast.update(mud_estimate, strides, min(reached_m, default=0.03) if commanded_m is None else commanded_m)
    return forecast


def inserted(k_p: float, uncertainty: float = 0.0, k_s: Coefficient | None = None) -> MudEstimate:
    return estimated(k_s, None, reported(k_p, uncertainty))


KNOWN, UNKNOWN = FlipperEstimate(None, SOFT), FlipperEstimate()


class TestThrust:
    @pytest.mark.parametrize("depth_m", DEPTHS_M)
    @pytest.mark.parametrize("exponent", [0.0, -0.8])
    def test_a_mud_that_yielded_withstands_its_k_s_there_times_the_depth_moment_of_both_plates(
        self, exponent: float, depth_m: float
    ) -> None:
        expected_n = 2.0 * 0.12e6 * (depth_m / 0.025) ** exponent * thrust_m3(depth_m)
        learned = estimated(reported(0.12e6, depth_m=0.025, exponent=exponent))
        assert forecast(learned).yield_n(depth_m) == pytest.approx(expected_n, rel=PIECES)

    @pytest.mark.parametrize(
        ("mud_estimate", "k_s"),
        [
            # less by a part of the repeatability, which may leave nothing; the standard error does not count
            (estimated(reported(0.4e6, 0.1e6)._replace(std_error=0.3e6)), 0.4e6 - THRUST_UNCERTAINTY * 0.1e6),
            (estimated(reported(0.1e6, 0.1e6 / THRUST_UNCERTAINTY)), 0.0),
            # the mean of the flippers, or the one that is known
            (apart(KNOWN, FlipperEstimate(None, reported(0.4e6))), 0.3e6),
            (apart(KNOWN, UNKNOWN), 0.2e6),
            (apart(UNKNOWN, KNOWN), 0.2e6),
            # mud that held: 0.55 of the insertion's k_p, less a part of its uncertainty of a fifth
            (inserted(0.5e6), 0.55 * (1.0 - 0.2 * THRUST_UNCERTAINTY) * 0.5e6),
            (inserted(0.5e6, 0.2e6), 0.55 * (1.0 - 0.2 * THRUST_UNCERTAINTY) * (0.5e6 - THRUST_UNCERTAINTY * 0.2e6)),
            # or its bound, whichever is larger; a value needs no insertion
            (inserted(0.5e6, k_s=bound(0.3e6)), 0.3e6),
            (inserted(0.5e6, k_s=bound(0.1e6)), 0.2475e6),
            (estimated(bound(0.2e6)), 0.2e6),
            (inserted(9e6, k_s=SOFT), 0.2e6),
        ],
    )
    def test_the_strength_that_counts_is_the_one_that_is_known_best(
        self, mud_estimate: MudEstimate, k_s: float
    ) -> None:
        expected_n = forecast(estimated(reported(k_s))).yield_n(0.03)
        assert forecast(mud_estimate).yield_n(0.03) == pytest.approx(expected_n)

    def test_the_error_of_the_depth_law_counts_at_other_depths(self) -> None:
        uncertain, sure = (
            forecast(estimated(reported(0.1e6, exponent_uncertainty=uncertainty))) for uncertainty in (0.3, 0.0)
        )
        fraction = 1.0 - THRUST_UNCERTAINTY * 0.3 * log(0.05 / 0.03)
        for depth_m, expected in ((0.03, 1.0), (0.05, fraction)):
            assert uncertain.yield_n(depth_m) == pytest.approx(expected * (sure.yield_n(depth_m) or nan))

    def test_nothing_is_forecast_where_nothing_is_known(self) -> None:
        nothing = (
            forecast(NOTHING_KNOWN),
            forecast(estimated(None, SOFT)),
            forecast(estimated(SOFT), []),
            new_forecast(),
        )
        assert [each.yield_n(0.03) for each in nothing] == [None] * 4


class TestRatio:
    @pytest.mark.parametrize(
        ("truth", "nearest"), [(0.3, 0.3), (0.55, 0.55), (0.69, 0.69), (1.2, 1.2), (30.0, 1.5), (0.001, 0.2)]
    )
    def test_each_stride_with_both_coefficients_moves_the_ratio_a_quarter_towards_the_truth(
        self, truth: float, nearest: float
    ) -> None:
        """Nonsense is trusted only so far."""
        learning = new_forecast()
        for strides in range(1, 30):
            learning.update(inserted(0.7e6, k_s=reported(truth * 0.7e6)), both(), 0.03)
            if nearest == truth:
                left = log(0.55 / truth) * 0.75**strides
                assert log(learning.shear_ratio / truth) == pytest.approx(left, abs=1e-12)
        assert learning.shear_ratio == pytest.approx(nearest, rel=1e-3)

    def test_both_are_compared_at_the_same_depth(self) -> None:
        shallow = reported(1.0e6, depth_m=0.02, exponent=-0.5)
        learning = forecast(estimated(reported(0.55e6 * (0.04 / 0.02) ** -0.5, depth_m=0.04), None, shallow))
        assert learning.shear_ratio == pytest.approx(0.55)

    @pytest.mark.parametrize("k_s", [bound(0.7e6), None, reported(nan), reported(0.0)])
    @pytest.mark.parametrize("k_p", [bound(0.7e6), None, reported(nan), reported(0.0)])
    def test_bounds_and_gaps_teach_nothing(self, k_s: Coefficient | None, k_p: Coefficient | None) -> None:
        assert forecast(estimated(k_s, None, k_p)).shear_ratio == 0.55
        assert forecast(estimated(k_s, None, reported(0.7e6))).shear_ratio == 0.55
        assert forecast(estimated(reported(0.7e6), None, k_p)).shear_ratio == 0.55


class TestFeltFraction:
    WHOLE_NM = 0.6e6 * lift_m4(0.03)

    def reported_by(self, *fractions: float) -> DepthForecast:
        learning = new_forecast()
        for fraction in fractions:
            extraction = stride(k_e=measured(0.6e6), extraction_nm=fraction * self.WHOLE_NM)
            learning.update(estimated(None, reported(0.6e6)), [extraction], 0.03)
        return learning

    @pytest.mark.parametrize(
        ("fractions", "mean"),
        [
            ((), 1.0),
            ((0.6,), 0.6),
            ((0.5, 0.8), sqrt(0.5 * 0.8)),
            ((0.5, 0.8, 0.7, 0.9), (0.5 * 0.8 * 0.7 * 0.9) ** 0.25),
            ((0.5, 0.8, 0.7, 0.9, 0.6), (0.5 * 0.8 * 0.7 * 0.9) ** (0.25 * 0.75) * 0.6**0.25),
            ((9.0,), 1.5),  # nonsense is trusted only so far
            ((0.01,), 0.2),
        ],
    )
    def test_the_first_four_count_alike_and_later_ones_a_quarter(
        self, fractions: tuple[float, ...], mean: float
    ) -> None:
        assert self.reported_by(*fractions).felt_fraction == pytest.approx(mean, rel=PIECES)

    @pytest.mark.parametrize(
        "teaches_nothing",
        [
            stride(extraction_nm=0.1),
            stride(k_e=measured(0.6e6)),
            stride(k_e=measured(0.6e6), extraction_nm=-0.1),
            stride(k_e=measured(0.6e6)._replace(valid=False), extraction_nm=0.1),
            stride(k_e=measured(0.6e6, at_least=True), extraction_nm=0.1),
            stride(k_e=measured(0.6e6), extraction_nm=0.1, released=False),
            stride(k_e=measured(0.6e6), extraction_nm=0.1, depth_m=nan),
            stride(k_e=measured(0.6e6), extraction_nm=0.1, surface_m=nan),
            stride(k_e=measured(0.6e6), extraction_nm=0.1, surface_m=-0.5),
            stride(k_e=measured(-0.6e6), extraction_nm=0.1),
        ],
    )
    def test_an_extraction_without_a_coefficient_changes_nothing(self, teaches_nothing: StrideEstimate) -> None:
        assert forecast(NOTHING_KNOWN, [teaches_nothing]).felt_fraction == 1.0

    def test_the_surface_that_the_flipper_met_counts(self) -> None:
        whole_nm = 0.6e6 * lift_m4(0.04, 0.01)
        sunk = stride(surface_m=0.01, k_e=measured(0.6e6), extraction_nm=0.7 * whole_nm)
        assert forecast(NOTHING_KNOWN, [sunk]).felt_fraction == pytest.approx(0.7, rel=PIECES)


class TestExtraction:
    @pytest.mark.parametrize("depth_m", DEPTHS_M)
    @pytest.mark.parametrize(("k_e", "uncertainty"), [(0.4e6, 0.0), (0.2e6, 0.1e6), (-0.4e6, 0.2e6)])
    def test_the_torque_is_k_e_times_the_lift_moment_and_two_standard_errors(
        self, k_e: float, uncertainty: float, depth_m: float
    ) -> None:
        """A k_e below zero is none, but keeps its uncertainty."""
        found = forecast(estimated(None, reported(k_e, uncertainty)), both(nan)).extraction_nm(depth_m)
        assert found == pytest.approx(0.4e6 * lift_m4(depth_m), rel=PIECES)

    def test_the_learned_fraction_counts(self) -> None:
        felt = [stride(k_e=measured(0.6e6), extraction_nm=0.5 * 0.6e6 * lift_m4(0.03))]
        found = forecast(estimated(None, reported(0.6e6)), felt).extraction_nm(0.05)
        assert found == pytest.approx(0.5 * 0.6e6 * lift_m4(0.05), rel=2.0 * PIECES)

    def test_the_flipper_that_the_mud_holds_harder_decides(self) -> None:
        loose, sticky = FlipperEstimate(None, None, reported(0.3e6)), FlipperEstimate(None, None, reported(0.9e6))
        for mud_estimate in (apart(loose, sticky), apart(sticky, loose)):
            assert forecast(mud_estimate).extraction_nm(0.03) == forecast(apart(sticky, sticky)).extraction_nm(0.03)

    @pytest.mark.parametrize(
        ("k_e", "depth_m", "expected_nm"),
        [
            (2e6, 0.03, 0.3),
            (2e6, 0.035, 0.3),
            (2e6, 0.045, 0.3 * lift_m4(0.045) / lift_m4(0.035)),
            (0.1e6, 0.02, 0.1e6 * lift_m4(0.02)),  # a smaller estimate counts instead
            (0.1e6, 0.045, 0.1e6 * lift_m4(0.045)),
        ],
    )
    def test_a_flipper_that_came_out_proves_every_shallower_depth_and_deeper_in_proportion_to_the_lift_moment(
        self, k_e: float, depth_m: float, expected_nm: float
    ) -> None:
        """k_e falls with depth, so deeper it is at most that torque."""
        proven = forecast(estimated(None, reported(k_e)), both(0.035, extraction_nm=0.3))
        assert proven.extraction_nm(depth_m) == pytest.approx(expected_nm, rel=2.0 * PIECES)

    def test_where_k_e_is_not_known_k_p_stands_for_it(self) -> None:
        for k_e in (None, bound(0.1e6)):
            mud_estimate = estimated(None, k_e)._replace(k_p=reported(0.5e6, 0.1e6))
            found = forecast(mud_estimate, both(0.02)).extraction_nm(0.04)
            assert found == pytest.approx(0.7e6 * lift_m4(0.04), rel=PIECES)

    def test_a_flipper_that_stuck_proves_nothing_by_its_torque(self) -> None:
        """At half the depth the mud holds with half of the full torque, or with its estimated torque where that is
        more.
        """
        stuck = both(0.04, released=False, extraction_nm=0.1)
        for k_e, expected_nm in ((2e6, 2e6 * lift_m4(0.02)), (0.5e6, LIFTING_NM / 2.0)):
            found = forecast(estimated(None, reported(k_e)), stuck).extraction_nm(0.02)
            assert found == pytest.approx(expected_nm, rel=PIECES)

    @pytest.mark.parametrize("k_e", [None, bound(0.1e6)])
    def test_without_a_value_it_comes_out_of_where_it_was_and_a_step_of_the_grid_deeper(
        self, k_e: Coefficient | None
    ) -> None:
        unsure = forecast(estimated(None, k_e), both(0.03))
        assert unsure.extraction_nm(0.0325) < 0.2 * LIFTING_NM
        assert unsure.extraction_nm(0.0326) == LIFTING_NM

    def test_a_lower_bound_gives_the_least_torque(self) -> None:
        assert forecast(estimated(None, bound(2.5e6)), both(0.03)).extraction_nm(0.03) == pytest.approx(
            2.5e6 * lift_m4(0.03), rel=PIECES
        )

    def test_a_stride_that_ended_at_an_unknown_depth_proves_nothing(self) -> None:
        assert forecast(estimated(None), both(nan, extraction_nm=0.1)).extraction_nm(0.015) == LIFTING_NM


class TestStuck:
    LOOSE = estimated(None, reported(1.0))  # all that holds is the memory

    def after(self, *strides: list[StrideEstimate]) -> DepthForecast:
        remembering = new_forecast()
        for pair in strides:
            remembering.update(self.LOOSE, pair, pair[0].depth_m)
        return remembering

    def test_where_a_flipper_stuck_it_takes_all_the_torque_and_elsewhere_in_proportion_to_depth(self) -> None:
        stuck = self.after(both(0.04, released=False), both(0.02))
        for depth_m in DEPTHS_M:
            assert stuck.extraction_nm(depth_m) == pytest.approx(LIFTING_NM * depth_m / 0.04)

    @pytest.mark.parametrize(
        ("reached_m", "forgotten"), [(0.0375, False), (0.0386, False), (0.0389, True), (0.05, True)]
    )
    def test_coming_out_of_there_forgets_it_and_of_a_shallower_depth_does_not(
        self, reached_m: float, forgotten: bool
    ) -> None:
        """Within half a step of the grid, 1.25 mm, the depth counts as the same."""
        after = self.after(both(0.04, released=False), *[both(reached_m)] * 5)
        assert after.extraction_nm(0.04) < 0.01 if forgotten else after.extraction_nm(0.04) == pytest.approx(LIFTING_NM)

    @pytest.mark.parametrize(("stuck", "other"), [("left", "right"), ("right", "left")])
    def test_each_flipper_has_its_own_memory(self, stuck: str, other: str) -> None:
        first = [stride(stuck, 0.04, released=False), stride(other, 0.04)]
        assert self.after(first, [stride(stuck, 0.03), stride(other, 0.05)]).extraction_nm(0.04) == LIFTING_NM
        assert self.after(first, [stride(stuck, 0.05), stride(other, 0.03)]).extraction_nm(0.04) < 0.01

    def test_the_least_depth_counts(self) -> None:
        for first_m, then_m in ((0.03, 0.05), (0.05, 0.03)):
            twice = self.after(both(first_m, released=False), both(then_m, released=False), both(0.02))
            assert twice.extraction_nm(0.03) == pytest.approx(LIFTING_NM)

    def test_another_mud_and_another_walk_forget_it(self) -> None:
        other_mud, other_walk = self.after(both(0.04, released=False)), self.after(both(0.04, released=False))
        other_mud.update(self.LOOSE._replace(boundary=True), both(0.02), 0.02)
        other_walk.reset()
        other_walk.update(self.LOOSE, both(0.02), 0.02)
        assert other_mud.extraction_nm(0.04) == other_walk.extraction_nm(0.04) < 0.01

    def test_a_flipper_that_sticks_in_the_first_stride_in_another_mud_is_remembered(self) -> None:
        remembering = new_forecast()
        remembering.update(self.LOOSE._replace(boundary=True), both(0.04, released=False), 0.04)
        remembering.update(self.LOOSE, both(0.02), 0.02)
        assert remembering.extraction_nm(0.04) == pytest.approx(LIFTING_NM)

    def test_a_stride_stuck_at_an_unknown_depth_is_held_at_every_depth(self) -> None:
        assert self.after(both(nan, released=False)).extraction_nm(0.01) > LIFTING_NM


class TestHowDeepTheFlippersGo:
    @pytest.mark.parametrize(
        ("left", "right", "reached_m"),
        [
            (stride("left", 0.034), stride("right", 0.038), 0.021),
            (stride("left", 0.024, surface_m=0.01), stride("right", 0.024, surface_m=0.01), 0.021),
            (stride("left", 0.025), stride("right", 0.04), 0.02),  # one did not reach its depth
            (stride("left", nan), stride("right", 0.034), 0.021),  # an unknown depth gives no sag
            (stride("left", nan), stride("right", nan), 0.02),
        ],
    )
    def test_a_quarter_of_the_sag_of_the_flipper_that_sagged_less_is_added(
        self, left: StrideEstimate, right: StrideEstimate, reached_m: float
    ) -> None:
        """Sag is measured from the nominal surface."""
        assert forecast(estimated(SOFT), [left, right], 0.03).reached_m(0.02) == pytest.approx(reached_m)

    def test_the_sag_adds_to_the_thrust_and_also_has_to_come_out(self) -> None:
        sagged = forecast(estimated(SOFT, reported(0.4e6)), both(0.038), 0.03)
        assert sagged.yield_n(0.03) == pytest.approx(2.0 * 0.2e6 * thrust_m3(0.032), rel=PIECES)
        assert sagged.extraction_nm(0.03) == pytest.approx(0.4e6 * lift_m4(0.032), rel=PIECES)

    def test_they_go_no_deeper_than_the_arm_reaches_at_the_ends_of_the_sweep(self) -> None:
        """The deepest pose has a vertical lever of 1 cm: √((l cos α)² + h² - 1 cm²) - H."""
        deepest_m = sqrt((0.12**2) * 0.75 + 0.05**2 - 0.01**2) - 0.0645
        far = forecast(estimated(reported(0.1e6), reported(0.4e6)), both(0.09), 0.03)
        assert far.reached_m(0.04) == far.reached_m(0.3) == pytest.approx(deepest_m)
        assert far.yield_n(0.3) == pytest.approx(2.0 * 0.1e6 * thrust_m3(deepest_m), rel=PIECES)
        assert far.extraction_nm(0.3) == pytest.approx(0.4e6 * lift_m4(deepest_m), rel=PIECES)


class TestSurface:
    @pytest.mark.parametrize("surface_m", [-0.01, 0.0075])
    def test_thrust_and_suction_are_those_of_the_plate_under_the_surface(self, surface_m: float) -> None:
        learned = estimated(reported(0.12e6, exponent=-0.8), reported(0.4e6, exponent=-0.4))
        found = forecast(learned, both(0.02, surface_m=surface_m))
        submerged_m = 0.035 - surface_m
        k_s, k_e = 0.12e6 * (submerged_m / 0.03) ** -0.8, 0.4e6 * (submerged_m / 0.03) ** -0.4
        assert found.yield_n(0.035) == pytest.approx(2.0 * k_s * thrust_m3(0.035, surface_m), rel=PIECES)
        assert found.extraction_nm(0.035) == pytest.approx(k_e * lift_m4(0.035, surface_m), rel=PIECES)

    def test_flippers_that_do_not_reach_the_mud_push_nothing_and_are_held_by_nothing(self) -> None:
        high = forecast(estimated(SOFT, reported(9e6)), both(surface_m=0.03))
        assert high.yield_n(0.03) == high.extraction_nm(0.03) == high.extraction_nm(0.02) == 0.0

    def test_each_flipper_has_its_own_surface(self) -> None:
        pair = [stride("left", surface_m=0.01), stride("right", 0.02)]
        expected_n = 0.2e6 * (thrust_m3(0.03, 0.01) + thrust_m3(0.03))
        assert forecast(estimated(SOFT), pair).yield_n(0.03) == pytest.approx(expected_n, rel=PIECES)

    def test_a_surface_that_is_not_known_is_the_nominal_one(self) -> None:
        mud_estimate = estimated(SOFT, reported(0.4e6))
        unknown, nominal = forecast(mud_estimate, both(surface_m=nan)), forecast(mud_estimate, both())
        assert unknown.yield_n(0.04) == nominal.yield_n(0.04)
        assert unknown.extraction_nm(0.04) == nominal.extraction_nm(0.04)


class TestPad:
    def test_the_mud_at_the_pad_is_the_mean_of_the_flippers_on_the_side_of_more_drag(self) -> None:
        two_muds = apart(FlipperEstimate(None, reported(0.2e6, 0.05e6)), FlipperEstimate(None, reported(0.4e6)))
        assert forecast(two_muds).drag_shear(0.02) == pytest.approx((0.2e6 + THRUST_UNCERTAINTY * 0.05e6 + 0.4e6) / 2.0)

    def test_it_follows_the_depth_law(self) -> None:
        learned = estimated(reported(0.2e6, exponent=-1.0))
        assert forecast(learned).drag_shear(0.02) == pytest.approx(0.3e6)

    def test_it_is_none_where_there_is_no_pad_or_nothing_is_known(self) -> None:
        assert forecast(estimated(FIRM)).drag_shear(0.0) == 0.0
        assert forecast(NOTHING_KNOWN).drag_shear(0.02) == forecast(estimated(FIRM), []).drag_shear(0.02) == 0.0
