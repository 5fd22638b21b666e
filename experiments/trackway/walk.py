"""Walks, stride by stride: step, duration, mud and failure of each.

A step is the distance of the body from the start of one insertion to the next; its mud is that in which the plates went
down. For a simulated robot both come from the plant, not from the robot's own estimates; for a real one from the pose
and the joint angles in its log. Two failures have names, after the paper's section III-D. SLIPPAGE: the stride advances
by less than half an arm (the bound in the authors' optimiser). EXTRACTION: the body is pushed back after the
extraction, because the plates are still in the mud when they swing forward.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import fsum, isfinite, sin
from typing import Any, NamedTuple

import numpy as np

from control.modes import Mode
from control.records import UNKNOWN, Phase
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log
from simulation.harness.lockstep import Lockstep

SLIPPAGE, EXTRACTION, RECOVERED = "slippage", "extraction", "recovered"
PUSHED_BACK_M = 0.01  # a flipper that comes out of the mud moves the body by less
AFTER_STANCE = frozenset({Phase.EXTRACTION, Phase.SWING})
SEEN_FRACTION = 0.9  # of the ticks after a stance: with fewer poses, a push back may have been missed
NO_MUD = ""  # of a stride whose position is not known


class WalkedStride(NamedTuple):
    """From the start of one insertion to the start of the next."""

    mud: str  # in which the plates went down
    position_m: float  # of the plates along the track
    depth_m: float  # commanded
    step_m: float
    duration_s: float
    pushed_back_m: float  # distance of the body backwards after the extraction
    recovered: bool = False  # a flipper was stuck, and a recovery pulled it out

    def failure(self, arm_m: float) -> str:
        """Return the name of the failure, or an empty string. `arm_m` is the length of a flipper."""
        if self.pushed_back_m > PUSHED_BACK_M:
            return EXTRACTION
        if self.recovered:
            return RECOVERED
        return SLIPPAGE if self.step_m < arm_m / 2.0 else ""


@dataclass(frozen=True)
class Walk:
    strides: Sequence[WalkedStride]
    fault: str  # the message of the fault that ended it; else empty

    def in_mud(self, mud: str) -> list[WalkedStride]:
        return [stride for stride in self.strides if stride.mud == mud]

    @property
    def entry(self) -> dict[str, Any]:
        """The entry of this walk in a notebook."""
        return {"strides": [stride._asdict() for stride in self.strides], "fault": self.fault}


def walk_of(entry: Mapping[str, Any]) -> Walk:
    return Walk([WalkedStride(**stride) for stride in entry["strides"]], entry["fault"])


def speed_m_s(strides: Sequence[WalkedStride]) -> float:
    """Return the distance over the time of at least one stride."""
    return fsum(stride.step_m for stride in strides) / fsum(stride.duration_s for stride in strides)


class WalkTick(NamedTuple):
    now_s: float
    stride: int  # commanded, -1 for none
    phase: int  # commanded
    depth_m: float  # commanded; an insertion may end early
    body_m: float  # along the track; NaN without a pose
    plates_m: float


class StrideRecord:
    """Owns the strides of a walk so far, and the ticks of the stride under way.

    A stride counts once the next one has begun: the stride in which a walk ends has no length.
    """

    def __init__(self, mud_at: Callable[[float], str]) -> None:
        """`mud_at` names the mud at a position of the plates in metres."""
        self.strides: list[WalkedStride] = []
        self._mud_at = mud_at
        self._ticks: list[WalkTick] = []

    def update(self, tick: WalkTick) -> None:
        if self._ticks and tick.stride != self._ticks[0].stride:
            if tick.stride == self._ticks[0].stride + 1:
                self.strides.append(self._finished_stride(tick))
            self._ticks = []
        if tick.stride >= 0:
            self._ticks.append(tick)

    def _finished_stride(self, following: WalkTick) -> WalkedStride:
        first, last = self._ticks[0], self._ticks[-1]
        after_m = [tick.body_m for tick in self._ticks if tick.phase in AFTER_STANCE]
        seen_m = [body_m for body_m in after_m if isfinite(body_m)]
        losses_m = (furthest_m - body_m for furthest_m, body_m in zip(accumulate(seen_m, max), seen_m, strict=True))
        return WalkedStride(
            mud=self._mud_at(first.plates_m) if isfinite(first.plates_m) else NO_MUD,
            position_m=first.plates_m,
            depth_m=last.depth_m,
            step_m=following.body_m - first.body_m,
            duration_s=following.now_s - first.now_s,
            pushed_back_m=max(losses_m, default=0.0) if len(seen_m) >= SEEN_FRACTION * len(after_m) else UNKNOWN,
            recovered=any(tick.phase == Phase.RECOVERY for tick in self._ticks),
        )


def tick_of(lockstep: Lockstep) -> WalkTick:
    """Return the truth of the plant."""
    plant, loop = lockstep.robot.plant, lockstep.loop
    target, arm_m = loop.controller.target, loop.configuration.geometry.flipper_length_m
    return WalkTick(
        now_s=lockstep.now_s,
        stride=target.stride,
        phase=target.phase,
        depth_m=loop.stride_depth_m,
        body_m=plant.body_m,
        plates_m=plant.body_m + arm_m * sin(plant.arms[0].sweep_rad),
    )


def logged_strides(log: Log, configuration: Configuration, mud_at: Callable[[float], str]) -> list[WalkedStride]:
    """Return the strides of all walks in the log.

    The row of a tick holds what was commanded before it, so the command of a tick is in the next row.
    """
    now, commanded = log.ticks[:-1], log.ticks[1:]
    sweep_sines = np.sin(now["angle_rad"][:, ::2]).mean(axis=1)
    columns = (
        now["stamp_s"],
        np.where(now["mode"] == Mode.WALKING, commanded["stride"], -1),
        commanded["phase"],
        now["stride_depth_m"],
        now["body_x_m"],
        now["body_x_m"] + configuration.geometry.flipper_length_m * sweep_sines,
    )
    record = StrideRecord(mud_at)
    for row in zip(*(column.tolist() for column in columns), strict=True):
        record.update(WalkTick(*row))
    return record.strides
