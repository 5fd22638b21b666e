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
    ("trial", "asked_g", "held_g", "other_g", "named"),
    [
        (1, 20.0, 50.0, 50.0, "50 g rather than 20 g"),
        (1, 400.0, 600.0, 600.0, "600 g rather than 400 g"),
        (2, 100.0, 50.0, 50.0, "50 g rather than 100 g"),
        (2, 800.0, 600.0, 600.0, "600 g rather than 800 g"),
        (2, 400.0, 490.0, None, "not 400 g: check that it hangs at 12 cm"),
        (2, 400.0, 40.0, None, "not 400 g: did it slip off?"),
        (1, 0.0, 100.0, None, "should be empty"),
    ],
)
def test_another_weight_of_the_list_or_another_lever_or_none_or_an_arm_that_is_not_empty_is_named(
    trial: int, asked_g: float, held_g: float, other_g: float | None, named: str
) -> None:
    step = WeighingStep(trial, asked_g)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(held_g), CONFIGURED_NM_A)
    assert mismatch is not None and mismatch[1] == other_g and named in mismatch[0]


@pytest.mark.parametrize("trusts", [True, False])
def test_a_first_weight_is_compared_with_the_configured_constant_only_where_that_is_trusted(trusts: bool) -> None:
    step = WeighingStep(1, 10.0)
    plan = replace(PLAN, trusts_constant=trusts)
    assert bool(find_mismatch(plan, before(step), step, current_a(400.0), CONFIGURED_NM_A)) is trusts
