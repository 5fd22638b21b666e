"""Detects a reading of another weight than the one that was asked for: a wrong one, none, or one with a moved lever.

The held torque is converted to grams by this joint's readings so far, or by the configured constant as long as there
are none, which may be wrong by a fifth. The paper's weights differ by a third at least, so that a wrong one is found,
except between the lightest two, which differ by less than friction.
"""

from collections.abc import Mapping
from math import inf, log
from typing import Any

from experiments.actuator.fit import can_fit, direction_of, fit_line, loads_of, tare_of
from experiments.actuator.plan import WeighingPlan, WeighingStep

CONSTANT_NM = 0.05  # a lighter load shows friction more than the constant
FRICTION_NM = 0.012  # error of any reading
FITTED_FRACTION, CONFIGURED_FRACTION = 0.1, 0.25  # of a weight, besides, by this joint's constant or the configured one
FAR_BETTER = 3.0  # ratio of distances, in logarithms, to the nearest weight of the list
SLIPPED_FRACTION = 0.3  # of the weight, at most, where it has slipped off


Mismatch = tuple[str, float | None]  # a message, and the weight that matches far better


def find_mismatch(
    plan: WeighingPlan, entries: Mapping[str, Any], step: WeighingStep, current_a: float, configured_nm_a: float
) -> Mismatch | None:
    """Return nothing where the reading matches, or nothing is known to compare it with."""
    tare_a = tare_of(entries, step.trial)
    if tare_a is None:
        return None
    loads = loads_of(plan, entries)
    heavy = loads[loads.torque_nm >= CONSTANT_NM]
    sign = -direction_of(heavy) if len(heavy) else (1 if current_a >= tare_a else -1)
    fitted = can_fit(heavy)
    if not (fitted or plan.trusts_constant):
        return None
    constant_nm_a = abs(fit_line(heavy).constant_nm_a) if fitted else configured_nm_a
    held_g = 1000.0 * sign * (current_a - tare_a) * constant_nm_a / (plan.gravity_m_s2 * plan.lever_m)
    fraction = FITTED_FRACTION if fitted else CONFIGURED_FRACTION
    if plan.torque_nm(abs(held_g - step.weight_g)) <= FRICTION_NM + fraction * plan.torque_nm(step.weight_g):
        return None
    return _describe(plan, step.weight_g, held_g)


def _describe(plan: WeighingPlan, asked_g: float, held_g: float) -> Mismatch:
    reads = f"the motor holds {held_g:.0f} g"
    if not asked_g:
        return f"{reads} although the arm should be empty: remove what hangs on it or touches it", None
    if held_g < SLIPPED_FRACTION * asked_g:
        return f"{reads}, not {asked_g:g} g: did it slip off?", None
    nearest_g = min(plan.weights_g, key=lambda weight_g: _distance(held_g, weight_g))
    if nearest_g != asked_g and FAR_BETTER * _distance(held_g, nearest_g) < _distance(held_g, asked_g):
        return f"{reads}: that is {nearest_g:g} g rather than {asked_g:g} g", nearest_g
    lever_cm = 100.0 * plan.lever_m
    return f"{reads}, not {asked_g:g} g: check that it hangs at {lever_cm:g} cm and touches nothing", None


def _distance(held_g: float, weight_g: float) -> float:
    return abs(log(held_g / weight_g)) if held_g > 0.0 else inf
