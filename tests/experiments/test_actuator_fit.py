"""What readings say of a motor, against numpy's and statsmodels' line through the same points."""

from __future__ import annotations

from math import cos, isnan, nan
from random import Random
from typing import Any

import numpy as np
import pytest
import statsmodels.api as sm

from experiments.actuator_fit import fit_joint, loads_of, repeatability
from experiments.actuator_plan import Plan, Step, steps_of

PLAN = Plan(("right_sweep",), trials=4)
TRUE_NM_A, TARE_A, FRICTION_A = 0.0719, 0.65, 0.12
Entries = dict[str, dict[str, Any]]


def made_entries(plan: Plan = PLAN, sign: float = 1.0, noise_a: float = 0.02, seed: int = 1) -> Entries:
    random, entries = Random(seed), Entries()
    for step in steps_of(plan):
        angle_rad = random.gauss(0.0, 0.003)
        held_a = plan.torque_nm(step.weight_g) * cos(angle_rad) / TRUE_NM_A + TARE_A
        entries[step.key] = {
            "current_a": sign * held_a + random.gauss(0.0, noise_a),
            "friction_a": FRICTION_A + random.gauss(0.0, 0.01),
            "angle_rad": angle_rad,
        }
    return entries


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_line_is_that_of_an_independent_fit(sign: float) -> None:
    entries = made_entries(sign=sign)
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None and fit.direction == -sign
    x = np.array([load.torque_nm for load in fit.loads])
    y = np.array([load.current_a for load in fit.loads])
    oracle = sm.OLS(y, sm.add_constant(x)).fit()
    assert fit.line.slope_a_nm == pytest.approx(np.polyfit(x, y, 1)[0], rel=1e-9)
    assert (fit.line.intercept_a, fit.line.slope_a_nm) == pytest.approx(tuple(oracle.params), rel=1e-9)
    assert (fit.line.intercept_error, fit.line.slope_error) == pytest.approx(tuple(oracle.bse), rel=1e-9)
    assert fit.line.constant_nm_a == pytest.approx(TRUE_NM_A, rel=0.01)


def test_the_doubt_of_the_constant_is_as_large_as_its_spread() -> None:
    fits = [fit_joint("right_sweep", PLAN, made_entries(seed=seed), 0.083) for seed in range(200)]
    constants = [fit.line.constant_nm_a for fit in fits if fit]
    told = float(np.mean([fit.line.constant_error_nm_a for fit in fits if fit]))
    assert float(np.std(constants)) == pytest.approx(told, rel=0.25)
    assert float(np.mean(constants)) == pytest.approx(TRUE_NM_A, rel=1e-3)


def test_a_wrong_constant_shows_in_the_error_and_the_fitted_one_does_not() -> None:
    fit = fit_joint("right_sweep", PLAN, made_entries(noise_a=0.0), 0.083)
    assert fit is not None
    x = np.array([load.torque_nm for load in fit.loads])
    assert fit.rmse_configured_nm == pytest.approx(
        float(np.sqrt(np.mean((x * (0.083 / TRUE_NM_A - 1)) ** 2))), rel=1e-6
    )
    assert fit.rmse_fitted_nm < 1e-9
    assert fit.offset_nm == pytest.approx(0.0, abs=1e-9)
    assert fit.tare_nm == pytest.approx(TARE_A * TRUE_NM_A, rel=1e-6)


def test_the_tare_of_a_pass_is_the_mean_of_before_and_after() -> None:
    entries = made_entries(noise_a=0.0)
    entries[Step(0, 0.0).key]["current_a"] += 0.2
    first, later = (load for load in loads_of(PLAN, entries) if load.weight_g == 100.0 and load.trial in (1, 2))
    assert later.current_a - first.current_a == pytest.approx(0.1, abs=1e-4)


def test_a_trial_without_any_tare_before_it_is_not_used() -> None:
    entries = made_entries()
    for trial in (0, 1):
        entries[Step(trial, 0.0).key] = {"skipped": "on request"}
    assert {load.trial for load in loads_of(PLAN, entries)} == {2, 3, 4}


def test_repeatability_is_the_mean_relative_deviation_over_the_trials() -> None:
    loads = loads_of(PLAN, made_entries())
    table = np.array([[load.current_a for load in loads if load.weight_g == w] for w in PLAN.weights_g])
    assert repeatability(loads) == pytest.approx(float(np.mean(np.std(table, axis=1, ddof=1) / np.mean(table, axis=1))))
    assert isnan(repeatability(loads[:3]))


def test_friction_comes_with_its_standard_error() -> None:
    entries = made_entries()
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None
    light = [entries[s.key]["friction_a"] for s in steps_of(PLAN) if PLAN.torque_nm(s.weight_g) <= 0.15]
    assert fit.friction_nm == pytest.approx(np.mean(light) * fit.line.constant_nm_a)
    error = np.std(light, ddof=1) / np.sqrt(len(light)) * fit.line.constant_nm_a
    assert fit.friction_error_nm == pytest.approx(error)


def test_what_was_kept_with_a_doubt_is_not_fitted() -> None:
    entries = made_entries(noise_a=0.0)
    entries[Step(1, 800.0).key] |= {"current_a": 3.0, "doubt": "the motor holds 180 g"}
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None and fit.line.readings == 31
    assert fit.line.constant_nm_a == pytest.approx(TRUE_NM_A, rel=1e-6)


def test_one_weight_makes_no_line() -> None:
    entries = made_entries()
    kept = {key: entry for key, entry in entries.items() if key.endswith((", 0 g", ", 100 g"))}
    assert fit_joint("right_sweep", PLAN, kept, 0.083) is None
    assert fit_joint("right_sweep", PLAN, {}, nan) is None
