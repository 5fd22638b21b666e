"""The strides of the walks in a log, from the log alone: how far, how long, in which mud, and what went wrong.

What walk.py reads off the simulated plant stands here on what the robot has measured: the body's place by its pose
source, the plates' by the joint angles. A tick's row names the phase that was commanded before it, so what the gait
wanted from a tick on stands in the row behind. A stride counts once the next one has begun: the one in which a walk
ended has no length. Without a pose there is none either: it is NaN, and so is the place, and no mud is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from control.records import UNKNOWN, Phase
from experiments.trackway.walk import AFTER_STANCE, WalkedStride
from firmware_host.configuration.configuration import Configuration
from firmware_host.log_reading.log_reader import Log

NO_MUD = ""  # of a stride whose place is not known
LEFT_SWEEP, RIGHT_SWEEP = 0, 2  # in the order of JOINTS
SEEN_FRACTION = 0.9  # of the ticks after a stance: with fewer poses, a way back may have been missed

Rows = NDArray[np.void]
Floats = NDArray[np.float64]


def walked_strides(log: Log, configuration: Configuration, mud_at: Callable[[float], str]) -> list[WalkedStride]:
    """Of all walks in the log, one after the other. `mud_at` names the mud at a place of the plates in metres."""
    now, wanted = log.ticks[:-1], log.ticks[1:]
    positions_m = now["body_x_m"] + configuration.geometry.flipper_length_m * _sweep_sines(now)
    strides = []
    for begin, end in _spans(now, wanted):
        position_m = float(positions_m[begin])
        step_m = float(now["body_x_m"][end] - now["body_x_m"][begin])
        strides.append(
            WalkedStride(
                mud_at(position_m) if np.isfinite(position_m) else NO_MUD,
                position_m,
                float(now["stride_depth_m"][end - 1]),  # an insertion may end early
                step_m,
                float(now["stamp_s"][end] - now["stamp_s"][begin]),
                _pushed_back_m(now["body_x_m"][begin:end], wanted["phase"][begin:end]),
                bool(np.any(wanted["phase"][begin:end] == Phase.RECOVERY)),
            )
        )
    return strides


def _sweep_sines(rows: Rows) -> Floats:
    """Of both flippers, in the middle between them."""
    sines: Floats = np.sin(rows["angle_rad"][:, [LEFT_SWEEP, RIGHT_SWEEP]]).mean(axis=1)
    return sines


def _spans(now: Rows, wanted: Rows) -> Iterator[tuple[int, int]]:
    """The ticks at which a stride and the one after it began, within one walk."""
    stride = np.where(now["mode"] == Mode.WALKING, wanted["stride"], -1)
    begins = np.flatnonzero(np.diff(stride, prepend=-1))
    for begin, end in zip(begins, begins[1:], strict=False):
        if stride[begin] >= 0 and stride[end] == stride[begin] + 1:
            yield int(begin), int(end)


def _pushed_back_m(body_m: Floats, phases: NDArray[np.uint8]) -> float:
    """The longest way back behind the furthest place after the stance; NaN where too little of it was seen."""
    after = body_m[np.isin(phases, [int(phase) for phase in AFTER_STANCE])]
    seen = after[np.isfinite(after)]
    if not len(after):
        return 0.0
    if len(seen) < SEEN_FRACTION * len(after):
        return UNKNOWN
    return float(np.max(np.maximum.accumulate(seen) - seen))
