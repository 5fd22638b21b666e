"""Chooses the strides of a walk for a picture, and the moments of each stride to draw.

A stride fails in one of the paper's two ways (section III-A): the mud yields and the body does not advance, or the
flipper does not come out of the mud.
"""

from collections.abc import Sequence
from enum import StrEnum
from math import isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from control.records import Phase
from experiments.pictures.recorded_walk import RecordedWalk, in_detail

Stride = dict[str, Any]  # a row of log_rows.STRIDE

LEAST_STEP_M = 0.005  # of a stance that moves the body; a probe has none
FULL_FRACTION = 0.5  # of the geometric step; below it a stride slips
MOMENTS = (  # caption, phase, and the elapsed fraction of the phase
    ("insertion", Phase.INSERTION, 0.0),
    ("insertion ends", Phase.INSERTION, 1.0),
    ("stance", Phase.STANCE, 0.5),
    ("stance ends", Phase.STANCE, 1.0),
    ("extraction ends", Phase.EXTRACTION, 1.0),
    ("recovery", Phase.RECOVERY, 0.5),
    ("swing", Phase.SWING, 0.5),
    ("swing ends", Phase.SWING, 1.0),
)


class Outcome(StrEnum):
    SLIPPING = "slipping"
    STUCK = "stuck"
    GOOD = "good"
    UNKNOWN = "unknown"  # its length is not known without a pose, and says nothing on a fixed base

    @property
    def of_stride(self) -> str:
        return "stride" if self is Outcome.UNKNOWN else f"{self} stride"


class Moment(NamedTuple):
    caption: str
    row: int


def outcome_of(walk: RecordedWalk, stride: Stride) -> Outcome:
    if not stride["released"]:
        return Outcome.STUCK
    step_m, full_m = stride["step_m"], geometric_step_m(walk, stride)
    if not (abs(full_m) > LEAST_STEP_M and isfinite(step_m)):
        return Outcome.UNKNOWN
    return Outcome.SLIPPING if step_m / full_m < FULL_FRACTION else Outcome.GOOD


def of_both_flippers(walk: RecordedWalk, strides: Sequence[Stride]) -> list[Stride]:
    """Return strides as those of the robot: stuck, if either flipper was."""
    stuck = {stride["index"] for stride in walk.strides if not stride["released"]}
    return [stride | {"released": stride["index"] not in stuck} for stride in strides]


def geometric_step_m(walk: RecordedWalk, stride: Stride) -> float:
    """Return the step with a plate that does not move in the mud during the stance: l (sin α₀ - sin α₁).

    It is negative where the flipper sweeps forward, as in a backward walk; NaN on a fixed base and without a stance.
    """
    rows = rows_of(walk, stride)
    stance = rows.start + np.flatnonzero(walk.phase[rows.start : rows.stop] == Phase.STANCE)
    if walk.fixed_base or not len(stance):
        return nan
    begin, end = np.sin(walk.sweep_angle_rad[stance[[0, -1]]])
    return walk.geometry.flipper_length_m * float(begin - end)


def choose_strides(walk: RecordedWalk) -> list[Stride]:
    """Return the clearest stride of each outcome."""
    chosen = []
    for outcome in Outcome:
        strides = [stride for stride in walk.own_strides if outcome_of(walk, stride) is outcome]
        ranks = [_rank(walk, stride, outcome) for stride in strides]
        if strides:
            chosen.append(strides[ranks.index(min(ranks))])
    return chosen


def _rank(walk: RecordedWalk, stride: Stride, outcome: Outcome) -> tuple[bool, float]:
    """Rank strides that begin above the mud first, then the longest good stride or the shortest failure."""
    step_m = float(np.nan_to_num(stride["step_m"]))
    began_in_mud = bool(walk.depth_m[rows_of(walk, stride).start] > 0.0)
    return began_in_mud, -step_m if outcome is Outcome.GOOD else step_m


def rows_of(walk: RecordedWalk, stride: Stride) -> range:
    """Return the rows from the start of the insertion to the end of the next swing."""
    first, close = (int(np.searchsorted(walk.time_s, stride[name])) for name in ("t_start_s", "stamp_s"))
    beyond = close + np.flatnonzero(np.isin(walk.phase[close:], (Phase.INSERTION, Phase.REST)))
    return range(first, int(beyond[0]) if len(beyond) else len(walk.time_s))


def duration_s(walk: RecordedWalk, stride: Stride) -> float:
    rows = rows_of(walk, stride)
    return float(walk.time_s[rows.stop - 1] - walk.time_s[rows.start])


def with_strides(walk: RecordedWalk, strides: Sequence[Stride]) -> RecordedWalk:
    """Return the walk with every row of some of its strides. Raises LogError."""
    spans = []
    for rows in (rows_of(walk, stride) for stride in strides):
        spans.append((float(walk.time_s[max(rows.start - 1, 0)]), float(walk.time_s[rows.stop - 1])))
    return in_detail(walk, spans)


def moments_of(walk: RecordedWalk, stride: Stride) -> list[Moment]:
    """Return the MOMENTS of the stride that are in the log, which may end before the swing."""
    rows = rows_of(walk, stride)
    phase, moments = walk.phase[rows.start : rows.stop], []
    for caption, wanted, fraction in MOMENTS:
        inside = np.flatnonzero(phase == wanted)
        if len(inside):
            moments.append(Moment(caption, rows.start + int(inside[round(fraction * (len(inside) - 1))])))
    return moments
