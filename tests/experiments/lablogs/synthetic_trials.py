"""Synthetic logs with given estimates and errors."""

from collections.abc import Mapping, Sequence

import pandas
from pandas import DataFrame

from control.records import UNKNOWN, Estimate, StrideEstimate
from experiments.lablogs.estimates import METHODS, RECORDED, EvaluatedLog, estimate_rows, join_estimates, strokes_of
from experiments.lablogs.log_choice import group_of

INVALID = Estimate(UNKNOWN, UNKNOWN, 3, False, "too few samples")
Run = tuple[str, int]  # disturbance and seed


def make_value(value: float, std_error: float = 0.1, depth_m: float = 0.03) -> Estimate:
    """Return a value whose repeatability is `std_error`, and whose whole error is twice that."""
    return Estimate(value, 2.0 * std_error, 20, True, repeatability=std_error, depth_m=depth_m, speed_m_s=0.1)


def make_bound(value: float) -> Estimate:
    return Estimate(value, 0.1, 20, True, "the mud did not yield", True, repeatability=0.1)


def make_stride(
    flipper: str = "right",
    index: int = 0,
    *,
    k_p: Estimate = INVALID,
    k_s: Estimate = INVALID,
    k_e: Estimate = INVALID,
    step_m: float = UNKNOWN,
) -> StrideEstimate:
    """Return a stride of four seconds; both flippers begin the same stride with the same sample."""
    return StrideEstimate(
        flipper, index, 4.0 * index, 4.0 * index + 4.0, 1.0, 1.0, 1.0, k_p, k_s, k_e,
        0.0, 0.03, True, 2.0, 8.0, -2.0, step_m,
    )  # fmt: skip


def make_strides(*k_s: Estimate) -> list[StrideEstimate]:
    return [make_stride(index=index, k_s=each) for index, each in enumerate(k_s)]


def make_log(
    strides: Sequence[StrideEstimate],
    name: str = "single_12N_trial1.csv.gz",
    *,
    flippers: tuple[str, ...] = ("right",),
    in_mud: bool = True,
    disturbed: Mapping[Run, Sequence[StrideEstimate]] | None = None,
) -> EvaluatedLog:
    """Return a log with the same strides by every method; a single flipper is on a fixed base."""
    runs = {(RECORDED, 0): strides} | dict(disturbed or {})
    frames = [
        estimate_rows(each, method=method, disturbance=disturbance, seed=seed)
        for (disturbance, seed), each in runs.items()
        for method in METHODS
    ]
    return EvaluatedLog(name, flippers, len(flippers) == 1, in_mud, pandas.concat(frames))


def make_walk(pairs: Sequence[tuple[Estimate, Estimate]]) -> EvaluatedLog:
    """Return a walk with k_s by the left and the right flipper in each stride."""
    strides = [
        make_stride(flipper, index, k_s=k_s)
        for index, pair in enumerate(pairs)
        for flipper, k_s in zip(("left", "right"), pair, strict=True)
    ]
    return make_log(strides, "walk_30N_trial1.csv.gz", flippers=("left", "right"))


def joined(*logs: EvaluatedLog) -> DataFrame:
    """Return the estimates of all logs by every method."""
    return join_estimates(logs, [group_of(log.name, ()) for log in logs])


def by_default(*logs: EvaluatedLog) -> DataFrame:
    estimates = joined(*logs)
    return estimates[estimates["method"] == METHODS[0]]


def k_s_strokes(trials: Sequence[Sequence[Estimate]]) -> DataFrame:
    """Return one coefficient's strokes of trials with these estimates."""
    strokes = strokes_of(by_default(*(make_log(make_strides(*trial)) for trial in trials)))
    return strokes[strokes["coefficient"] == "k_s"]
