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
every trial is evaluated by the constant of the other trials. Repeatability is the standard deviation over the trials of
one weight, relative to its mean, averaged over the weights.
"""

from collections.abc import Callable, Mapping, Sequence
from math import cos, fsum, hypot, nan, sqrt
from statistics import fmean, stdev
from typing import Any, NamedTuple

import numpy as np

from estimation.strokes.origin_fit import student_factor
from experiments.actuator.friction import Friction, Loop, friction_of
from experiments.actuator.plan import Plan, Step, steps_of

PAPER_RMSE_NM = {"adduction": 0.0134, "sweep": 0.0127}
PAPER_REPEATABILITY = 0.032
PAPER_CONSTANT_NM_A = 0.083
LIGHT_NM = 0.15  # a lighter load shows friction more than the constant
FEWEST = 3  # readings of a line
Entry = Mapping[str, Any]


class Line(NamedTuple):
    """I = slope τ + intercept."""

    slope_a_nm: float
    intercept_a: float
    slope_error: float
    intercept_error: float
    readings: int

    @property
    def constant_nm_a(self) -> float:
        return 1.0 / self.slope_a_nm

    @property
    def constant_error_nm_a(self) -> float:
        """The standard error from the scatter alone."""
        return self.slope_error / self.slope_a_nm**2


def fit_line(x: Sequence[float], y: Sequence[float]) -> Line:
    """Needs FEWEST points with at least two values of x."""
    columns = np.column_stack([x, np.ones(len(x))])
    inverse = np.linalg.pinv(columns)
    slope, intercept = (inverse @ y).tolist()
    leverages = np.sum(columns.T * inverse, axis=0)
    left_out = (y - columns @ (slope, intercept)) / (1.0 - leverages)  # residuals from the line of the other points
    errors = student_factor(len(x) - 2) * np.sqrt(np.sum((inverse * left_out) ** 2, axis=1))
    slope_error, intercept_error = errors.tolist()
    return Line(
        slope_a_nm=slope,
        intercept_a=intercept,
        slope_error=slope_error,
        intercept_error=intercept_error,
        readings=len(x),
    )


class Load(NamedTuple):
    """One weight in one trial."""

    trial: int
    weight_g: float
    torque_nm: float  # of the weight at the measured angle
    current_a: float  # without the tare
    rest_friction_a: float
    doubtful: bool  # the operator kept it although it did not fit


class JointFit(NamedTuple):
    joint: str
    loads: tuple[Load, ...]
    line: Line
    torque_error: float  # relative, of all torques alike
    configured_nm_a: float
    direction: int  # of the weights' pull: -1 as on a level arm
    rmse_configured_nm: float
    rmse_fitted_nm: float  # each trial with the constant of the others
    repeatability: float
    loops: tuple[Loop, ...]
    rest_friction_a: float  # of the empty arm
    tares_a: tuple[float, ...]  # currents of the empty arm

    @property
    def friction(self) -> Friction:
        return friction_of(self.loops)

    @property
    def constant_nm_a(self) -> float:
        return self.line.constant_nm_a

    @property
    def constant_error_nm_a(self) -> float:
        return hypot(self.line.constant_error_nm_a, self.torque_error * self.constant_nm_a)

    @property
    def offset_nm(self) -> float:
        return self.line.intercept_a * self.constant_nm_a

    @property
    def offset_error_nm(self) -> float:
        tare_error_a = student_factor(len(self.tares_a) - 1) * self._tare_spread_a / sqrt(len(self.tares_a))
        difference_a = fmean(load.rest_friction_a for load in self.loads) - self.rest_friction_a
        return hypot(self.line.intercept_error, tare_error_a, difference_a / sqrt(3.0)) * self.constant_nm_a

    @property
    def friction_nm(self) -> tuple[float, float]:
        """Dry friction and its standard error."""
        return self._in_nm(self.friction.dry_a, self.friction.dry_error_a)

    @property
    def viscous_nm_s(self) -> tuple[float, float]:
        return self._in_nm(self.friction.viscous_a_s, self.friction.viscous_error_a_s)

    def _in_nm(self, current_a: float, error_a: float) -> tuple[float, float]:
        constant_nm_a, constant_error_nm_a = self.constant_nm_a, self.constant_error_nm_a
        return constant_nm_a * current_a, hypot(constant_nm_a * error_a, constant_error_nm_a * current_a)

    @property
    def tare_nm(self) -> float:
        return fmean(self.tares_a) * self.constant_nm_a

    @property
    def tare_spread_nm(self) -> float:
        return self._tare_spread_a * self.constant_nm_a

    @property
    def _tare_spread_a(self) -> float:
        return stdev(self.tares_a) if len(self.tares_a) > 1 else nan

    def fitted_nm(self, load: Load) -> float:
        """Return the torque by the constant of the other trials."""
        return load.current_a * self.constant_without(load.trial)

    def constant_without(self, trial: int) -> float:
        others = [load for load in self.loads if load.trial != trial]
        return line_of(others).constant_nm_a if can_fit(others) else self.line.constant_nm_a


def loads_of(plan: Plan, entries: Mapping[str, Entry]) -> list[Load]:
    """Return all weights whose trial has a tare, with a positive current where the motor holds the weight."""
    raw = raw_loads(plan, entries)
    sign = -direction_of(raw)
    return [load._replace(current_a=sign * load.current_a) for load in raw]


def raw_loads(plan: Plan, entries: Mapping[str, Entry]) -> list[Load]:
    """Return the loads with the joint's own sign of the current."""
    found = []
    for step in steps_of(plan):
        entry, tare_a = entries.get(step.key), tare_of(entries, step.trial)
        if step.weight_g and entry and "current_a" in entry and tare_a is not None:
            torque_nm = plan.torque_nm(step.weight_g) * cos(entry["angle_rad"])
            current_a, doubtful = entry["current_a"] - tare_a, bool(entry.get("doubt"))
            found.append(
                Load(
                    trial=step.trial,
                    weight_g=step.weight_g,
                    torque_nm=torque_nm,
                    current_a=current_a,
                    rest_friction_a=entry["rest_friction_a"],
                    doubtful=doubtful,
                )
            )
    return found


def tare_of(entries: Mapping[str, Entry], trial: int) -> float | None:
    """Return the current of the empty arm: the mean of before and after, or the nearest one."""
    neighbours = [current_a for number in (trial - 1, trial) if (current_a := _tare_a(entries, number)) is not None]
    if neighbours:
        return fmean(neighbours)
    earlier = (_tare_a(entries, number) for number in range(trial - 2, -1, -1))
    return next((current_a for current_a in earlier if current_a is not None), None)


def _tare_a(entries: Mapping[str, Entry], trial: int) -> float | None:
    """Return nothing where the empty arm was not read, or something may have hung on it."""
    entry = entries.get(Step(trial, 0.0).key, {})
    return None if entry.get("doubt") else entry.get("current_a")


def direction_of(loads: Sequence[Load]) -> int:
    """Return -1 where weights pull the joint to negative angles, so that the motor's current is positive."""
    return -1 if fsum(load.torque_nm * load.current_a for load in loads) >= 0.0 else 1


def current_per_nm(plan: Plan, entries: Mapping[str, Entry]) -> float | None:
    """Return the mean over the heavier weights so far, or nothing."""
    loads = [load for load in raw_loads(plan, entries) if load.torque_nm >= LIGHT_NM and not load.doubtful]
    total_nm = fsum(load.torque_nm for load in loads)
    return abs(fsum(load.current_a for load in loads)) / total_nm if loads else None


def can_fit(loads: Sequence[Load]) -> bool:
    return len(loads) >= FEWEST and len({load.weight_g for load in loads}) > 1


def line_of(loads: Sequence[Load]) -> Line:
    """Fit current over torque. Needs what `can_fit` checks."""
    return fit_line([load.torque_nm for load in loads], [load.current_a for load in loads])


def fit_joint(joint: str, plan: Plan, entries: Mapping[str, Entry], configured_nm_a: float) -> JointFit | None:
    """Return nothing where the readings do not suffice for a line."""
    loads = [load for load in loads_of(plan, entries) if not load.doubtful]
    if not can_fit(loads):
        return None
    tares = (step for step in steps_of(plan) if not step.weight_g)
    empty = [entries[step.key] for step in tares if _tare_a(entries, step.trial) is not None]  # at least one
    fit = JointFit(
        joint=joint,
        loads=tuple(loads),
        line=line_of(loads),
        torque_error=plan.torque_error,
        configured_nm_a=configured_nm_a,
        direction=direction_of(raw_loads(plan, entries)),
        rmse_configured_nm=_rmse(loads, lambda load: configured_nm_a * load.current_a),
        rmse_fitted_nm=nan,
        repeatability=repeatability(loads),
        loops=tuple(Loop(**loop) for entry in empty for loop in entry.get("loops", ())),
        rest_friction_a=fmean(entry["rest_friction_a"] for entry in empty),
        tares_a=tuple(entry["current_a"] for entry in empty),
    )
    constants = {trial: fit.constant_without(trial) for trial in {load.trial for load in loads}}
    return fit._replace(rmse_fitted_nm=_rmse(loads, lambda load: constants[load.trial] * load.current_a))


def _rmse(loads: Sequence[Load], sensed_nm: Callable[[Load], float]) -> float:
    return sqrt(fmean((sensed_nm(load) - load.torque_nm) ** 2 for load in loads))


def repeatability(loads: Sequence[Load]) -> float:
    """Return NaN where no weight was read twice. The constant cancels."""
    by_weight: dict[float, list[float]] = {}
    for load in loads:
        by_weight.setdefault(load.weight_g, []).append(load.current_a)
    fractions = [stdev(currents) / abs(fmean(currents)) for currents in by_weight.values() if len(currents) > 1]
    return fmean(fractions) if fractions else nan


def paper_rmse_nm(joint: str) -> float:
    return PAPER_RMSE_NM[joint.split("_")[1]]
