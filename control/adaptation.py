"""Choice of the insertion depth, once a stride in swing (paper, section III-D).

Two conditions bound the depth z. The flippers must not slip: 2 f_x(z, k_s) > f_r(k_s) + f_a. They must come out
again: f_e(z, k_e) < f_m. With the paper's force laws, for a plate of width b and edge area A,

    f_x = k_s · b z²/2      f_e = k_e · A z      f_r = drag + k_s · w d²/2      f_a = m v / t

where w and d are the drag pad's width and depth, v the body's mean speed in stance and t the time to reach it. Both
forces grow with z, so the conditions leave an interval. The shallowest depth in it is taken, since shallow strides
are quick; where the two conditions leave nothing, the deepest one that still comes out, since a stuck robot is worse
off than a slipping one. The coefficients enter with their doubt: weak thrust, strong suction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.gait import GaitParameters
from control.geometry import FlipperGeometry
from control.records import StrideEstimate

GRID_M = 0.0025  # depths that are told apart; the joints do not follow more finely in mud
DOUBT = 2.0  # standard errors


@dataclass(frozen=True)
class AdaptationParameters:
    initial_depth_m: Annotated[float, Bounds(0.005, 0.2)] = 0.03
    min_depth_m: Annotated[float, Bounds(0.005, 0.2)] = 0.025
    max_depth_m: Annotated[float, Bounds(0.005, 0.2)] = 0.05
    body_drag_n: Annotated[float, Bounds(0.0, 100.0)] = 2.5  # the paper's, without the pad
    pad_width_m: Annotated[float, Bounds(0.0, 0.5)] = 0.015
    pad_depth_m: Annotated[float, Bounds(0.0, 0.5)] = 0.02
    body_mass_kg: Annotated[float, Bounds(0.05, 100.0)] = 1.0
    acceleration_s: Annotated[float, Bounds(0.01, 10.0)] = 0.1
    lifting_force_n: Annotated[float, Bounds(0.1, 100.0)] = 6.25  # f_m: 0.75 N·m at 0.12 m
    thrust_margin: Annotated[float, Bounds(1.0, 10.0)] = 1.5  # thrust over resistance that counts as no slip
    lifting_share: Annotated[float, Bounds(0.1, 1.0)] = 0.8  # of f_m that an extraction may need


class DepthChoice(NamedTuple):
    depth_m: float
    slips: bool  # the thrust predicted for this depth does not overcome drag and inertia
    reason: str


class DepthAdaptation:
    """Owns the depth of the next stride."""

    def __init__(self, parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self.gait = gait
        self.grid_m = self._grid()
        self.reset(parameters.initial_depth_m)

    def reset(self, depth_m: float) -> None:
        self.choice = DepthChoice(depth_m, False, "start")

    def _grid(self) -> tuple[float, ...]:
        low_m = self.parameters.min_depth_m
        high_m = min(self.parameters.max_depth_m, self.geometry.deepest_m(self.gait.sweep_angle_deg))
        count = max(0, int((high_m - low_m) / GRID_M + 1e-9)) + 1
        return tuple(low_m + i * GRID_M for i in range(count))

    def step(self, strides: Sequence[StrideEstimate]) -> DepthChoice:
        """From the stride that both flippers just closed. Where nothing was learned about thrust the depth stays."""
        if any(not stride.released for stride in strides):
            self.choice = self._choose(strides, "a flipper was stuck")
        elif any(stride.k_s.valid for stride in strides):
            self.choice = self._choose(strides, "")
        else:
            self.choice = self.choice._replace(reason="no valid k_s, depth kept")
        return self.choice

    def _choose(self, strides: Sequence[StrideEstimate], reason: str) -> DepthChoice:
        free = [z for z in self.grid_m if self._comes_out(z, strides)]
        if not free:
            shallowest_m = self.grid_m[0]
            return DepthChoice(shallowest_m, not self._advances(shallowest_m, strides), reason or "extraction")
        firm = [z for z in free if self._advances(z, strides)]
        if firm:
            return DepthChoice(firm[0], False, reason or "both conditions hold")
        return DepthChoice(free[-1], True, reason or "thrust")

    def _comes_out(self, depth_m: float, strides: Sequence[StrideEstimate]) -> bool:
        """f_e(z, k_e) < share · f_m for the flipper that the mud holds harder."""
        limit_n = self.parameters.lifting_share * self.parameters.lifting_force_n
        return all(self._extraction_force_n(depth_m, stride) < limit_n for stride in strides)

    def _extraction_force_n(self, depth_m: float, stride: StrideEstimate) -> float:
        """f_e = k_e · A z, as strong as the doubt allows; a doubtful k_e still bounds it from above.

        A flipper that came out without telling k_e proves f_e < f_m where it was; one that stayed in proves f_e ≥ f_m.
        """
        submerged_m = max(0.0, depth_m - stride.surface_m)
        lifting_n = self.parameters.lifting_force_n
        if not stride.released:
            return max(lifting_n * submerged_m / max(stride.depth_m, GRID_M), self._told_force_n(submerged_m, stride))
        if not isfinite(stride.k_e.std_error):
            return 0.0 if submerged_m <= stride.depth_m + GRID_M else lifting_n
        return self._told_force_n(submerged_m, stride)

    def _told_force_n(self, submerged_m: float, stride: StrideEstimate) -> float:
        edge_m2 = self.geometry.plate_width_m * self.geometry.plate_thickness_m
        k_e = max(0.0, stride.k_e.value) + DOUBT * stride.k_e.std_error
        return k_e * edge_m2 * submerged_m if isfinite(k_e) else 0.0

    def _advances(self, depth_m: float, strides: Sequence[StrideEstimate]) -> bool:
        """2 f_x(z, k_s) > f_r(k_s) + f_a. One flipper speaks for both where the other's k_s is not valid."""
        told = [stride for stride in strides if stride.k_s.valid]
        if not told:
            return False
        thrust_n = 2.0 / len(told) * sum(self._thrust_n(depth_m, stride) for stride in told)
        k_s = sum(stride.k_s.value for stride in told) / len(told)
        pad_n = k_s * self.parameters.pad_width_m * self.parameters.pad_depth_m**2 / 2.0
        resistance_n = self.parameters.body_drag_n + pad_n + self.inertial_force_n
        return thrust_n > self.parameters.thrust_margin * resistance_n

    def _thrust_n(self, depth_m: float, stride: StrideEstimate) -> float:
        """f_x = k_s · b z²/2."""
        k_s = max(0.0, stride.k_s.value - DOUBT * stride.k_s.std_error)
        return k_s * self.geometry.plate_width_m * max(0.0, depth_m - stride.surface_m) ** 2 / 2.0

    @property
    def inertial_force_n(self) -> float:
        """f_a = m α l / (t_acc t_s), with the stance time t_s = 2 α l / v: half of m v / t_acc."""
        return self.parameters.body_mass_kg * self.gait.stance_speed_m_s / (2.0 * self.parameters.acceleration_s)
