"""A reading of a weight other than the requested one is detected."""

from __future__ import annotations

import pytest

from experiments.actuator.mismatch import find_mismatch
from experiments.actuator.plan import PAPER_WEIGHTS_G, Plan, Step
from tests.experiments.actuator.test_fit import TARE_A, TRUE_NM_A, Entries, make_entries

PLAN = Plan(("right_sweep",), trials=2)
CONFIGURED_NM_A = 0.083


def current_a(grams: float, sign: float = 1.0) -> float:
    return sign * (PLAN.torque_nm(grams) / TRUE_NM_A + TARE_A)


def before(step: Step, sign: float = 1.0) -> Entries:
    """Return the entries of earlier steps."""
    entries = make_entries(PLAN, sign)
    keys = list(entries)
    return {key: entries[key] for key in keys[: keys.index(step.key)]}


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("trial", [1, 2])
@pytest.mark.parametrize("weight_g", [*PAPER_WEIGHTS_G[::3], 0.0])
def test_the_weight_that_was_asked_for_matches(weight_g: float, trial: int, sign: float) -> None:
    step = Step(trial, weight_g)
    assert find_mismatch(PLAN, before(step, sign), step, current_a(weight_g, sign), CONFIGURED_NM_A) is None


@pytest.mark.parametrize("trial", [1, 2])
@pytest.mark.parametrize("other_g", PAPER_WEIGHTS_G[::2])
@pytest.mark.parametrize("weight_g", PAPER_WEIGHTS_G[1::2])
def test_another_weight_of_the_list_is_named(weight_g: float, other_g: float, trial: int) -> None:
    if {weight_g, other_g} == {10.0, 20.0}:
        return  # friction may be as large as the difference
    step = Step(trial, weight_g)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(other_g), CONFIGURED_NM_A)
    assert mismatch is not None
    if other_g > 0.4 * weight_g:
        assert mismatch.other_g == other_g and f"that is {other_g:g} g rather than {weight_g:g} g" in mismatch.message


def test_a_weight_at_another_lever_matches_nothing() -> None:
    step = Step(2, 400.0)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(490.0), CONFIGURED_NM_A)
    assert mismatch is not None and mismatch.other_g is None
    assert "g, not 400 g: check that it hangs at 12 cm" in mismatch.message


def test_an_arm_that_is_not_empty_is_reported() -> None:
    step = Step(1, 0.0)
    mismatch = find_mismatch(PLAN, before(step), step, current_a(100.0), CONFIGURED_NM_A)
    assert mismatch is not None and "should be empty" in mismatch.message
