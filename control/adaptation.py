"""Choice of the insertion depth, once a stride in swing (paper, section III-D).

Two conditions bound the depth z. The flippers must not slip: 2 f_x(z) > f_r + f_a. They must come out again:
τ_e(z) < τ_m. With what is believed of the mud at that depth, and the plate's geometry (control/plate.py),

    f_x = k_s(z) ∫ζ dA, in mid-sweep       τ_e = k_e(z) Φ, at the rear end of the sweep, where they are pulled out
    f_r = drag + k_s · w d²/2              τ_m = lifting force · arm length              f_a = m v / t

where w and d are the drag pad's width and depth, v the body's mean speed in stance and t the time to reach it. The
coefficients enter with their doubt (weak thrust, strong suction), the more so the farther z is from where they were
learned. Thrust and suction of one mud grow with depth, whatever their laws: what comes out of the mud comes out of
every shallower place, and what does not slip slips at no deeper one. So the conditions leave an interval. The
shallowest depth in it is taken, since shallow strides are quick; where they leave nothing, the deepest one that
still comes out, since a stuck robot is worse off than a slipping one.

Mud that did not yield tells no k_s, only that it bore so much. Where that was enough for the condition, the body has
advanced: depths from there on hold, without the margin that a prediction needs. A flipper that stuck proves
τ_e ≥ τ_m where it was, whatever was believed; that is remembered until it comes out of there, or the mud changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, radians
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.coefficient import Coefficient, MudBelief
from control.gait import GaitParameters
from control.geometry import FlipperGeometry
from control.plate import stroke_moment_m4, submerged_plate
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
    lifting_force_n: Annotated[float, Bounds(0.1, 100.0)] = 6.25  # 0.75 N·m at 0.12 m
    thrust_margin: Annotated[float, Bounds(1.0, 10.0)] = 1.5  # thrust over resistance that counts as no slip
    lifting_share: Annotated[float, Bounds(0.1, 1.0)] = 0.8  # of its torque that an extraction may need


Shear = tuple[Coefficient, float]  # k_s, and the depth of the surface below its nominal height, m


class DepthChoice(NamedTuple):
    depth_m: float
    slips: bool  # the thrust predicted for this depth does not overcome drag and inertia
    reason: str


class DepthAdaptation:
    """Owns the depth of the next stride, and how deep each flipper was in this mud when it stuck."""

    def __init__(self, parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self.gait = gait
        self.grid_m = self._grid()
        self.reset(parameters.initial_depth_m)

    def reset(self, depth_m: float) -> None:
        self.choice = DepthChoice(depth_m, False, "start")
        self._stuck_m: dict[str, float] = {}

    def _grid(self) -> tuple[float, ...]:
        low_m = self.parameters.min_depth_m
        high_m = min(self.parameters.max_depth_m, self.geometry.deepest_m(self.gait.sweep_angle_deg))
        count = max(0, int((high_m - low_m) / GRID_M + 1e-9)) + 1
        return tuple(low_m + i * GRID_M for i in range(count))

    def step(self, belief: MudBelief, strides: Sequence[StrideEstimate]) -> DepthChoice:
        """From the strides that just closed and the belief after them. Where thrust is not known the depth stays."""
        if belief.boundary:
            self._stuck_m.clear()
        for stride in strides:
            self._remember(stride)
        shears = _shears(belief, strides)
        if any(not stride.released for stride in strides):
            self.choice = self._choose(belief, strides, shears, "a flipper was stuck")
        elif shears:
            self.choice = self._choose(belief, strides, shears, "")
        else:
            self.choice = self.choice._replace(reason="no k_s known, depth kept")
        return self.choice

    def _remember(self, stride: StrideEstimate) -> None:
        reached_m = max(_known(stride.depth_m), GRID_M)
        stuck_m = self._stuck_m.get(stride.flipper, inf)
        if not stride.released:
            self._stuck_m[stride.flipper] = min(reached_m, stuck_m)
        elif reached_m > stuck_m - GRID_M / 2.0:
            del self._stuck_m[stride.flipper]

    def _choose(
        self, belief: MudBelief, strides: Sequence[StrideEstimate], shears: Sequence[Shear], reason: str
    ) -> DepthChoice:
        """The shallowest depth that advances and comes out, or the deepest that comes out."""
        deepest_m = next((z for z in reversed(self.grid_m) if self._comes_out(z, belief, strides)), None)
        limit_m = self.grid_m[0] if deepest_m is None else deepest_m
        firm_m = next((z for z in self.grid_m if z <= limit_m and self._advances(z, shears)), None)
        if deepest_m is None:
            return DepthChoice(limit_m, firm_m is None, reason or "extraction")
        if firm_m is None:
            return DepthChoice(limit_m, True, reason or "thrust")
        return DepthChoice(firm_m, False, reason or "both conditions hold")

    def _comes_out(self, depth_m: float, belief: MudBelief, strides: Sequence[StrideEstimate]) -> bool:
        """τ_e(z) < share · τ_m for the flipper that the mud holds harder, in a pose that can be lifted at all."""
        limit_nm = self.parameters.lifting_share * self.lifting_torque_nm
        return self.geometry.is_reachable(self.rear_rad, depth_m) and all(
            self._extraction_nm(depth_m, belief.of(stride.flipper).k_e, stride) < limit_nm for stride in strides
        )

    def _extraction_nm(self, depth_m: float, k_e: Coefficient | None, stride: StrideEstimate) -> float:
        """As strong as the doubt allows.

        A flipper that came out without ever telling k_e proves τ_e < τ_m where it was. One that stuck proves
        τ_e ≥ τ_m, and elsewhere in proportion to depth: Φ grows with z^1.3 at the rear while the coefficient falls.
        """
        surface_m = _known(stride.surface_m)
        submerged_m = depth_m - surface_m
        if submerged_m <= 0.0:
            return 0.0
        if (k_e is None or k_e.at_least) and submerged_m > _known(stride.depth_m) + GRID_M:
            return self.lifting_torque_nm
        told_nm = self._told_nm(depth_m, surface_m, k_e) if k_e else 0.0
        return max(told_nm, self.lifting_torque_nm * submerged_m / self._stuck_m.get(stride.flipper, inf))

    def _told_nm(self, depth_m: float, surface_m: float, k_e: Coefficient) -> float:
        """k_e Φ in the pose in which the flipper is pulled out."""
        adduction_rad = self.geometry.adduction_rad(self.rear_rad, depth_m)
        plate = submerged_plate(self.geometry, self.rear_rad, adduction_rad, surface_m)
        value, std_error = k_e.at(depth_m - surface_m)
        return (max(0.0, value) + DOUBT * std_error) * stroke_moment_m4(self.geometry, plate, self.rear_rad)

    def _advances(self, depth_m: float, shears: Sequence[Shear]) -> bool:
        """2 f_x(z) > f_r + f_a, with a margin where it is a prediction. One flipper speaks for both."""
        if not shears:
            return False
        resistance_n = self._resistance_n(shears)
        thrust_n = sum(self._thrust_n(depth_m, surface_m, k_s, DOUBT) for k_s, surface_m in shears)
        if 2.0 * thrust_n / len(shears) > self.parameters.thrust_margin * resistance_n:
            return True
        if not all(k_s.at_least and depth_m - z > k_s.depth_m - GRID_M / 2.0 for k_s, z in shears):
            return False
        borne_n = sum(self._thrust_n(k_s.depth_m + surface_m, surface_m, k_s, 0.0) for k_s, surface_m in shears)
        return 2.0 * borne_n / len(shears) > resistance_n

    def _thrust_n(self, depth_m: float, surface_m: float, k_s: Coefficient, doubt: float) -> float:
        """f_x = k_s ∫ζ dA with the flipper straight out; `doubt` in standard errors."""
        if depth_m <= surface_m or not self.geometry.is_reachable(0.0, depth_m):
            return 0.0
        plate = submerged_plate(self.geometry, 0.0, self.geometry.adduction_rad(0.0, depth_m), surface_m)
        value, std_error = k_s.at(depth_m - surface_m)
        return max(0.0, value - doubt * std_error) * plate.depth_moment_m3

    def _resistance_n(self, shears: Sequence[Shear]) -> float:
        """f_r + f_a."""
        width_m, depth_m = self.parameters.pad_width_m, self.parameters.pad_depth_m
        k_s = sum(k_s.at(depth_m)[0] for k_s, _ in shears) / len(shears) if depth_m > 0.0 else 0.0
        return self.parameters.body_drag_n + k_s * width_m * depth_m**2 / 2.0 + self.inertial_force_n

    @property
    def inertial_force_n(self) -> float:
        """f_a = m α l / (t_acc t_s), with the stance time t_s = 2 α l / v: half of m v / t_acc."""
        return self.parameters.body_mass_kg * self.gait.stance_speed_m_s / (2.0 * self.parameters.acceleration_s)

    @property
    def lifting_torque_nm(self) -> float:
        return self.parameters.lifting_force_n * self.geometry.flipper_length_m

    @property
    def rear_rad(self) -> float:
        return -radians(self.gait.sweep_angle_deg)


def _shears(belief: MudBelief, strides: Sequence[StrideEstimate]) -> list[Shear]:
    """k_s of every flipper that closed a stride, as far as it is known, and where its mud begins."""
    known = [(belief.k_s or belief.of(stride.flipper).k_s, _known(stride.surface_m)) for stride in strides]
    return [(k_s, surface_m) for k_s, surface_m in known if k_s]


def _known(length_m: float) -> float:
    return length_m if isfinite(length_m) else 0.0
