"""Choice of depth and sweep together, once a stride, in swing, with a swing as quick as the joints allow.

A step is about 2 l sin α long. In firm mud a shallow stride supports the body over a wide sweep, which the geometry
allows; at 5 cm it allows ±30° only (geometry.deepest_m). A wider sweep takes a longer stance, but no longer insertion
or extraction. So the search of depth_choice.py runs over all pairs of depth and sweep within reach.

The forecast does not know what a wide sweep does to an extraction. If the mud holds the body's pad nearly as hard as
the flippers push, the sweep lags, and the adduction angle that is meant for the rear presses the flipper deeper than
commanded: in simulated clay of 5 kPa, at 2 cm and ±40°, the flipper began the extraction 27° in front of its joint and
stayed in the mud. So the sweep grows by at most WIDENING_DEG from stride to stride, and only while the extractions take
much less torque than the joints can give. After a stride that stuck the sweep is the narrowest, and in the same mud no
candidate is tried again that is as deep and as wide.

The authors' swing takes 0.8 s, half of a stride at 3 cm; the simulated sweep joints follow one of 0.2 s to within 1.1°,
and the estimated coefficients stay the same.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import floor

from control.computing.bounded_work import Work
from control.depth.depth_choice import Candidate, DepthAdaptation, DepthChoice, depth_grid, make_candidate
from control.gait.stride_table import swing_duration_s
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.parameters.adaptation_parameters import AdaptationParameters, GaitAdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.records import StrideEstimate

SWEEP_STEP_DEG = 5.0  # 14 to 18 mm of step
EASY_FRACTION = 0.7  # of the lifting torque: an extraction below it allows a wider sweep
WIDENING_DEG = 10.0  # from one stride to the next


def quickest(parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> GaitParameters:
    """Return the gait with the shortest swing that the configured method may choose."""
    if parameters.method != "gait":
        return gait
    swift = replace(gait, swing_duration_s=parameters.gait.swing_duration_s)
    return min(gait, swift, key=partial(swing_duration_s, geometry=geometry))


def sweep_grid(parameters: GaitAdaptationParameters) -> tuple[float, ...]:
    """Return the sweeps in degrees, from the narrowest to the widest."""
    low_deg, high_deg = parameters.min_sweep_deg, parameters.max_sweep_deg
    count = max(0, floor((high_deg - low_deg) / SWEEP_STEP_DEG + 1e-9)) + 1
    return tuple(low_deg + i * SWEEP_STEP_DEG for i in range(count))


def gaits_and_depths(
    parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters
) -> list[tuple[GaitParameters, float]]:
    """Return all pairs of sweep and depth within reach, narrow before wide and shallow before deep."""
    swift = replace(gait, swing_duration_s=parameters.gait.swing_duration_s)
    gaits = [replace(swift, sweep_angle_deg=sweep_deg) for sweep_deg in sweep_grid(parameters.gait)]
    return [(each, depth_m) for each in gaits for depth_m in depth_grid(parameters, geometry, each)]


def covers(stride: Candidate, other: Candidate) -> bool:
    """Return whether a stride is at least as deep and as wide as another one."""
    return stride.depth_m >= other.depth_m and stride.gait.sweep_angle_deg >= other.gait.sweep_angle_deg


class GaitAdaptation(DepthAdaptation):
    """Searches depth and sweep together. Owns the stride under way, and the strides that stuck in this mud."""

    def reset(self, depth_m: float) -> None:
        super().reset(depth_m)
        self.choice = self.choice._replace(gait=self.gait)
        self._walked = make_candidate(self.geometry, self.gait, depth_m)
        self._widest_deg = self.parameters.gait.min_sweep_deg
        self._stuck: list[Candidate] = []

    def _gaits_and_depths(self) -> Sequence[tuple[GaitParameters, float]]:
        return gaits_and_depths(self.parameters, self.geometry, self.gait)

    def choose(
        self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float
    ) -> Work[DepthChoice]:
        self._walked = self._walked._replace(depth_m=walked_m)
        self._remember(any(not stride.released for stride in strides), mud_estimate.boundary)
        self._widest_deg = self._next_widest_deg(strides)
        self.forecast.gait = self._walked.gait  # the strides that the forecast learns from
        return super().choose(mud_estimate, strides, walked_m)

    def _remember(self, stuck: bool, boundary: bool) -> None:
        """Record a stride that stuck; one that came out clears those that it covers."""
        if boundary:
            self._stuck.clear()
        if stuck:
            self._stuck.append(self._walked)
        else:
            self._stuck = [each for each in self._stuck if not covers(self._walked, each)]

    def _next_widest_deg(self, strides: Sequence[StrideEstimate]) -> float:
        """Return the widest sweep of the next stride: wider than the last only if that left the mud easily."""
        narrowest_deg = self.parameters.gait.min_sweep_deg
        if any(not stride.released for stride in strides):
            return narrowest_deg
        limit_nm = EASY_FRACTION * self.forecast.lifting_torque_nm
        easily = all(stride.extraction_torque_nm < limit_nm for stride in strides)
        widest_deg = self._walked.gait.sweep_angle_deg + (WIDENING_DEG if easily else 0.0)
        return max(widest_deg, narrowest_deg)

    def _comes_out(self, stride: Candidate) -> bool:
        if stride.gait.sweep_angle_deg > self._widest_deg or any(covers(stride, each) for each in self._stuck):
            return False
        return super()._comes_out(stride)

    def _choice_of(self, best: Candidate, slips: bool, reason: str) -> DepthChoice:
        self._walked = best
        return super()._choice_of(best, slips, reason)._replace(gait=best.gait)
