"""Torque constant, offset and friction of one joint's motor from its readings, and the accuracy of its torque.

Every reading is the mean current I of two approaches, less the tare I₀ of its pass (the mean of the empty arm before
and after), and the weight's torque is τ_ext = m g l cos θ at the measured angle. The weights are known better than the
currents, so the line is fitted as

    I - I₀ = s (τ_ext / k + offset / k)          k_t = 1 / slope, its standard error by the delta method

s = ±1 is the direction in which the weights pull. The line is ordinary least squares. A hook that is slightly off its
mark errs in proportion to the weight, so heavy weights scatter more: the standard errors are MacKinnon and White's
(1985, HC3), which take each residual as the scatter of its own weight, times Student's factor, so that two of them
cover 95 % however few the readings are. Errors that are alike in all readings do not show in the scatter and are added
in squares:

    k_t         the tolerances of lever and weights
    offset      the tare's own scatter; and friction at rest, which cancels where it is equal from both sides or with
                and without a weight: the difference may have either sign
    friction    is a current, and takes the error of k_t with it

RMSE and repeatability are the paper's. Its τ_sense is k_t I with the configured constant, and its RMSE that of all
readings; here the weight of the arm itself is subtracted, which the paper does not mention. With the fitted constant
every trial is evaluated by the constant of the other trials, a single one by its own. Repeatability is the standard
deviation over the trials of one weight, relative to its mean, averaged over the weights.
"""

from collections.abc import Mapping, Sequence
from math import cos, fsum, hypot, nan, sqrt
from statistics import fmean, stdev
from typing import Any, NamedTuple

import numpy as np
from pandas import DataFrame, Series

from estimation.strokes.origin_fit import student_factor
from experiments.actuator.friction import Loop, friction_of
from experiments.actuator.plan import WeighingPlan, WeighingStep, steps_of
from experiments.study.notebook import Entry
from firmware_host.configuration.configuration import Configuration

PAPER_RMSE_NM = {"adduction": 0.0134, "sweep": 0.0127}
PAPER_REPEATABILITY = 0.032
PAPER_CONSTANT_NM_A = 0.083
LIGHT_NM = 0.15  # a lighter load shows friction more than the constant
FEWEST = 3  # readings of a line
LOAD = ("trial", "weight_g", "torque_nm", "current_a", "rest_friction_a")  # columns; without the tare


class FittedLine(NamedTuple):
    """I = slope τ + intercept."""

    slope_a_nm: float
    intercept_a: float
    slope_error: float
    intercept_error: float

    @property
    def constant_nm_a(self) -> float:
        return 1.0 / self.slope_a_nm

    @property
    def constant_error_nm_a(self) -> float:
        """The standard error from the scatter alone."""
        return self.slope_error / self.slope_a_nm**2


def fit_line(loads: DataFrame) -> FittedLine:
    """Fit current over torque. Needs what `can_fit` checks."""
    torques_nm, currents_a = loads.torque_nm.to_numpy(), loads.current_a.to_numpy()
    columns = np.column_stack([torques_nm, np.ones(len(loads))])
    inverse = np.linalg.pinv(columns)
    slope, intercept = (inverse @ currents_a).tolist()
    leverages = np.sum(columns.T * inverse, axis=0)
    left_out = (currents_a - columns @ (slope, intercept)) / (1.0 - leverages)  # from the line of the other points
    errors = student_factor(len(loads) - 2) * np.sqrt(np.sum((inverse * left_out) ** 2, axis=1))
    return FittedLine(slope, intercept, *errors.tolist())


def can_fit(loads: DataFrame) -> bool:
    return len(loads) >= FEWEST and loads.weight_g.nunique() > 1


def loads_of(plan: WeighingPlan, entries: Mapping[str, Entry]) -> DataFrame:
    """Return a row for each weight whose trial has a tare, with the joint's own sign of the current.

    A reading that the operator kept as doubtful is left out.
    """
    rows = []
    for step in steps_of(plan):
        entry, tare_a = entries.get(step.key, {}), tare_of(entries, step.trial)
        if step.weight_g and "current_a" in entry and not entry.get("doubt") and tare_a is not None:
            torque_nm = plan.torque_nm(step.weight_g) * cos(entry["angle_rad"])
            rows.append((step.trial, step.weight_g, torque_nm, entry["current_a"] - tare_a, entry["rest_friction_a"]))
    return DataFrame(rows, columns=LOAD)


def tare_of(entries: Mapping[str, Entry], trial: int) -> float | None:
    """Return the current of the empty arm: the mean of before and after, or the last one before."""
    neighbours = [current_a for number in (trial - 1, trial) if (current_a := _tare_a(entries, number)) is not None]
    if neighbours:
        return fmean(neighbours)
    earlier = (_tare_a(entries, number) for number in range(trial - 2, -1, -1))
    return next((current_a for current_a in earlier if current_a is not None), None)


def _tare_a(entries: Mapping[str, Entry], trial: int) -> float | None:
    """Return nothing where the empty arm was not read, or something may have hung on it."""
    entry = entries.get(WeighingStep(trial, 0.0).key, {})
    return None if entry.get("doubt") else entry.get("current_a")


def direction_of(loads: DataFrame) -> int:
    """Return -1 where weights pull the joint to negative angles, so that the motor's current is positive."""
    return -1 if fsum(loads.torque_nm * loads.current_a) >= 0.0 else 1


def current_per_nm(plan: WeighingPlan, entries: Mapping[str, Entry]) -> float | None:
    """Return the mean over the heavier weights so far, or nothing."""
    loads = loads_of(plan, entries)
    heavy = loads[loads.torque_nm >= LIGHT_NM]
    return None if heavy.empty else abs(fsum(heavy.current_a)) / fsum(heavy.torque_nm)


class JointFit(NamedTuple):
    """The constants of one joint by their keys in JSON, and what they were fitted to."""

    numbers: Mapping[str, Any]  # NaN where unknown
    loads: DataFrame  # LOAD with a positive current, and `fitted_nm` by the constant of the other trials
    loops: Sequence[Loop]


def fit_joints(
    plan: WeighingPlan, readings: Mapping[str, Mapping[str, Entry]], configuration: Configuration
) -> list[JointFit]:
    """Fit every joint whose readings suffice for a line. `readings` are by joint and step."""
    constants_nm_a = {joint: configuration.drive[joint].torque_constant_nm_a for joint in plan.joints}
    fits = (fit_joint(joint, plan, readings[joint], constants_nm_a[joint]) for joint in plan.joints)
    return [fit for fit in fits if fit is not None]


def fit_joint(joint: str, plan: WeighingPlan, entries: Mapping[str, Entry], configured_nm_a: float) -> JointFit | None:
    """Return nothing where the readings do not suffice for a line."""
    loads = loads_of(plan, entries)
    if not can_fit(loads):
        return None
    direction = direction_of(loads)
    loads["current_a"] *= -direction
    line = fit_line(loads)
    constant_nm_a, error_nm_a = line.constant_nm_a, line.constant_error_nm_a
    without = {trial: loads[loads.trial != trial] for trial in loads.trial.unique()}
    constants = {trial: fit_line(others) if can_fit(others) else line for trial, others in without.items()}
    loads["fitted_nm"] = loads.current_a * [constants[trial].constant_nm_a for trial in loads.trial]
    empty = [
        entries[step.key]
        for step in steps_of(plan)
        if not step.weight_g and _tare_a(entries, step.trial) is not None  # at least one is
    ]
    loops = [Loop(**loop) for entry in empty for loop in entry.get("loops", ())]
    numbers: dict[str, Any] = {
        "joint": joint,
        "readings": len(loads),
        "direction": direction,
        "torque_constant_nm_a": constant_nm_a,
        "torque_constant_error_nm_a": hypot(error_nm_a, plan.torque_error * constant_nm_a),
        "torque_constant_scatter_nm_a": error_nm_a,
        "torque_constant_tolerance_nm_a": plan.torque_error * constant_nm_a,
        "configured_nm_a": configured_nm_a,
        "rmse_configured_nm": _rmse_nm(configured_nm_a * loads.current_a, loads),
        "rmse_fitted_nm": _rmse_nm(loads.fitted_nm, loads),
        "paper_rmse_nm": PAPER_RMSE_NM[joint.split("_")[1]],
        "repeatability": repeatability(loads),
    }
    numbers |= _offset(line, loads, empty, numbers["torque_constant_error_nm_a"])
    numbers["lifted_nm"] = abs(constant_nm_a * fmean(loop.held_a for loop in loops)) if loops else nan
    return JointFit(numbers | _friction(loops, constant_nm_a, numbers["torque_constant_error_nm_a"]), loads, loops)


def _rmse_nm(sensed_nm: "Series[float]", loads: DataFrame) -> float:
    return sqrt(fmean((sensed_nm - loads.torque_nm) ** 2))


def repeatability(loads: DataFrame) -> float:
    """Return NaN where no weight was read twice. The constant cancels."""
    repeated = [currents_a for _, currents_a in loads.groupby("weight_g", sort=False).current_a if len(currents_a) > 1]
    return fmean(stdev(currents_a) / abs(fmean(currents_a)) for currents_a in repeated) if repeated else nan


def _offset(line: FittedLine, loads: DataFrame, empty: Sequence[Entry], error_nm_a: float) -> dict[str, float]:
    """Return the offset of the line, and the torque and friction of the empty arm at rest."""
    tares_a, rest_friction_a = [entry["current_a"] for entry in empty], fmean(e["rest_friction_a"] for e in empty)
    spread_a = stdev(tares_a) if len(tares_a) > 1 else nan
    tare_error_a = student_factor(len(tares_a) - 1) * spread_a / sqrt(len(tares_a))
    error_a = hypot(line.intercept_error, tare_error_a, (fmean(loads.rest_friction_a) - rest_friction_a) / sqrt(3.0))
    currents_a = {
        "offset_nm": line.intercept_a,
        "offset_error_nm": error_a,
        "rest_friction_nm": rest_friction_a,
        "tare_nm": fmean(tares_a),
        "tare_spread_nm": spread_a,
    }
    found = {name: current_a * line.constant_nm_a for name, current_a in currents_a.items()}
    return found | {"tare_error_nm": hypot(tare_error_a * line.constant_nm_a, fmean(tares_a) * error_nm_a)}


def _friction(loops: Sequence[Loop], constant_nm_a: float, error_nm_a: float) -> dict[str, float]:
    """Return dry and viscous friction with their standard errors, which contain that of the torque constant."""
    dry_a, dry_error_a, viscous_a_s, viscous_error_a_s = friction_of(loops)
    return {
        "friction_nm": constant_nm_a * dry_a,
        "friction_error_nm": hypot(constant_nm_a * dry_error_a, error_nm_a * dry_a),
        "viscous_nm_s": constant_nm_a * viscous_a_s,
        "viscous_error_nm_s": hypot(constant_nm_a * viscous_error_a_s, error_nm_a * viscous_a_s),
    }
