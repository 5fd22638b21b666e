"""The strides of the walks in a log, from the log alone: step, duration, mud and failure of each.

walk.py reads the same from the simulated plant; here they come from the robot's measurements: the body's position from
the pose, the plates' from the joint angles. The row of a tick holds the phase that was commanded before it, so the
command of a tick is in the next row. A stride counts once the next one has begun: the stride in which a walk ends has
no length. Without a pose, step and position are NaN, and no mud is named.
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

NO_MUD = ""  # of a stride whose position is not known
LEFT_SWEEP, RIGHT_SWEEP = 0, 2  # in the order of JOINTS
SEEN_FRACTION = 0.9  # of the ticks after a stance: with fewer poses, a push back may have been missed

Rows = NDArray[np.void]
Floats = NDArray[np.float64]


def walked_strides(log: Log, configuration: Configuration, mud_at: Callable[[float], str]) -> list[WalkedStride]:
    """Return the strides of all walks in the log. `mud_at` names the mud at a position of the plates in metres."""
    now, wanted = log.ticks[:-1], log.ticks[1:]
    positions_m = now["body_x_m"] + configuration.geometry.flipper_length_m * _sweep_sines(now)
    strides = []
    for begin, end in _spans(now, wanted):
        position_m = float(positions_m[begin])
        step_m = float(now["body_x_m"][end] - now["body_x_m"][begin])
        strides.append(
            WalkedStride(
                mud=mud_at(position_m) if np.isfinite(position_m) else NO_MUD,
                position_m=position_m,
                depth_m=float(now["stride_depth_m"][end - 1]),  # an insertion may end early
                step_m=step_m,
                duration_s=float(now["stamp_s"][end] - now["stamp_s"][begin]),
                pushed_back_m=_pushed_back_m(now["body_x_m"][begin:end], wanted["phase"][begin:end]),
                recovered=bool(np.any(wanted["phase"][begin:end] == Phase.RECOVERY)),
            )
        )
    return strides


def _sweep_sines(rows: Rows) -> Floats:
    """Return the mean of both flippers' sines."""
    sines: Floats = np.sin(rows["angle_rad"][:, [LEFT_SWEEP, RIGHT_SWEEP]]).mean(axis=1)
    return sines


def _spans(now: Rows, wanted: Rows) -> Iterator[tuple[int, int]]:
    """Yield the ticks at which a stride and the next one of the same walk began."""
    stride = np.where(now["mode"] == Mode.WALKING, wanted["stride"], -1)
    begins = np.flatnonzero(np.diff(stride, prepend=-1))
    for begin, end in zip(begins, begins[1:], strict=False):
        if stride[begin] >= 0 and stride[end] == stride[begin] + 1:
            yield int(begin), int(end)


def _pushed_back_m(body_m: Floats, phases: NDArray[np.uint8]) -> float:
    """Return how far the body came back from its furthest position after the stance; NaN with too few poses."""
    after = body_m[np.isin(phases, [int(phase) for phase in AFTER_STANCE])]
    seen = after[np.isfinite(after)]
    if not len(after):
        return 0.0
    if len(seen) < SEEN_FRACTION * len(after):
        return UNKNOWN
    return float(np.max(np.maximum.accumulate(seen) - seen))
