"""One simulated walk, stride by stride: step, duration, mud and failure of each.

The truth comes from the plant, not from the robot's own estimates: the distance of the body from the start of one
insertion to the next, and the mud in which the plates went down. Two failures have names, after the paper's section
III-D. SLIPPAGE: the stride advances by less than half an arm (the bound in the authors' optimiser). EXTRACTION: the
body is pushed back after the extraction, because the plates are still in the mud when they swing forward.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sin
from typing import Any, NamedTuple

from control.controller import WalkOrder
from control.modes import Mode
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.fault_texts import fault_message
from simulation.harness.lockstep import Lockstep
from simulation.mud.disturbances import NONE, Disturbances
from simulation.mud.track import Track

SLIPPAGE, EXTRACTION, RECOVERED = "slippage", "extraction", "recovered"
PUSHED_BACK_M = 0.01  # a flipper that comes out of the mud moves the body by less
AFTER_STANCE = frozenset({Phase.EXTRACTION, Phase.SWING})


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
    return sum(stride.step_m for stride in strides) / sum(stride.duration_s for stride in strides)


class StrideRecord:
    """Owns the strides of a walk so far, and the measurements of the stride under way."""

    def __init__(self, lockstep: Lockstep, track: Track) -> None:
        self._lockstep = lockstep
        self._track = track
        self.reset()

    def reset(self) -> None:
        self.strides: list[WalkedStride] = []
        self._number = -1
        self._start_stride()

    def _start_stride(self) -> None:
        plant, loop = self._lockstep.robot.plant, self._lockstep.loop
        self._start_m, self._start_s = plant.body_m, self._lockstep.now_s
        self._furthest_m, self._pushed_back_m, self._recovered = -inf, 0.0, False
        self._depth_m = loop.stride_depth_m
        self._position_m = plant.body_m + loop.configuration.geometry.flipper_length_m * sin(plant.arms[0].sweep_rad)

    def update(self) -> None:
        """Call once a tick while the robot walks."""
        target, body_m = self._lockstep.loop.controller.target, self._lockstep.robot.plant.body_m
        if target.stride != self._number:
            self._finish_stride(body_m)
            self._number = target.stride
        self._depth_m = self._lockstep.loop.stride_depth_m  # an insertion may end early
        self._recovered = self._recovered or target.phase is Phase.RECOVERY
        if target.phase in AFTER_STANCE:
            self._furthest_m = max(self._furthest_m, body_m)
            self._pushed_back_m = max(self._pushed_back_m, self._furthest_m - body_m)

    def _finish_stride(self, body_m: float) -> None:
        if self._number >= 0:
            mud, duration_s = self._track.clay_at(self._position_m).name, self._lockstep.now_s - self._start_s
            step_m = body_m - self._start_m
            self.strides.append(
                WalkedStride(
                    mud=mud,
                    position_m=self._position_m,
                    depth_m=self._depth_m,
                    step_m=step_m,
                    duration_s=duration_s,
                    pushed_back_m=self._pushed_back_m,
                    recovered=self._recovered,
                )
            )
        self._start_stride()


def walk(
    configuration: Configuration,
    track: Track,
    order: WalkOrder,
    seed: int,
    done: Callable[[Sequence[WalkedStride]], bool],
    disturbances: Disturbances = NONE,
) -> Walk:
    """Walk until `done` accepts the strides so far, or a fault. Raises RuntimeError where the robot does not start."""
    lockstep = Lockstep(configuration, track, seed, disturbances=disturbances)
    lockstep.arm()
    return walk_in(lockstep, track, order, done)


def walk_in(lockstep: Lockstep, track: Track, order: WalkOrder, done: Callable[[Sequence[WalkedStride]], bool]) -> Walk:
    """Walk like `walk`, with a robot that is armed already."""
    lockstep.walk(order)
    record = StrideRecord(lockstep, track)
    while lockstep.loop.mode is Mode.WALKING and not done(record.strides):
        lockstep.step()
        record.update()
    fault = lockstep.loop.fault
    return Walk(record.strides, fault_message(fault) if fault else "")
