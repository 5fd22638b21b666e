"""A reading of a weight other than the requested one is detected."""

from dataclasses import replace

import pytest

from experiments.actuator.mismatch import find_mismatch
from experiments.actuator.plan import WeighingPlan, WeighingStep
from tests.experiments.actuator.test_fit import TARE_A, TRUE_NM_A, Entries, make_entries

PLAN = WeighingPlan(("right_sweep",), trials=2)
CONFIGURED_NM_A = 0.083


def current_a(grams: float, sign: float = 1.0) -> float:
    return sign * (PLAN.torque_nm(grams) / TRUE_NM_A + TARE_A)


def before(step: WeighingStep, sign: float = 1.0) -> Entries:
    """Return the entries of earlier steps."""
    entries = make_entries(PLAN, sign)
    keys = list(entries)
    return {key: entries[key] for key in keys[: keys.index(step.key)]}


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("trial", "weight_g"), [(1, 10.0), (1, 800.0), (2, 100.0), (2, 0.0)])
def test_the_weight_that_was_asked_for_matches(trial: int, weight_g: float, sign: float) -> None:
    step = WeighingStep(trial, weight_g)
    assert find_mismatch(PLAN, before(step, sign), step, current_a(weight_g, sign), CONFIGURED_NM_A) is None


@pytest.mark.parametrize(
    ("trial", "asked_g", "hung_g"), [(1, 20.0, 50.0), (1, 400.0, 600.0), (2, 100.0, 50.0), (2, 800.0, 600.0)]
)
def test_another_weight_of_the_list_is_named(trial: int, asked_g: float, hung_g: float) -> None:
    step = WeighingStep(trial, asked_g)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(hung_g), CONFIGURED_NM_A)
    assert mismatch is not None and mismatch[1] == hung_g


def test_a_weight_at_another_lever_matches_nothing() -> None:
    step = WeighingStep(2, 400.0)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(490.0), CONFIGURED_NM_A)
    assert mismatch is not None and mismatch[1] is None and "g, not 400 g: check that it hangs at 12 cm" in mismatch[0]


def test_an_arm_that_is_not_empty_is_reported() -> None:
    step = WeighingStep(1, 0.0)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(100.0), CONFIGURED_NM_A)
    assert mismatch is not None and "should be empty" in mismatch[0]


def test_a_weight_that_slipped_off_is_reported() -> None:
    step = WeighingStep(2, 400.0)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(40.0), CONFIGURED_NM_A)
    assert mismatch is not None and mismatch[1] is None and "not 400 g: did it slip off?" in mismatch[0]


@pytest.mark.parametrize("trusts", [True, False])
def test_a_first_weight_is_compared_with_the_configured_constant_only_where_that_is_trusted(trusts: bool) -> None:
    step = WeighingStep(1, 10.0)
    plan = replace(PLAN, trusts_constant=trusts)
    assert bool(find_mismatch(plan, before(step), step, current_a(400.0), CONFIGURED_NM_A)) is trusts
