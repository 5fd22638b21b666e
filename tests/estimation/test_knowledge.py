"""The memory from stride to stride: against numpy's weighted least squares, and in muds that stay or change.

The muds are numbers, without an estimator: every stride's k is the truth times a lognormal scatter of 8 % (the authors'
repeatability) and the uncertainty that the stride itself reports.
"""

import pickle
from collections.abc import Sequence
from functools import cache, partial
from math import exp, inf, isfinite, isnan, log, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.mud_estimate import NOTHING_KNOWN, Coefficient, MudEstimate
from control.records import FLIPPERS, Estimate, StrideEstimate
from estimation.knowledge import CHANGE, FLIPPER_SPREAD, PAIR_CHANGE, MudKnowledge
from estimation.strokes.depth_line import (
    REMEMBERED_STRIDES,
    REPEATABILITY,
    SHEAR_LAW,
    STROKE_LAW,
    SURE_EXPONENT,
    Line,
    Reading,
    reading_of,
)
from tests.control import synthetic_muds
from tests.control.synthetic_muds import NOT_REPORTED
from tests.control.synthetic_muds import measured as reported

K_P, K_S, K_E = 1.0e6, 0.6e6, 1.1e6
REPORTED = 0.03  # relative standard error of a stride in these tests, where there is any
bound = partial(reported, at_least=True)


def stride(
    k_p: Estimate = NOT_REPORTED,
    k_s: Estimate = NOT_REPORTED,
    k_e: Estimate = NOT_REPORTED,
    depth_m: float = 0.03,
    flipper: str = "left",
) -> StrideEstimate:
    return synthetic_muds.stride(flipper, depth_m, k_p=k_p, k_s=k_s, k_e=k_e)


def after(*strides: StrideEstimate) -> MudEstimate:
    return walked(MudKnowledge(), *strides)


def walked(knowledge: MudKnowledge, *strides: StrideEstimate) -> MudEstimate:
    """Update the memory with one stride at a time and return the last estimate."""
    mud_estimate = knowledge.mud_estimate
    for each in strides:
        mud_estimate = knowledge.update([each])
    return mud_estimate


def stride_with(**estimates: Any) -> StrideEstimate:
    return stride(**estimates)


def found(coefficient: Coefficient | None) -> Coefficient:
    assert coefficient is not None
    return coefficient


def is_value(coefficient: Coefficient | None, value: float) -> bool:
    return not found(coefficient).at_least and found(coefficient).value == pytest.approx(value)


ALL_KNOWN = stride(reported(K_P), reported(K_S), reported(K_E))
TWO_KNOWN, K_P_KNOWN, K_S_KNOWN = (
    stride(reported(K_P), reported(K_S)),
    stride(reported(K_P)),
    stride(k_s=reported(K_S)),
)
PAIR_DEVIATION = sqrt(REPEATABILITY**2 / 2.0 + REPEATABILITY**2 / 8.0)
PAIR_K_P = reported(K_P * exp(-(PAIR_CHANGE + 0.01) * PAIR_DEVIATION))  # two of them make a boundary


def is_bound(coefficient: Coefficient | None, value: float) -> bool:
    return found(coefficient).at_least and found(coefficient).value == pytest.approx(value)


def readings(count: int, seed: int) -> list[Reading]:
    """Return readings around one line, at scattered depths."""
    random = np.random.default_rng(seed)
    log_depths = np.log(random.uniform(0.02, 0.06, count))
    variances = random.uniform(0.05, 0.2, count)
    log_k = 13.0 - 0.7 * (log_depths - log(0.03)) + np.sqrt(variances) * random.standard_normal(count)
    return [Reading(k, v, z) for k, v, z in zip(log_k.tolist(), variances.tolist(), log_depths.tolist(), strict=True)]


class TestOneMud:
    @given(st.integers(1, REMEMBERED_STRIDES), st.integers(0, 10**6))
    def test_the_line_is_numpys_weighted_least_squares_with_a_prior_on_the_slope(self, count: int, seed: int) -> None:
        rows = readings(count, seed)
        weights = np.array([1.0 / row.variance for row in rows])
        design = np.array([(1.0, row.log_depth) for row in rows])
        prior = np.diag([0.0, SHEAR_LAW.std_error**-2])
        covariance = np.linalg.inv(design.T @ (weights[:, None] * design) + prior)
        solution = covariance @ (design.T @ (weights * [row.log_k for row in rows]) + prior @ [0.0, SHEAR_LAW.exponent])
        line = Line(0.0, 0.0, 0.0, SHEAR_LAW.exponent, SHEAR_LAW.std_error**-2, 0)
        for row in rows:
            line = line.plus(row)
        assert line.exponent == pytest.approx(float(solution[1]), rel=1e-6)
        assert 1.0 / line.exponent_weight == pytest.approx(float(covariance[1, 1]), rel=1e-6)
        for log_depth in (log(0.02), log(0.035), log(0.06)):
            at = np.array([1.0, log_depth])
            assert line.expected(log_depth) == pytest.approx((at @ solution, at @ covariance @ at), rel=1e-6)

    @pytest.mark.parametrize("name", ["k_p", "k_s", "k_e"])
    @given(st.lists(st.tuples(st.floats(0.95, 1.05), st.floats(0.0, 0.3)), min_size=1, max_size=8))
    def test_strides_are_merged_by_their_precision(self, name: str, rows: list[tuple[float, float]]) -> None:
        mud_estimate = after(*(stride_with(**{name: reported(1e6 * value, relative)}) for value, relative in rows))
        weights = [1.0 / (relative**2 + REPEATABILITY**2) for _, relative in rows]
        mean = float(np.average([log(value) for value, _ in rows], weights=weights))
        merged = found(getattr(mud_estimate, name))
        assert merged.value == pytest.approx(1e6 * exp(mean))
        assert merged.std_error / merged.value == pytest.approx(1.0 / sqrt(sum(weights)))
        assert merged.depth_m == pytest.approx(0.03)
        assert (merged.strides, merged.at_least, mud_estimate.boundary) == (len(rows), False, False)

    def test_on_one_mud_the_uncertainty_narrows_to_eight_strides_worth_and_no_further(self) -> None:
        knowledge = MudKnowledge()
        uncertainties = []
        for _ in range(100):
            k_s = found(knowledge.update([K_S_KNOWN]).k_s)
            uncertainties.append(k_s.std_error / k_s.value)
        expected = [REPEATABILITY / sqrt(min(count, REMEMBERED_STRIDES)) for count in range(1, 101)]
        assert uncertainties == pytest.approx(expected)

    def test_a_slow_change_is_followed_without_calling_it_a_boundary(self) -> None:
        knowledge = MudKnowledge()
        k_s, boundaries = K_S, 0
        for _ in range(60):
            k_s *= 0.99
            boundaries += knowledge.update([stride(k_s=reported(k_s))]).boundary
        assert boundaries == 0
        assert found(knowledge.mud_estimate.k_s).value == pytest.approx(k_s, rel=0.09)

    def test_the_uncertainty_covers_the_truth_about_95_times_in_a_hundred(self) -> None:
        covered = runs = 0
        for seed in range(200):
            mud = Mud(seed)
            for _ in range(3):
                mud.walk()
            for flipper in (mud.knowledge.mud_estimate.left, mud.knowledge.mud_estimate.right):
                k_p = found(flipper.k_p)
                covered += abs(log(k_p.value / K_P)) <= 2.0 * k_p.std_error / k_p.value
                runs += 1
        assert 0.92 <= covered / runs <= 0.975

    def test_reset_forgets_everything(self) -> None:
        knowledge = MudKnowledge()
        depths_m = [0.03, 0.05] * 6
        walked(knowledge, *(stride(reported(K_P), reported(K_S), reported(K_E), depth_m) for depth_m in depths_m))
        knowledge.reset()
        assert knowledge.mud_estimate == NOTHING_KNOWN
        assert walked(knowledge, stride(k_s=reported(1.0))) == NOTHING_KNOWN
        assert walked(knowledge, stride(reported(K_S))) == after(stride(reported(K_S)))


class Mud:
    """Both flippers in one mud whose truth can be changed; k = truth · (z/3 cm)^exponent with the scatter."""

    def __init__(self, seed: int, exponent: float = -0.5, depths_m: Sequence[float] = (0.03,)) -> None:
        self.knowledge = MudKnowledge()
        self.random = np.random.default_rng(seed)
        self.exponent, self.depths_m = exponent, list(depths_m)
        self.scale_p = self.scale_s = 1.0

    def walk(self) -> MudEstimate:
        depth_m = float(self.random.choice(self.depths_m))
        return self.knowledge.update([self.stride(flipper, depth_m) for flipper in FLIPPERS])

    def stride(self, flipper: str, depth_m: float) -> StrideEstimate:
        scatter = np.exp(sqrt(REPEATABILITY**2 + REPORTED**2) * self.random.standard_normal(3)).tolist()
        law = (depth_m / 0.03) ** self.exponent
        return stride(
            reported(K_P * self.scale_p * law * scatter[0], REPORTED),
            reported(K_S * self.scale_s * law * scatter[1], REPORTED),
            reported(K_E * self.scale_p * law * scatter[2], REPORTED),
            depth_m,
            flipper,
        )


@cache
def pickled_after_twelve_strides(seed: int) -> bytes:
    mud = Mud(seed)
    for _ in range(12):
        mud.walk()
    return pickle.dumps(mud)


class Following(NamedTuple):
    reported: float  # fraction of the walks in which a boundary was reported within two strides
    nearer: float  # fraction of the flippers whose estimate was nearer to the new mud after two strides
    uncertainty: float  # median of their relative standard error


def following(step_s: float, step_p: float) -> Following:
    """Return how k_s follows a boundary at which the truths change by `step_s` and `step_p`."""
    boundaries, errors, uncertainties = 0, [], []
    for seed in range(200):
        mud = pickle.loads(pickled_after_twelve_strides(seed))
        mud.scale_s, mud.scale_p = step_s, step_p
        boundaries += any([mud.walk().boundary for _ in range(2)])
        for flipper in (mud.knowledge.mud_estimate.left, mud.knowledge.mud_estimate.right):
            k_s = found(flipper.k_s)
            errors.append(abs(log(k_s.value / (K_S * step_s))))
            uncertainties.append(k_s.std_error / k_s.value)
    nearer = np.mean(np.array(errors) < abs(log(step_s)) / 2.0)
    return Following(boundaries / 200, float(nearer), float(np.median(uncertainties)))


class TestBoundaries:
    @pytest.mark.parametrize("depths_m", [(0.03,), (0.025, 0.03, 0.04, 0.05)])
    @pytest.mark.parametrize(("walks", "strides"), [(150, 12), (10, 200)])
    def test_on_uniform_mud_less_than_one_stride_in_twenty_is_called_a_boundary(
        self, walks: int, strides: int, depths_m: tuple[float, ...]
    ) -> None:
        """Of the robot's strides, which have both flippers."""
        muds = [Mud(seed, depths_m=depths_m) for seed in range(walks)]
        assert sum(mud.walk().boundary for mud in muds for _ in range(strides)) < 0.05 * walks * strides

    @pytest.mark.parametrize(
        ("step", "reported_both", "nearer_both", "reported_one", "nearer_one"),
        [
            *((step, 0.995, 0.98, 0.99, 0.97) for step in (0.5, 0.7, 1.43)),
            *((step, 0.97, 0.78, 0.9, 0.6) for step in (0.8, 1.25)),  # mostly
        ],
    )
    def test_a_boundary_of_20_percent_and_more_is_reported_and_followed_within_two_strides(
        self, step: float, reported_both: float, nearer_both: float, reported_one: float, nearer_one: float
    ) -> None:
        both, only_k_s = following(step, step), following(step, 1.0)
        assert both.reported >= reported_both and both.nearer >= nearer_both
        assert only_k_s.reported >= reported_one and only_k_s.nearer >= nearer_one
        if not 0.75 < step < 1.3:
            assert both.uncertainty == pytest.approx(sqrt((REPEATABILITY**2 + REPORTED**2) / 2.0), rel=0.01)

    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_a_change_is_reported_from_2_6_standard_deviations_on_and_after_two_strides_from_fewer(
        self, sign: float
    ) -> None:
        deviation, known = sqrt(REPEATABILITY**2 + REPEATABILITY**2 / 8.0), [K_S_KNOWN] * 8

        def changed(deviations: float, deviation: float) -> StrideEstimate:
            return stride(k_s=reported(K_S * exp(sign * deviations * deviation)))

        assert after(*known, changed(CHANGE + 0.01, deviation)).boundary
        assert not after(*known, changed(CHANGE - 0.01, deviation)).boundary
        new = changed(PAIR_CHANGE + 0.01, PAIR_DEVIATION)
        assert not after(*known, new).boundary
        mud_estimate = after(*known, new, new)
        assert mud_estimate.boundary and is_value(mud_estimate.k_s, new.k_s.value)
        assert found(mud_estimate.k_s).strides == 2

    @pytest.mark.parametrize("factor", [0.01, 2.0])
    def test_after_one_wild_stride_the_next_one_brings_the_memory_back(self, factor: float) -> None:
        knowledge, known = MudKnowledge(), [ALL_KNOWN] * 5
        wild = walked(knowledge, *known, stride(reported(K_P), reported(K_S * factor), reported(K_E)))
        assert wild.boundary and is_value(wild.k_s, K_S * factor)
        assert walked(knowledge, ALL_KNOWN) == after(*known, ALL_KNOWN)

    def test_an_alarm_that_the_next_stride_does_not_confirm_is_taken_back(self) -> None:
        knowledge = MudKnowledge()
        known, outlier, next_one = (stride(k_s=reported(K_S * exp(off))) for off in (0.0, 0.225, 0.03))
        assert walked(knowledge, *[known] * 8, outlier).boundary
        mud_estimate = walked(knowledge, next_one)
        assert not mud_estimate.boundary
        assert found(mud_estimate.k_s).strides == 10
        assert found(mud_estimate.k_s).value == pytest.approx(K_S, rel=0.035)

    @pytest.mark.parametrize(("changed", "also"), [("k_p", "k_s"), ("k_p", "k_e"), ("k_s", "k_p"), ("k_s", "k_e")])
    def test_a_coefficient_of_another_mud_clears_the_others(self, changed: str, also: str) -> None:
        known = {"k_p": reported(K_P), "k_s": reported(K_S), "k_e": reported(K_E)}
        new = known | {changed: reported(2.0 * known[changed].value), also: reported(1.05 * known[also].value)}
        first, second, silent = (
            after(*[ALL_KNOWN] * 8, *(stride_with(**estimates) for estimates in strides))
            for strides in ([new], [new, new], [new | {also: NOT_REPORTED}])
        )
        assert (found(getattr(first, also)).strides, first.boundary) == (1, True)
        assert (found(getattr(second, also)).strides, second.boundary) == (2, False)
        assert is_value(getattr(second, also), 1.05 * known[also].value)
        assert getattr(silent, also) is None

    def test_suction_that_changes_alone_is_forgotten_alone(self) -> None:
        sticky = stride(reported(K_P), reported(K_S), reported(2.0 * K_E))
        mud_estimate = after(*[ALL_KNOWN] * 8, sticky, sticky)
        assert not mud_estimate.boundary
        assert [found(k).strides for k in mud_estimate[:3]] == [10, 10, 2]
        assert is_value(mud_estimate.k_e, 2.0 * K_E)

    def test_a_stride_that_gives_neither_k_p_nor_k_s_settles_no_alarm(self) -> None:
        knowledge = MudKnowledge()
        alarmed = walked(knowledge, *[K_P_KNOWN] * 8, stride(reported(2.0 * K_P)))
        assert walked(knowledge, stride(k_e=reported(K_E)), stride()).k_p == alarmed.k_p
        assert found(walked(knowledge, K_P_KNOWN).k_p).strides == 9

    def test_an_alarm_is_not_taken_back_by_a_coefficient_that_did_not_raise_it(self) -> None:
        known, changed = TWO_KNOWN, stride(reported(2.0 * K_P), reported(K_S))
        mud_estimate = after(*[known] * 8, changed, K_S_KNOWN)
        assert found(mud_estimate.k_p).value == pytest.approx(2.0 * K_P)

    def test_the_other_flipper_does_not_forget(self) -> None:
        knowledge = MudKnowledge()
        for _ in range(8):
            knowledge.update([stride(reported(K_P), flipper=flipper) for flipper in FLIPPERS])
        mud_estimate = knowledge.update([stride(reported(3.0 * K_P)), stride(reported(K_P), flipper="right")])
        assert mud_estimate.boundary
        assert (found(mud_estimate.left.k_p).strides, found(mud_estimate.right.k_p).strides) == (1, 9)


class TestBothFlippers:
    def estimated(self, left: Estimate, right: Estimate, strides: int = 8, depth_m: float = 0.03) -> MudEstimate:
        knowledge = MudKnowledge()
        for _ in range(strides):
            rows = [stride(left), stride(right, depth_m=depth_m, flipper="right")]
            knowledge.update([row for row in rows if row.k_p is not NOT_REPORTED])
        return knowledge.mud_estimate

    def test_where_they_agree_they_are_merged_by_precision(self) -> None:
        left, right = reported(K_P)._replace(std_error=0.05 * K_P), reported(1.02 * K_P, 0.1)
        mud_estimate = self.estimated(left, right, strides=1)
        variances = np.array([REPEATABILITY**2, REPEATABILITY**2 + 0.1**2])
        common = 0.05**2 / variances[0] / np.sum(1.0 / variances)  # all strides of the left one have it
        together = found(mud_estimate.k_p)
        assert together.value == pytest.approx(K_P * exp(np.average([0.0, log(1.02)], weights=1.0 / variances)))
        assert together.repeatability / together.value == pytest.approx(sqrt(1.0 / np.sum(1.0 / variances)))
        assert together.std_error / together.value == pytest.approx(sqrt(1.0 / np.sum(1.0 / variances) + common))
        assert together.strides == 2

    def test_a_difference_beyond_the_errors_stays_in_the_error(self) -> None:
        apart, alike = (found(self.estimated(reported(K_P), reported(k)).k_p) for k in (1.18 * K_P, K_P))
        assert apart.std_error / apart.value == pytest.approx(log(1.18) / 2.0, rel=0.01)
        assert alike.std_error / alike.value == pytest.approx(REPEATABILITY / 4.0)

    def test_flippers_in_two_muds_give_no_common_estimate(self) -> None:
        spread = CHANGE * sqrt(2.0 * REPEATABILITY**2 / 8.0 + 2.0 * FLIPPER_SPREAD**2)
        near, far = (self.estimated(reported(K_P), reported(K_P * exp(spread + off))) for off in (-0.001, 0.001))
        assert near.k_p is not None
        assert far.k_p is None
        assert found(far.left.k_p).value == pytest.approx(K_P)
        assert found(far.right.k_p).value == pytest.approx(K_P * exp(spread + 0.001))

    def test_they_are_compared_at_one_depth(self) -> None:
        deeper = reported(K_P * (0.05 / 0.03) ** STROKE_LAW.exponent)
        together = found(self.estimated(reported(K_P), deeper, depth_m=0.05).k_p)
        assert together.depth_m == pytest.approx(sqrt(0.03 * 0.05))
        assert together.at(0.03)[0] == pytest.approx(K_P)
        alike = found(self.estimated(reported(K_P), reported(K_P)).k_p)
        assert (alike.exponent, alike.exponent_std_error) == pytest.approx(STROKE_LAW)  # known no better by two

    @pytest.mark.parametrize(
        ("one", "other", "value", "at_least"),
        [
            (bound(K_P), bound(2.0 * K_P), K_P, True),  # the lower bound
            (reported(K_P), bound(1.1 * K_P), K_P, False),
            (reported(K_P), bound(2.0 * K_P), nan, False),  # a bound well above the value is another mud
            (reported(K_P), NOT_REPORTED, K_P, False),  # one flipper alone
        ],
    )
    def test_a_value_stands_for_both_unless_the_others_bound_is_above_it(
        self, one: Estimate, other: Estimate, value: float, at_least: bool
    ) -> None:
        for k_p in (self.estimated(one, other).k_p, self.estimated(other, one).k_p):
            if isnan(value):
                assert k_p is None
            else:
                assert found(k_p).value == pytest.approx(value)
                assert found(k_p).at_least is at_least


class TestLowerBounds:
    @pytest.mark.parametrize("valid", [True, False])
    def test_with_nothing_else_known_a_bound_is_trusted_as_a_bound(self, valid: bool) -> None:
        k_s = found(after(stride(k_s=bound(K_S, relative=0.06)._replace(valid=valid), depth_m=0.04)).k_s)
        assert is_bound(k_s, K_S)
        assert k_s.depth_m == pytest.approx(0.04)
        assert k_s.std_error / k_s.value == pytest.approx(0.1)
        assert (k_s.exponent, k_s.exponent_std_error) == pytest.approx(SHEAR_LAW)

    def test_a_bound_does_not_change_a_remembered_value(self) -> None:
        known = [K_S_KNOWN] * 4
        for factor in (0.1, 0.9, 1.1):
            mud_estimate = after(*known, stride(k_s=bound(factor * K_S)))
            assert mud_estimate.k_s == after(*known).k_s
            assert not mud_estimate.boundary

    def test_a_bound_well_above_the_remembered_value_is_a_stronger_mud_until_a_value_comes(self) -> None:
        knowledge = MudKnowledge()
        walked(knowledge, *[TWO_KNOWN] * 8)
        first = walked(knowledge, stride(k_s=bound(1.5 * K_S)))
        assert first.boundary and first.k_p is None and is_bound(first.k_s, 1.5 * K_S)
        for estimate in (bound(1.5 * K_S), NOT_REPORTED):
            assert is_bound(walked(knowledge, stride(reported(K_P), estimate)).k_s, 1.5 * K_S)
        assert is_value(walked(knowledge, stride(reported(K_P), reported(1.8 * K_S))).k_s, 1.8 * K_S)

    def test_a_wild_bound_is_taken_back_by_a_value_that_fits_the_memory(self) -> None:
        k_s = after(*[K_S_KNOWN] * 8, stride(k_s=bound(3.0 * K_S)), K_S_KNOWN).k_s
        assert is_value(k_s, K_S) and found(k_s).strides == 9

    def test_the_greatest_bound_that_a_second_stride_confirms_counts(self) -> None:
        def kept(*factors: float) -> Coefficient | None:
            return after(*(stride(k_s=bound(factor * K_S)) for factor in factors)).k_s

        assert is_bound(kept(0.5), 0.5 * K_S)
        assert is_bound(kept(3.0, 0.5), 0.5 * K_S)  # a wild bound counts for one stride
        assert is_bound(kept(0.5, 1.0, 0.7), 0.7 * K_S)
        assert is_bound(kept(1.0, 1.0, *[0.7] * (REMEMBERED_STRIDES - 2)), K_S)
        assert is_bound(kept(1.0, 1.0, *[0.7] * (REMEMBERED_STRIDES - 1)), 0.7 * K_S)
        assert found(kept(1.0, 0.9, 0.8)).strides == 3

    def test_bounds_of_two_depths_are_compared_by_the_depth_law(self) -> None:
        shallow, deep = stride(k_s=bound(K_S)), stride(k_s=bound(0.9 * K_S), depth_m=0.05)
        assert found(after(shallow, shallow, deep, deep).k_s).depth_m == pytest.approx(0.05)
        assert found(after(deep, shallow, shallow).k_s).depth_m == pytest.approx(0.03)

    def test_a_boundary_that_only_two_strides_give_leaves_the_bound_of_the_last_one(self) -> None:
        knowledge = MudKnowledge()
        walked(knowledge, *[stride(reported(K_P), bound(K_S))] * 8, stride(PAIR_K_P, bound(0.6 * K_S)))
        mud_estimate = walked(knowledge, stride(PAIR_K_P))
        assert mud_estimate.boundary
        assert is_bound(mud_estimate.k_s, 0.6 * K_S)
        valued = [TWO_KNOWN] * 8
        assert is_bound(after(*valued, stride(PAIR_K_P, bound(0.6 * K_S)), stride(PAIR_K_P)).k_s, 0.6 * K_S)

    def test_bounds_from_before_a_value_are_not_remembered_after_a_boundary(self) -> None:
        known = [stride(reported(K_P), bound(0.9 * K_S)), *[TWO_KNOWN] * 7]
        assert after(*known, stride(PAIR_K_P), stride(PAIR_K_P)).k_s is None

    def test_a_bound_is_forgotten_where_k_p_gives_another_mud(self) -> None:
        knowledge = MudKnowledge()
        walked(knowledge, *[stride(reported(K_P), bound(K_S))] * 4)
        assert walked(knowledge, stride(reported(0.4 * K_P))).k_s is None
        assert found(walked(knowledge, stride(reported(0.4 * K_P), bound(0.3 * K_S))).k_s).value == pytest.approx(
            0.3 * K_S
        )


class TestDepthLaw:
    def test_before_any_stride_in_another_depth_the_law_is_the_prior_whose_error_includes_the_clay_models_third(
        self,
    ) -> None:
        mud_estimate = after(*[ALL_KNOWN] * 8)
        for k, law in zip(mud_estimate[:3], (STROKE_LAW, SHEAR_LAW, STROKE_LAW), strict=True):
            assert (found(k).exponent, found(k).exponent_std_error) == pytest.approx(law)
        k_s, std_error = found(mud_estimate.k_s).at(0.05)
        assert abs(K_S * 2.0 / 3.0 - k_s) < 2.0 * std_error

    @pytest.mark.parametrize("exponent", [-0.8, -0.2])
    def test_the_exponent_is_learned_from_strides_of_several_depths(self, exponent: float) -> None:
        learned = []
        for seed in range(20):
            mud = Mud(seed, exponent, depths_m=(0.025, 0.03, 0.05))
            for _ in range(40):
                mud.walk()
            learned.append(found(mud.knowledge.mud_estimate.right.k_s))
        assert np.mean([k.exponent for k in learned]) == pytest.approx(exponent, abs=0.06)
        assert all(SURE_EXPONENT * 0.999 <= k.exponent_std_error < 0.13 for k in learned)

    def test_a_learned_law_predicts_another_depth_within_its_uncertainty(self) -> None:
        within = 0
        for seed in range(100):
            mud = Mud(seed, -0.8, depths_m=(0.025, 0.03, 0.035))
            for _ in range(10):
                mud.walk()
            k, std_error = found(mud.knowledge.mud_estimate.left.k_p).at(0.05)
            within += abs(K_P * (0.05 / 0.03) ** -0.8 - k) <= 2.0 * std_error
        assert within >= 0.93 * 100

    def test_another_depth_is_no_other_mud(self) -> None:
        for exponent in (-0.9, 0.0):
            deeper = stride(reported(K_P * (0.05 / 0.03) ** exponent), depth_m=0.05)
            assert not after(*[K_P_KNOWN] * 8, deeper).boundary

    def test_at_a_boundary_the_exponent_stays_with_at_least_half_its_first_uncertainty(self) -> None:
        mud = Mud(3, -0.9, depths_m=(0.02, 0.03, 0.06))
        for _ in range(40):
            mud.walk()
        before = found(mud.knowledge.mud_estimate.left.k_s)
        mud.scale_s = mud.scale_p = 0.25
        mud.walk()
        after_change = found(mud.knowledge.mud_estimate.left.k_s)
        assert after_change.strides == 1
        assert after_change.exponent == pytest.approx(before.exponent, abs=0.02)
        assert before.exponent_std_error < 0.13
        assert after_change.exponent_std_error == pytest.approx(SHEAR_LAW.std_error / 2.0)


NONSENSE = [
    Estimate(value, std_error, 50, True, repeatability=repeatability)
    for value, std_error, repeatability in [
        (nan, 0.1e6, 0.1e6),
        (0.99e2, 0.0, 0.0),
        (1.01e10, 0.0, 0.0),
        (1e6, 0.1e6, nan),
        (1e6, 0.1e6, -1.0),
        (1e6, 0.1e6, 1.01e6),
        (1e6, nan, 0.1e6),
        (1e6, -1.0, 0.1e6),
        (1e6, inf, 0.1e6),
    ]
]
numbers = st.floats() | st.floats(1e4, 1e8)
anything = st.builds(Estimate, numbers, numbers, st.integers(), st.booleans(), st.just(""), st.booleans())
sound = st.builds(reported, st.floats(1e4, 1e8), st.floats(0.0, 0.6)) | st.just(NOT_REPORTED)
estimates = anything | sound
depths = st.floats() | st.floats(0.005, 0.06)
any_stride = st.builds(stride, estimates, estimates, estimates, depths, st.sampled_from(["left", "right", "tail", ""]))


class TestBadInput:
    @pytest.mark.parametrize("nonsense", NONSENSE)
    @pytest.mark.parametrize("at_least", [False, True])
    def test_nonsense_that_is_called_valid_changes_nothing(self, nonsense: Estimate, at_least: bool) -> None:
        known = [ALL_KNOWN] * 3
        bad = nonsense._replace(at_least=at_least)
        assert after(*known, stride(bad, bad, bad)) == after(*known)
        assert after(stride(bad, bad, bad)) == NOTHING_KNOWN

    @pytest.mark.parametrize("depth_m", [nan, -0.01, 0.004, 0.51])
    def test_an_impossible_depth_changes_nothing(self, depth_m: float) -> None:
        known = [ALL_KNOWN] * 3
        assert after(*known, stride(reported(K_P), reported(K_S), bound(9 * K_E), depth_m)) == after(*known)

    def test_an_estimate_that_is_not_valid_is_no_reading(self) -> None:
        assert reading_of(reported(K_P)._replace(valid=False), 0.03) is None
        assert reading_of(reported(K_P), 0.03) is not None

    @given(st.lists(st.lists(any_stride, max_size=3), max_size=12))
    def test_for_any_input_every_estimate_is_a_finite_positive_number_or_none(
        self, walk: list[list[StrideEstimate]]
    ) -> None:
        knowledge = MudKnowledge()
        for strides in walk:
            mud_estimate = knowledge.update(strides)
            for k in (*mud_estimate[:3], *mud_estimate.left, *mud_estimate.right):
                assert k is None or all(isfinite(number) for number in k)
                assert k is None or (k.value > 0.0 and k.std_error > 0.0 and k.strides > 0)

    @given(st.lists(any_stride, max_size=12))
    def test_after_any_history_two_strides_in_a_mud_give_its_coefficients(self, walk: list[StrideEstimate]) -> None:
        knowledge = MudKnowledge()
        walked(knowledge, *walk)
        sure = [ALL_KNOWN] * 2
        for k, truth in zip(walked(knowledge, *sure).left, (K_P, K_S, K_E), strict=True):
            assert abs(log(found(k).at(0.03)[0] / truth)) < 0.35

    def test_no_strides_and_flippers_that_do_not_exist_teach_nothing(self) -> None:
        knowledge = MudKnowledge()
        before = walked(knowledge, K_P_KNOWN)
        assert knowledge.update([]) == knowledge.update([stride(reported(9 * K_P), flipper="tail")]) == before
        assert walked(knowledge, stride(reported(4 * K_P))).boundary
        assert not knowledge.update([]).boundary  # it is reported once
