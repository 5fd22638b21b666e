"""Whether a reading is that of the weight that was asked for: the wrong one, none, or one whose lever has moved.

What the motor holds is turned into grams by what this joint's readings have shown so far, or by the configured constant
as long as they show nothing, which may be wrong by a fifth. The paper's weights differ by a third at least, so one that
was taken for another is told apart, except between the lightest two, which differ by less than friction may hide.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, log
from typing import Any, NamedTuple

from experiments.actuator.fit import can_fit, direction_of, line_of, raw_loads, tare_of
from experiments.actuator.plan import Plan, Step

TELLING_NM = 0.05  # what lighter loads say of a constant is friction
FRICTION_NM = 0.012  # by which any reading may miss its weight
FITTED_FRACTION, CONFIGURED_FRACTION = (
    0.1,
    0.25,
)  # of a weight, besides, by a constant of this joint or by the configured one
FAR_BETTER = 3.0  # times nearer, in logarithms, is another weight of the list
SLIPPED_FRACTION = 0.3  # of the weight, at most, where it has slipped off


class Uncertainty(NamedTuple):
    message: str
    other_g: float | None = None  # the weight that it fits far better


def uncertainty_of(
    plan: Plan, entries: Mapping[str, Any], step: Step, current_a: float, configured_nm_a: float
) -> Uncertainty | None:
    """None where the reading is as it should be, or nothing is known to judge it by."""
    tare_a = tare_of(entries, step.trial)
    if tare_a is None:
        return None
    telling = [load for load in raw_loads(plan, entries) if load.torque_nm >= TELLING_NM and not load.doubtful]
    sign = -direction_of(telling) if telling else (1 if current_a >= tare_a else -1)
    fitted = can_fit(telling)
    constant_nm_a = abs(line_of(telling).constant_nm_a) if fitted else configured_nm_a
    held_g = 1000.0 * sign * (current_a - tare_a) * constant_nm_a / (plan.gravity_m_s2 * plan.lever_m)
    fraction = FITTED_FRACTION if fitted else CONFIGURED_FRACTION
    if plan.torque_nm(abs(held_g - step.weight_g)) <= FRICTION_NM + fraction * plan.torque_nm(step.weight_g):
        return None
    return _uncertainty(plan, step.weight_g, held_g)


def _uncertainty(plan: Plan, asked_g: float, held_g: float) -> Uncertainty:
    reads = f"the motor holds {held_g:.0f} g"
    if not asked_g:
        return Uncertainty(
            f"{reads} although the arm should be empty: is something still hanging, or does it touch anything?"
        )
    if held_g < SLIPPED_FRACTION * asked_g:
        return Uncertainty(f"{reads}, not {asked_g:g} g: did it slip off?")
    nearest_g = min(plan.weights_g, key=lambda weight_g: _distance(held_g, weight_g))
    if nearest_g != asked_g and FAR_BETTER * _distance(held_g, nearest_g) < _distance(held_g, asked_g):
        return Uncertainty(f"{reads}: that is {nearest_g:g} g rather than {asked_g:g} g", nearest_g)
    return Uncertainty(f"{reads}, not {asked_g:g} g: does it hang at {100.0 * plan.lever_m:g} cm, and touch nothing?")


def _distance(held_g: float, weight_g: float) -> float:
    return abs(log(held_g / weight_g)) if held_g > 0.0 else inf
