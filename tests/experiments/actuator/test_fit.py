"""The fit of a motor agrees with numpy's line through the same points, and its errors cover the truth often enough."""

from dataclasses import replace
from math import cos, isnan
from random import Random
from typing import Any

import numpy as np
import pytest
import statsmodels.api as sm
from pandas import DataFrame
from scipy.stats import t as student_t

from experiments.actuator.fit import fit_joint, fit_line, loads_of, repeatability
from experiments.actuator.plan import PAPER_WEIGHTS_G, WeighingPlan, WeighingStep, steps_of

PLAN = WeighingPlan(("right_sweep",), trials=4)
TRUE_NM_A, TARE_A = 0.0719, 0.65
DRY_A, VISCOUS_A_S, REST_A, LESS_A = 0.18, 0.03, 0.15, 0.02
Entries = dict[str, dict[str, Any]]


def make_entries(
    plan: WeighingPlan = PLAN,
    sign: float = 1.0,
    noise_a: float = 0.02,
    seed: int = 1,
    truth: float = 1.0,
    hidden: float = 0.0,
) -> Entries:
    """Return synthetic readings with a known line and friction.

    `truth` is the ratio of true to assumed torque of the weights. `hidden` is the part of LESS_A, the friction at rest
    that is missing under a weight, by which each weight's current is off.
    """
    random, entries = Random(seed), Entries()
    for step in steps_of(plan):
        angle_rad = random.gauss(0.0, 0.003)
        held_a = truth * plan.torque_nm(step.weight_g) * cos(angle_rad) / TRUE_NM_A + TARE_A
        held_a += hidden * LESS_A if step.weight_g else 0.0
        entries[step.key] = {
            "current_a": sign * held_a + random.gauss(0.0, noise_a),
            "rest_friction_a": REST_A - (LESS_A if step.weight_g else 0.0) + random.gauss(0.0, 0.01),
            "angle_rad": angle_rad,
        }
        if not step.weight_g:
            entries[step.key]["loops"] = [made_loop(random, quick) for quick in (False, False, True, True)]
    return entries


def made_loop(random: Random, quick: bool) -> dict[str, Any]:
    speed_rad_s = 1.33 if quick else 0.19
    spent_a = DRY_A + VISCOUS_A_S * speed_rad_s + random.gauss(0.0, 0.02)
    return {"spent_a": spent_a, "speed_rad_s": speed_rad_s, "quick": quick}


def within_two(reported: list[tuple[float, float]]) -> float:
    """Return the fraction of errors that are within two reported standard errors."""
    return sum(abs(wrong) <= 2.0 * error for wrong, error in reported) / len(reported)


def test_the_errors_contain_scatter_lever_weights_and_friction_at_rest() -> None:
    """Each of 250 benches has a lever and weights drawn uniformly within their tolerances.

    An unknown part of the friction that is missing under a weight shifts each bench's currents, in either direction.
    """
    random, plan = Random(4), replace(PLAN, lever_tolerance_m=0.002, weight_tolerance=0.005)
    known = (
        ("torque_constant_nm_a", "torque_constant_error_nm_a", TRUE_NM_A),
        ("offset_nm", "offset_error_nm", 0.0),
        ("tare_nm", "tare_error_nm", TARE_A * TRUE_NM_A),
        ("friction_nm", "friction_error_nm", DRY_A * TRUE_NM_A),
        ("viscous_nm_s", "viscous_error_nm_s", VISCOUS_A_S * TRUE_NM_A),
    )
    reported: dict[str, list[tuple[float, float]]] = {name: [] for name, _, _ in known}
    for seed in range(250):
        lever = 1.0 + random.uniform(-1.0, 1.0) * plan.lever_tolerance_m / plan.lever_m
        truth = lever * (1.0 + random.uniform(-1.0, 1.0) * plan.weight_tolerance)
        entries = make_entries(plan, seed=seed, truth=truth, hidden=random.uniform(-1.0, 1.0))
        fit = fit_joint("right_sweep", plan, entries, 0.083)
        assert fit is not None
        for name, error, true in known:
            reported[name].append((fit.numbers[name] - true, fit.numbers[error]))
    constant, offset, *others = map(within_two, reported.values())
    assert constant > 0.93 and offset > 0.93
    assert all(0.93 < fraction < 0.98 for fraction in others)


def test_a_wrong_constant_shows_in_the_error_and_the_fitted_one_does_not() -> None:
    fit = fit_joint("right_sweep", PLAN, make_entries(noise_a=0.0), 0.083)
    assert fit is not None
    x = fit.loads.torque_nm
    assert fit.numbers["rmse_configured_nm"] == pytest.approx(
        float(np.sqrt(np.mean((x * (0.083 / TRUE_NM_A - 1)) ** 2))), rel=1e-6
    )
    assert fit.numbers["rmse_fitted_nm"] < 1e-9
    assert fit.numbers["offset_nm"] == pytest.approx(0.0, abs=1e-9)
    assert fit.numbers["tare_nm"] == pytest.approx(TARE_A * TRUE_NM_A, rel=1e-6)


def test_the_tare_of_a_pass_is_the_mean_of_before_and_after() -> None:
    entries = make_entries(noise_a=0.0)
    entries[WeighingStep(0, 0.0).key]["current_a"] += 0.2
    loads = loads_of(PLAN, entries).query("weight_g == 100.0").set_index("trial")
    assert loads.current_a[2] - loads.current_a[1] == pytest.approx(0.1, abs=1e-4)


def test_an_arm_that_may_not_have_been_empty_is_no_tare() -> None:
    entries = make_entries(noise_a=0.0)
    before = loads_of(PLAN, entries)
    entries[WeighingStep(1, 0.0).key] |= {
        "current_a": 3.0,
        "doubt": "the motor holds 100 g although the arm should be empty",
    }
    after = loads_of(PLAN, entries)
    assert list(after.current_a) == pytest.approx(list(before.current_a))


def test_repeatability_is_the_mean_relative_deviation_over_the_trials() -> None:
    loads = loads_of(PLAN, make_entries())
    table = np.array([loads.current_a[loads.weight_g == w] for w in PLAN.weights_g])
    assert repeatability(loads) == pytest.approx(float(np.mean(np.std(table, axis=1, ddof=1) / np.mean(table, axis=1))))
    assert isnan(repeatability(loads[:3]))


def test_a_reading_kept_as_doubtful_is_not_fitted() -> None:
    entries = make_entries(noise_a=0.0)
    entries[WeighingStep(1, 800.0).key] |= {"current_a": 3.0, "doubt": "the motor holds 180 g"}
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None and fit.numbers["readings"] == 31
    assert fit.numbers["torque_constant_nm_a"] == pytest.approx(TRUE_NM_A, rel=1e-6)


# the line


TORQUES_NM = [0.0011772 * weight_g for weight_g in PAPER_WEIGHTS_G]
SLOPE, INTERCEPT = 13.9, 0.02


def make_currents(x: list[float], random: Random) -> list[float]:
    """Return currents with a hook error in proportion to the weight and a constant reading error."""
    return [SLOPE * nm * (1.0 + random.gauss(0.0, 0.003)) + INTERCEPT + random.gauss(0.0, 0.02) for nm in x]


def test_line_and_errors_are_those_of_statsmodels() -> None:
    x = TORQUES_NM * 5
    y = make_currents(x, Random(1))
    line = fit_line(DataFrame({"torque_nm": x, "current_a": y}))
    oracle = sm.OLS(np.array(y), sm.add_constant(np.array(x))).fit(cov_type="HC3")
    assert (line.intercept_a, line.slope_a_nm) == pytest.approx(tuple(oracle.params), rel=1e-9)
    widened = oracle.bse * student_t.ppf(0.975, 38) / 1.96
    assert (line.intercept_error, line.slope_error) == pytest.approx(tuple(widened), rel=2e-3)
