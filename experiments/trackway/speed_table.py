"""The cells of Table I from simulated walks: average speed of one gait in one mud, over trials, and what went wrong.

The speed of a trial is the way over the time of its strides in the mud. Each cell has two: over all strides that began
in the mud (`mean_all`), and over those after the second (`mean`), since in the first two an adaptive robot still
learns the mud. A trial with fewer than three strides in a mud counts with all of them in both (`short_trials`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev
from typing import Any

from experiments.trackway.one_mud import LEARNING
from experiments.trackway.paper_table import Speed
from experiments.trackway.walk import Walk, WalkedStride, speed_m_s


def cell(walks: Sequence[Walk], mud: str, arm_m: float) -> dict[str, Any]:
    """Of the trials that reached the mud; speeds in cm/s, None where none did."""
    trials = [strides for walk in walks if (strides := walk.in_mud(mud))]
    later = [strides[LEARNING:] for strides in trials]
    speeds = [_speed_cm_s(after or strides) for after, strides in zip(later, trials, strict=True)]
    return {
        "mean": _mean(speeds),
        "sd": _sd(speeds),
        "mean_all": _mean([_speed_cm_s(strides) for strides in trials]),
        "sd_all": _sd([_speed_cm_s(strides) for strides in trials]),
        "trials": len(trials),
        "short_trials": sum(not after for after in later),
        "strides": sum(len(strides) for strides in trials),
        "failures": failures(trials, arm_m),
        "failures_after_second": failures(later, arm_m),
    }


def failures(trials: Sequence[Sequence[WalkedStride]], arm_m: float) -> dict[str, int]:
    """How many strides failed, by the failure's name."""
    names = Counter(stride.failure(arm_m) for strides in trials for stride in strides)
    return {name: names[name] for name in sorted(names) if name}


def within_one_sd(mean: float | None, paper: Speed) -> bool | None:
    return None if mean is None else abs(mean - paper.mean) <= paper.sd


def mean_over_muds(cells: Mapping[str, Mapping[str, Any]], figure: str) -> float | None:
    """Every mud counts alike; None where one was never reached."""
    means = [each[figure] for each in cells.values()]
    return None if None in means else _mean(means)


def _speed_cm_s(strides: Sequence[WalkedStride]) -> float:
    return 100.0 * speed_m_s(strides)


def _mean(speeds: Sequence[float]) -> float | None:
    return round(fmean(speeds), 3) if speeds else None


def _sd(speeds: Sequence[float]) -> float | None:
    """Between trials; None of fewer than two."""
    return round(stdev(speeds), 3) if len(speeds) > 1 else None
