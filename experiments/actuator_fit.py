"""What the readings of one joint say about its motor: torque constant, offset, friction, and how true its torque is.

Every reading is the mean current I of two approaches, less the tare I₀ of its pass (the mean of the empty arm's before
and after), and the weight's torque is τ_ext = m g l cos θ at the measured angle. The weights are known better than the
currents, so the line is fitted as

    I - I₀ = s (τ_ext / k + offset / k)          k_t = 1 / slope, its standard error by the delta method

by ordinary least squares; s = ±1 is the side to which the weights pull. The paper's τ_sense is k_t I with its constant
of 0.083 N·m/A; what the arm itself weighs is taken off there too. "Sensed" is with the configured constant, "fitted"
with what the other trials gave, without this one: so the error is that of a torque never seen.

Repeatability is the paper's: the standard deviation over the trials of one weight, relative to its mean, averaged over
the weights. Friction is half of what the direction of the approach makes, of readings with at most LIGHT_NM: a heavier
weight swings a little at the end of each step, and the joint then rests somewhere within its friction.

None of these doubts holds the lever's own: a millimetre of 12 cm is 0.8 % of k_t.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import cos, nan, sqrt
from statistics import fmean, stdev
from typing import Any, NamedTuple

from experiments.actuator_plan import Plan, Step, steps_of

LIGHT_NM = 0.15
FEWEST = 3  # readings of a line
Entry = Mapping[str, Any]


class Load(NamedTuple):
    """One weight in one trial."""

    trial: int
    weight_g: float
    torque_nm: float  # of the weight at the measured angle
    current_a: float  # without the tare
    friction_a: float
    doubtful: bool  # kept although it did not fit


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
        return self.slope_error / self.slope_a_nm**2


class JointFit(NamedTuple):
    joint: str
    loads: tuple[Load, ...]
    line: Line
    configured_nm_a: float
    direction: int  # of the weights' pull: -1 as on a level arm
    rmse_configured_nm: float
    rmse_fitted_nm: float  # each trial by the others' constant
    repeatability: float
    friction_nm: float
    friction_error_nm: float
    tare_nm: float  # what the empty arm takes
    tare_spread_nm: float

    @property
    def offset_nm(self) -> float:
        return self.line.intercept_a * self.line.constant_nm_a

    @property
    def offset_error_nm(self) -> float:
        return self.line.intercept_error * self.line.constant_nm_a

    def fitted_nm(self, load: Load) -> float:
        """By the other trials."""
        return load.current_a * self.constant_without(load.trial)

    def constant_without(self, trial: int) -> float:
        others = [load for load in self.loads if load.trial != trial]
        return fit_line(others).constant_nm_a if can_fit(others) else self.line.constant_nm_a


def loads_of(plan: Plan, entries: Mapping[str, Entry]) -> list[Load]:
    """Of all weights whose trial has a tare, positive where the motor holds the weight."""
    raw = raw_loads(plan, entries)
    sign = -direction_of(raw)
    return [load._replace(current_a=sign * load.current_a) for load in raw]


def raw_loads(plan: Plan, entries: Mapping[str, Entry]) -> list[Load]:
    """With the joint's own sign of the current."""
    found = []
    for step in steps_of(plan):
        entry, tare_a = entries.get(step.key), tare_of(entries, step.trial)
        if step.weight_g and entry and "current_a" in entry and tare_a is not None:
            torque_nm = plan.torque_nm(step.weight_g) * cos(entry["angle_rad"])
            current_a, doubtful = entry["current_a"] - tare_a, bool(entry.get("doubt"))
            found.append(Load(step.trial, step.weight_g, torque_nm, current_a, entry["friction_a"], doubtful))
    return found


def tare_of(entries: Mapping[str, Entry], trial: int) -> float | None:
    """The current of the empty arm: the mean of before and after, or the nearest there is."""
    beside = [entries.get(Step(number, 0.0).key) for number in (trial - 1, trial)]
    known = [entry["current_a"] for entry in beside if entry and "current_a" in entry]
    if known:
        return fmean(known)
    earlier = (entries.get(Step(number, 0.0).key) for number in range(trial - 2, -1, -1))
    return next((entry["current_a"] for entry in earlier if entry and "current_a" in entry), None)


def direction_of(loads: Sequence[Load]) -> int:
    """-1 where weights pull the joint to negative angles, so that the motor's current is positive."""
    return -1 if sum(load.torque_nm * load.current_a for load in loads) >= 0.0 else 1


def current_per_nm(plan: Plan, entries: Mapping[str, Entry]) -> float | None:
    """Of the heavier weights so far; None where there were none."""
    loads = [load for load in raw_loads(plan, entries) if load.torque_nm >= LIGHT_NM and not load.doubtful]
    total_nm = sum(load.torque_nm for load in loads)
    return abs(sum(load.current_a for load in loads)) / total_nm if loads else None


def can_fit(loads: Sequence[Load]) -> bool:
    return len(loads) >= FEWEST and len({load.weight_g for load in loads}) > 1


def fit_line(loads: Sequence[Load]) -> Line:
    """Current on torque. Needs what `can_fit` asks."""
    x, y = [load.torque_nm for load in loads], [load.current_a for load in loads]
    count, x_mean, y_mean = len(x), fmean(x), fmean(y)
    spread = sum((each - x_mean) ** 2 for each in x)
    slope = sum((a - x_mean) * (b - y_mean) for a, b in zip(x, y, strict=True)) / spread
    intercept = y_mean - slope * x_mean
    residual = sum((b - intercept - slope * a) ** 2 for a, b in zip(x, y, strict=True)) / (count - 2)
    slope_error = sqrt(residual / spread)
    return Line(slope, intercept, slope_error, sqrt(residual * (1.0 / count + x_mean**2 / spread)), count)


def fit_joint(joint: str, plan: Plan, entries: Mapping[str, Entry], configured_nm_a: float) -> JointFit | None:
    """None where too little was measured for a line."""
    loads = [load for load in loads_of(plan, entries) if not load.doubtful]
    if not can_fit(loads):
        return None
    line = fit_line(loads)
    tares_a = [
        entries[step.key]["current_a"]
        for step in steps_of(plan)
        if not step.weight_g and "current_a" in entries.get(step.key, {})
    ]
    friction_nm, friction_error_nm = _friction(plan, entries, line.constant_nm_a)
    fit = JointFit(
        joint,
        tuple(loads),
        line,
        configured_nm_a,
        direction_of(raw_loads(plan, entries)),
        _rmse(loads, lambda load: configured_nm_a * load.current_a),
        nan,
        repeatability(loads),
        friction_nm,
        friction_error_nm,
        fmean(tares_a) * line.constant_nm_a,
        (stdev(tares_a) if len(tares_a) > 1 else nan) * line.constant_nm_a,
    )
    constants = {trial: fit.constant_without(trial) for trial in {load.trial for load in loads}}
    return fit._replace(rmse_fitted_nm=_rmse(loads, lambda load: constants[load.trial] * load.current_a))


def _rmse(loads: Sequence[Load], sensed_nm: Callable[[Load], float]) -> float:
    return sqrt(fmean((sensed_nm(load) - load.torque_nm) ** 2 for load in loads))


def repeatability(loads: Sequence[Load]) -> float:
    """See the module; NaN where no weight was read twice. The constant does not matter."""
    by_weight: dict[float, list[float]] = {}
    for load in loads:
        by_weight.setdefault(load.weight_g, []).append(load.current_a)
    shares = [stdev(currents) / abs(fmean(currents)) for currents in by_weight.values() if len(currents) > 1]
    return fmean(shares) if shares else nan


def _friction(plan: Plan, entries: Mapping[str, Entry], constant_nm_a: float) -> tuple[float, float]:
    """With its standard error, NaN where there are too few."""
    light = [
        constant_nm_a * entries[step.key]["friction_a"]
        for step in steps_of(plan)
        if plan.torque_nm(step.weight_g) <= LIGHT_NM and "friction_a" in entries.get(step.key, {})
    ]
    if len(light) < FEWEST:
        return nan, nan
    return fmean(light), stdev(light) / sqrt(len(light))
