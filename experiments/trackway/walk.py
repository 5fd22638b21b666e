"""Walks, stride by stride: step, duration, mud and failure of each.

A step is the distance of the body from the start of one insertion to the next; its mud is that in which the plates went
down. For a simulated robot both come from the plant, not from the robot's own estimates; for a real one from the pose
and the joint angles in its log. Two failures have names, after the paper's section III-D. SLIPPAGE: the stride advances
by less than half an arm (the bound in the authors' optimiser). EXTRACTION: the body is pushed back after the
extraction, because the plates are still in the mud when they swing forward.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import fsum, inf, isfinite, sin
from typing import Any, NamedTuple

import numpy as np

from control.controller import WalkOrder
from control.modes import Mode
from control.records import UNKNOWN, Phase
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import Track

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
    """Owns the strides of a walk so far, and the measurements of the stride under way.

    A stride counts once the next one has begun: the stride in which a walk ends has no length.
    """

    def __init__(self, mud_at: Callable[[float], str]) -> None:
        """`mud_at` names the mud at a position of the plates in metres."""
        self.strides: list[WalkedStride] = []
        self._mud_at = mud_at
        self._start_stride(WalkTick(0.0, -1, Phase.REST, 0.0, 0.0, 0.0))

    def _start_stride(self, tick: WalkTick) -> None:
        self._first = self._last = tick
        self._furthest_m, self._pushed_back_m, self._recovered = -inf, 0.0, False
        self._ticks_after = self._seen_after = 0

    def update(self, tick: WalkTick) -> None:
        if tick.stride != self._first.stride:
            if 0 <= self._first.stride == tick.stride - 1:
                self._finish_stride(tick)
            self._start_stride(tick)
        self._last = tick
        self._recovered = self._recovered or tick.phase == Phase.RECOVERY
        if tick.phase in AFTER_STANCE:
            self._ticks_after += 1
            if isfinite(tick.body_m):
                self._seen_after += 1
                self._furthest_m = max(self._furthest_m, tick.body_m)
                self._pushed_back_m = max(self._pushed_back_m, self._furthest_m - tick.body_m)

    def _finish_stride(self, tick: WalkTick) -> None:
        first, seen = self._first, self._seen_after >= SEEN_FRACTION * self._ticks_after
        self.strides.append(
            WalkedStride(
                mud=self._mud_at(first.plates_m) if isfinite(first.plates_m) else NO_MUD,
                position_m=first.plates_m,
                depth_m=self._last.depth_m,
                step_m=tick.body_m - first.body_m,
                duration_s=tick.now_s - first.now_s,
                pushed_back_m=self._pushed_back_m if seen else UNKNOWN,
                recovered=self._recovered,
            )
        )


def walk_in(lockstep: Lockstep, track: Track, order: WalkOrder, done: Callable[[Sequence[WalkedStride]], bool]) -> Walk:
    """Walk until `done` accepts the strides so far, or a fault. Raises RuntimeError where the robot does not start."""
    lockstep.arm()
    lockstep.walk(order)
    record = StrideRecord(lambda position_m: track.clay_at(position_m).name)
    while lockstep.loop.mode is Mode.WALKING and not done(record.strides):
        lockstep.step()
        record.update(tick_of(lockstep))
    fault = lockstep.loop.fault
    return Walk(record.strides, fault.message if fault else "")


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
