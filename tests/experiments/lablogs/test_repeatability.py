"""Known variations, scatters and separations are recovered from synthetic trials."""

import numpy as np
import pytest
from pandas import Series

from control.records import UNKNOWN, Estimate
from experiments.lablogs.estimates import estimate_rows
from experiments.lablogs.repeatability import (
    coefficient_of_variation,
    first_values,
    later_levels,
    repeatability,
    scatter_between_strokes,
    scatter_between_trials,
    separation,
    walk_scatter,
)
from tests.experiments.lablogs.synthetic_trials import INVALID, k_s_strokes, make_bound, make_stride, make_value

LEVELS = (0.9, 1.0, 1.1)  # of three trials: a variation of exactly 10 %
DECLINE = (1.0, 0.8, 0.7, 0.65, 0.6)  # of the strokes in one hole


def declining_trials(lengths: tuple[int, ...] = (5, 5, 5)) -> list[list[Estimate]]:
    return [[make_value(level * d) for d in DECLINE[:n]] for level, n in zip(LEVELS, lengths, strict=True)]


def scattered_trials(claimed: float) -> list[list[Estimate]]:
    """Return 60 trials of one mud, each with another level of 6 later strokes, with 5 % scatter and a claimed error."""
    random = np.random.default_rng(5)
    first = 1.0 + 0.05 * random.standard_normal(60)
    levels = np.exp(0.2 * random.standard_normal(60))
    later = levels[:, None] * 0.9 ** np.arange(6) * np.exp(0.05 * random.standard_normal((60, 6)))
    return [
        [make_value(one, claimed), *(make_value(k, claimed * k) for k in row)]
        for one, row in zip(first.tolist(), later.tolist(), strict=True)
    ]


def test_the_variation_of_first_strokes_is_the_sample_deviation_over_the_mean() -> None:
    first = first_values(k_s_strokes(declining_trials()))["value"]
    assert coefficient_of_variation(first) == pytest.approx(0.1)
    assert coefficient_of_variation(first[:1]) is None
    trials = [[make_bound(9.0), make_value(1.0)], [INVALID], [], [make_value(2.0)]]
    assert first_values(k_s_strokes(trials))["value"].tolist() == [2.0]  # bounds and invalid strokes are no values


@pytest.mark.parametrize(("lengths", "later"), [((5, 5, 5), DECLINE[1:]), ((5, 3, 4), DECLINE[1:3])])
def test_later_strokes_vary_without_their_decline_over_the_number_that_all_trials_have(
    lengths: tuple[int, int, int], later: tuple[float, ...]
) -> None:
    levels = later_levels(k_s_strokes(declining_trials(lengths)))
    assert coefficient_of_variation(levels) == pytest.approx(0.1)
    assert levels.tolist() == pytest.approx([level * np.prod(later) ** (1.0 / len(later)) for level in LEVELS])


def test_a_missing_later_stroke_does_not_lift_its_trial() -> None:
    trials = declining_trials()
    trials[0][4] = INVALID  # the weakest stroke of its hole
    trials[2][2] = make_bound(0.1)
    assert coefficient_of_variation(later_levels(k_s_strokes(trials))) == pytest.approx(0.1)


def test_trials_without_a_common_stroke_are_not_compared() -> None:
    trials = [[make_value(1.0), make_value(0.8), INVALID], [make_value(1.0), INVALID, make_value(0.6)]]
    assert later_levels(k_s_strokes(trials)).empty
    assert later_levels(k_s_strokes([[make_value(1.0)], [make_value(1.1)]])).empty


@pytest.mark.parametrize(("claimed", "chi"), [(0.05, 1.0), (0.025, 2.0), (0.1, 0.5)])
def test_chi_is_the_true_scatter_over_the_claimed_one(claimed: float, chi: float) -> None:
    trials = k_s_strokes(scattered_trials(claimed))
    between_trials, between_strokes = scatter_between_trials(trials), scatter_between_strokes(trials)
    assert between_trials.chi == pytest.approx(chi, rel=0.2)  # 59 degrees of freedom: 9 % is one standard deviation
    assert between_strokes.chi == pytest.approx(chi, rel=0.1)
    assert between_trials.dof == 59
    assert between_strokes.dof == 60 * 6 - 60 - 6 + 1
    assert repeatability(trials)["chi"] == pytest.approx(chi, rel=0.1)


def test_a_common_decline_is_no_scatter_and_without_repetitions_there_is_none() -> None:
    assert scatter_between_strokes(k_s_strokes(declining_trials())).chi == pytest.approx(0.0, abs=1e-9)
    once = k_s_strokes([[make_value(1.0), make_value(0.8), make_value(0.7)]])
    assert scatter_between_trials(once).chi is scatter_between_strokes(once).chi is None
    assert scatter_between_strokes(k_s_strokes([])).chi is None


def test_separation_is_the_difference_in_pooled_deviations() -> None:
    soft, firm = Series([0.9, 1.0, 1.1]), Series([1.7, 2.0, 2.3])  # deviations 0.1 and 0.3
    pooled = ((0.1**2 + 0.3**2) / 2.0) ** 0.5
    assert separation(firm, soft) == pytest.approx(1.0 / pooled)
    assert separation(soft, firm) == pytest.approx(-1.0 / pooled)
    assert separation(firm, soft[:1]) is None


@pytest.mark.parametrize("claimed", [0.05, 0.02])
def test_strides_of_walks_scatter_about_their_mean_and_fall_with_depth_as_they_were_made(claimed: float) -> None:
    """The strides have a constant force, k ∝ 1/z², and scatter by 5 %."""
    random = np.random.default_rng(6)
    depths_m = random.uniform(0.02, 0.05, 40)
    values = (0.03 / depths_m) ** 2 * np.exp(0.05 * random.standard_normal(40))
    pairs = zip(values.tolist(), depths_m.tolist(), strict=True)
    strides = k_s_strokes([[make_value(k, claimed * k, depth_m) for k, depth_m in pairs]])
    found = walk_scatter("k_s", strides)
    assert found["exponent"] == pytest.approx(-2.0, abs=2.0 * found["exponent_std_error"])
    assert found["claim"] == pytest.approx(claimed)
    assert found["log_sd"] == pytest.approx(float(np.std(np.log(values), ddof=1)), abs=1e-3)
    assert found["chi"] == pytest.approx(float(np.std(np.log(values), ddof=1)) / claimed, rel=1e-2)


def test_a_flipper_that_re_enters_its_hole_is_compared_with_others_that_do() -> None:
    """Mud is 2, and 0.4 in a hole, whose strides are deeper; a step of less than 25 mm leads into it."""
    made = [(2.0, 0.05), (2.1, 0.01), (0.42, 0.05), (1.9, 0.0249), (0.38, 0.0249), (0.41, 0.025), (2.2, UNKNOWN)]
    strides = [
        make_stride(index=index, k_p=make_value(k, 0.1 * k, 0.03 if k > 1.0 else 0.05), step_m=step_m)
        for index, (k, step_m) in enumerate(made)
    ]
    rows = estimate_rows(strides)
    known = rows[rows["coefficient"] == "k_p"]
    assert known["re_entered"].tolist() == [k < 1.0 for k, _ in made]
    found = walk_scatter("k_p", known)
    assert found["re_entered"] == 3 and found["chi"] < 1.0 < walk_scatter("k_p", known.assign(re_entered=False))["chi"]
    assert found["exponent"] is None and found["finding"] == ""
