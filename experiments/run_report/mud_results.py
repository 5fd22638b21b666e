"""What a run found in each mud: strides and their outcomes, speed, and coefficients with their uncertainty.

The speed of a mud is the sum of its steps over the sum of their durations, without the last stride of a walk. Its
standard error is that of a ratio: the scatter of the steps around speed times duration, with Student's factor.
Coefficients are means over the strides of both flippers (coefficient_table.py). They fall with depth, so the depths
stand next to them.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import fsum, isfinite, sqrt
from typing import Any

from control.records import UNKNOWN
from estimation.strokes.origin_fit import student_factor
from experiments.pictures.stride_choice import Outcome, Stride
from experiments.reports.coefficient_table import GatheredCoefficient, gather_coefficient
from experiments.reports.error_table import COEFFICIENTS
from experiments.run_report.run import ReportedStride, Run

Coefficients = Mapping[str, GatheredCoefficient]


@dataclass(frozen=True)
class Speed:
    """None where there is no pose, and no error of a single stride."""

    distance_m: float | None
    duration_s: float | None  # of the strides that the speed is measured over
    speed_m_s: float | None
    speed_std_error_m_s: float | None


@dataclass(frozen=True)
class MudResult:
    mud: str
    strides: int
    outcomes: Mapping[str, int]
    motion: Speed = field(metadata={"flat": True})
    shallowest_m: float
    deepest_m: float
    both: Coefficients
    flippers: Mapping[str, Coefficients]


def mud_results(run: Run) -> list[MudResult]:
    """Return the result of each mud in the order of the walk, without the strides whose mud is not certain."""
    muds = dict.fromkeys(stride.mud for stride in run.strides if stride.mud)
    return [_result(mud, [stride for stride in run.strides if stride.mud == mud], run.flippers) for mud in muds]


def _result(mud: str, strides: Sequence[ReportedStride], flippers: Sequence[str]) -> MudResult:
    depths_m = [stride.depth_m for stride in strides if isfinite(stride.depth_m)] or [UNKNOWN]
    return MudResult(
        mud=mud,
        strides=len(strides),
        outcomes=count_outcomes(strides),
        motion=speed_of(strides),
        shallowest_m=min(depths_m),
        deepest_m=max(depths_m),
        both=gathered(strides, flippers),
        flippers={flipper: gathered(strides, [flipper]) for flipper in flippers},
    )


def count_outcomes(strides: Sequence[ReportedStride]) -> dict[str, int]:
    counts = Counter(str(stride.outcome) for stride in strides)
    return {str(outcome): counts[str(outcome)] for outcome in Outcome}


def speed_of(strides: Sequence[ReportedStride]) -> Speed:
    steps_m = [stride.step_m for stride in strides if isfinite(stride.step_m)]
    known = [stride for stride in strides if isfinite(stride.step_m + stride.duration_s)]
    distance_m = fsum(steps_m) if steps_m else None
    if not known:
        return Speed(distance_m, None, None, None)
    duration_s = fsum(stride.duration_s for stride in known)
    speed_m_s = fsum(stride.step_m for stride in known) / duration_s
    error = None
    if len(known) > 1:
        squares = fsum((stride.step_m - speed_m_s * stride.duration_s) ** 2 for stride in known)
        freedom = len(known) - 1
        error = student_factor(freedom) * sqrt(squares / freedom * len(known)) / duration_s
    return Speed(distance_m, duration_s, speed_m_s, error)


def gathered(strides: Sequence[ReportedStride], flippers: Sequence[str]) -> Coefficients:
    rows = [stride.rows[flipper] for stride in strides for flipper in flippers if flipper in stride.rows]
    return {name: gather_coefficient(estimate_of_row(row, name) for row in rows) for name in COEFFICIENTS}


def estimate_of_row(row: Stride, name: str) -> dict[str, Any]:
    """Return one coefficient of a row as the daemon reports an estimate."""
    value, std_error = (float(row[key]) for key in (name, f"{name}_std_error"))
    return {
        "value": value if isfinite(value) else None,
        "std_error": std_error if isfinite(std_error) else None,
        "valid": bool(row[f"{name}_valid"]) and isfinite(value),
        "at_least": bool(row[f"{name}_at_least"]),
        "reason": "",
    }
