"""Choice of depth and sweep together, once a stride in swing, for a swing that is as quick as the joints are.

A step is about 2 l sin α long. In firm mud a shallow stride bears the body over a wide sweep, for which it has the
reach; at 5 cm the geometry allows ±30° only (geometry.deepest_m). The stance takes longer over a wider sweep, insertion
and extraction do not. So of all pairs of depth and sweep within reach whose flippers come out again, the one is taken
that promises the highest S/T, with S, T and the safe side of control/depth/depth_choice.py.

What a wide sweep does to an extraction the law does not know. Where the mud holds the body's pad nearly as hard as the
flippers push, the sweep lags, and the adduction angle that is meant for the rear presses the flipper deeper than
commanded: in simulated clay of 5 kPa, 2 cm and ±40°, it began the extraction 27° in front of its joint and stayed in.
So the sweep grows by at most WIDENING_DEG from stride to stride, and only while the extractions take well less than
the joints can give. After a stride that stuck it is the narrowest, and in the same mud none is tried again that is as
deep and as wide.

The authors' swing takes 0.8 s, half of the time of a stride at 3 cm; the simulated sweep joints follow one of 0.2 s to
within 1.1°, and the coefficients read the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import floor, inf
from typing import NamedTuple

from control.depth.depth_choice import AdaptationParameters, DepthChoice, body_drag, depth_grid
from control.depth.forecast import DepthForecast
from control.depth.step_model import Motion, Traction, carried_m, motion_of
from control.gait.gait import GaitParameters, stride_duration_s, swing_duration_s
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.records import StrideEstimate

SWEEP_STEP_DEG = 5.0  # 8 mm of step
EASY_FRACTION = 0.7  # of the lifting torque, under which an extraction leaves room for a wider sweep
WIDENING_DEG = 10.0  # from one stride to the next


class Candidate(NamedTuple):
    """One way to walk a stride."""

    depth_m: float
    gait: GaitParameters
    duration_s: float
    motion: Motion  # of the plates in the mud

    def holds(self, other: Candidate) -> bool:
        """At least as deep and as wide as another one."""
        return self.depth_m >= other.depth_m and self.gait.sweep_angle_deg >= other.gait.sweep_angle_deg


def quickest(parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> GaitParameters:
    """The gait with the shortest swing that the method may ask for."""
    if parameters.method != "gait":
        return gait
    return min(
        gait,
        replace(gait, swing_duration_s=parameters.swing_duration_s),
        key=partial(swing_duration_s, geometry=geometry),
    )


def sweep_grid(parameters: AdaptationParameters) -> tuple[float, ...]:
    """In degrees, from the narrowest to the widest."""
    low_deg, high_deg = parameters.min_sweep_deg, parameters.max_sweep_deg
    count = max(0, floor((high_deg - low_deg) / SWEEP_STEP_DEG + 1e-9)) + 1
    return tuple(low_deg + i * SWEEP_STEP_DEG for i in range(count))


def candidate(geometry: FlipperGeometry, gait: GaitParameters, depth_m: float) -> Candidate:
    motion = motion_of(gait, geometry.flipper_length_m, depth_m)
    return Candidate(depth_m, gait, stride_duration_s(gait, geometry, depth_m), motion)


def candidates(
    parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters
) -> tuple[Candidate, ...]:
    """All pairs of depth and sweep within reach, narrow before wide and shallow before deep."""
    swift = replace(gait, swing_duration_s=parameters.swing_duration_s)
    gaits = [replace(swift, sweep_angle_deg=sweep_deg) for sweep_deg in sweep_grid(parameters)]
    return tuple(
        candidate(geometry, each, depth_m) for each in gaits for depth_m in depth_grid(parameters, geometry, each)
    )


class GaitAdaptation:
    """Owns depth and gait of the next stride, and what stuck in this mud."""

    def __init__(self, parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self.gait = gait
        self.candidates = candidates(parameters, geometry, gait)
        self._depths_m = sorted({each.depth_m for each in self.candidates})
        self.forecast = DepthForecast(geometry, gait, parameters.motor_force_n)
        self.reset(parameters.initial_depth_m)

    def reset(self, depth_m: float) -> None:
        self._walked = candidate(self.geometry, self.gait, depth_m)
        self.choice = DepthChoice(depth_m, False, "start", self.gait)
        self._stuck: list[Candidate] = []
        self.forecast.reset()

    def step(self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float) -> DepthChoice:
        """From the strides that just closed, the depth that they were told, and the belief after them.

        Where nothing is known all stays.
        """
        self._walked = self._walked._replace(depth_m=walked_m)
        self.forecast.gait = self._walked.gait
        self.forecast.update(mud_estimate, strides, walked_m)
        stuck = any(not stride.released for stride in strides)
        self._remember(stuck, mud_estimate.boundary)
        steps_m = self._steps_m()
        if steps_m or stuck:
            index, reason = self._best(steps_m or [0.0] * len(self.candidates), self._widest_deg(strides))
            self._walked = self.candidates[index]
            self.choice = self._reported(steps_m[index] if steps_m else inf, "a flipper was stuck" if stuck else reason)
        else:
            self.choice = self.choice._replace(reason="nothing known of the thrust, depth kept")
        return self.choice

    @property
    def largest_insertion_nm(self) -> float:
        return self.parameters.insertion_fraction * self.forecast.lifting_torque_nm

    def _remember(self, stuck: bool, boundary: bool) -> None:
        """What comes out of the mud allows again what it holds."""
        if boundary:
            self._stuck.clear()
        if stuck:
            self._stuck.append(self._walked)
        else:
            self._stuck = [each for each in self._stuck if not self._walked.holds(each)]

    def _widest_deg(self, strides: Sequence[StrideEstimate]) -> float:
        """Wider than the last stride only where that left the mud easily; the narrowest where it did not leave it."""
        if any(not stride.released for stride in strides):
            return self.parameters.min_sweep_deg
        limit_nm = EASY_FRACTION * self.forecast.lifting_torque_nm
        easily = all(stride.extraction_torque_nm < limit_nm for stride in strides)
        widest_deg = self._walked.gait.sweep_angle_deg + (WIDENING_DEG if easily else 0.0)
        return max(widest_deg, self.parameters.min_sweep_deg)

    def _steps_m(self) -> list[float]:
        """Promised by every candidate; empty where nothing is known of the thrust.

        The thrust is that of the middle of the sweep, whose depth any gait reaches that reaches it at the ends.
        """
        drag, stiffness_n_m = body_drag(self.parameters, self.forecast), 2.0 * self.parameters.mobilisation_n_m
        self.forecast.gait = self.candidates[0].gait
        grips = dict[float, Traction]()
        for depth_m in self._depths_m:
            thrust_n = self.forecast.thrust_n(depth_m)
            if thrust_n is None:
                return []
            grips[depth_m] = Traction(thrust_n, stiffness_n_m)
        return [carried_m(each.motion, drag, grips[each.depth_m]) for each in self.candidates]

    def _best(self, steps_m: Sequence[float], widest_deg: float) -> tuple[int, str]:
        """Which candidate is the fastest one that comes out, and why. Fast ones are asked first: asking costs time.

        Where none promises a step, it is the deepest one.
        """
        pairs = zip(steps_m, self.candidates, strict=True)
        merits = [(step_m / each.duration_s, each.depth_m) for step_m, each in pairs]
        for index in sorted(range(len(merits)), key=merits.__getitem__, reverse=True):
            best = self.candidates[index]
            if best.gait.sweep_angle_deg <= widest_deg and self._comes_out(best):
                return index, "fastest" if merits[index][0] > 0.0 else "thrust"
        return 0, "extraction"

    def _comes_out(self, stride: Candidate) -> bool:
        if any(stride.holds(each) for each in self._stuck):
            return False
        self.forecast.gait = stride.gait
        limit_nm = self.parameters.lifting_fraction * self.forecast.lifting_torque_nm
        return self.forecast.extraction_nm(stride.depth_m) < limit_nm

    def _reported(self, promised_m: float, reason: str) -> DepthChoice:
        slips = promised_m < self.geometry.flipper_length_m / 2.0
        return DepthChoice(self._walked.depth_m, slips, reason, self._walked.gait)
