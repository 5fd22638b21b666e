"""Forecast of a stride at another depth, on the safe side: what thrust the mud withstands, and the extraction torque.

The mud of one flipper withstands f_x = k_s(z) ∫ζ dA in the middle of the sweep (plate_integrals.py). Mud that yielded
gives a value of k_s; mud that did not gives only a lower bound, but the insertion gives k_p, and both depend on the one
strength of the mud: k_s = ρ k_p. ρ is 0.69 in the authors' log with a readable insertion (their 12.5N mud, 1.8 cm), and
0.43 to 0.63 by the clay practice of Matlock and Prandtl from 0.5 to 4.5 kPa and 1.8 to 3 cm. So the ratio starts
between, is corrected whenever k_s and k_p of both flippers together are known, and is never trusted to better than a
fifth. The larger of both estimates counts, since each is on the safe side. The same k_s holds the body back by its pad:
there the safe side is above the estimate.

The torque of an extraction is k_e(z) Φ in the pose at the rear end of the sweep, times the fraction of it at the peak:
k_e is that of a whole stroke, and mud's force grows more slowly with depth than the law, so the peak is less than k_e Φ
at the deepest point. The fraction is learned from the peak of every extraction, starting at 1, which is safe. Without
k_e, k_p Φ stands for that torque: k_e is 1.3 to 1.8 times k_p by clay practice (0.8 in the log above) and the fraction
about a half. A flipper that came out proves the torque it took, at every shallower depth too, and at a deeper one at
most in proportion to Φ, since k_e falls with depth. A flipper that stuck proves τ_e ≥ τ_m at its depth, despite the
estimate, and elsewhere in proportion to depth (k_e Φ is nearly so); this is remembered until a flipper comes out from
there, or the mud changes.
"""

from collections.abc import Sequence
from math import exp, fsum, inf, isfinite, log, radians

from control.geometry import FlipperGeometry
from control.limits import clip
from control.mud_estimate import NOTHING_KNOWN, Coefficient, MudEstimate
from control.parameters.gait_parameters import GaitParameters
from control.plate_integrals import stroke_moment_m4, submerged_plate
from control.records import TWO_FLIPPERS, Rig, StrideEstimate

SHEAR_RATIO = 0.55  # k_s over k_p before any mud gave both
RATIO_UNCERTAINTY = 0.2
SUCTION_RATIO = 1.0  # peak extraction torque over k_p Φ, without k_e
LEARNING = 0.25  # weight of a new stride
FRACTIONS = (0.2, 1.5)  # bounds of the learned values
RATIOS = (0.2, 1.5)
# Standard errors: a slip costs a part of a step and a deeper stride some time, a stuck flipper costs the walk.
THRUST_UNCERTAINTY, SUCTION_UNCERTAINTY = 0.5, 2.0
SAG_FRACTION = 0.25  # of the deepest sag, on average over the stance
GRID_M = 0.0025  # resolution of depths; the joints do not follow more finely in mud


class DepthForecast:
    """Owns the learned ratio and fraction, and the depth at which each flipper stuck in this mud.

    `gait` is the gait of the strides that it learns from and forecasts; a method that varies the gait sets it before
    either.
    """

    def __init__(
        self, geometry: FlipperGeometry, gait: GaitParameters, motor_force_n: float, rig: Rig = TWO_FLIPPERS
    ) -> None:
        self.geometry = geometry
        self._flippers = len(rig.flippers)
        self.gait = gait
        self.motor_force_n = motor_force_n
        self.reset()

    def reset(self) -> None:
        self.shear_ratio, self.felt_fraction = SHEAR_RATIO, 1.0
        self._fractions_learned = 0
        self._mud_estimate = NOTHING_KNOWN
        self._strides: Sequence[StrideEstimate] = ()
        self._stuck_m: dict[str, float] = {}
        self._sag_m = 0.0
        self._walked_m4: dict[str, float] = {}  # Φ of each flipper's last stride

    def update(self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float) -> None:
        """Learn from the strides that just closed, at most one a flipper, their commanded depth, and the estimate."""
        self._mud_estimate, self._strides = mud_estimate, strides
        sags_m = [stride.depth_m + stride.surface_m - walked_m for stride in strides]
        self._sag_m = SAG_FRACTION * max(0.0, min([sag_m for sag_m in sags_m if isfinite(sag_m)], default=0.0))
        if mud_estimate.boundary:
            self._stuck_m.clear()
        for stride in strides:
            surface_m = _known(stride.surface_m)
            self._walked_m4[stride.flipper] = self._lift_moment_m4(_known(stride.depth_m) + surface_m, surface_m)
            self._remember(stride)
            self._learn_fraction(stride)
        self._learn_ratio(mud_estimate)

    def _remember(self, stride: StrideEstimate) -> None:
        reached_m = max(_known(stride.depth_m), GRID_M)
        stuck_m = self._stuck_m.get(stride.flipper, inf)
        if not stride.released:
            self._stuck_m[stride.flipper] = min(reached_m, stuck_m)
        elif reached_m > stuck_m - GRID_M / 2.0:
            del self._stuck_m[stride.flipper]

    def _learn_fraction(self, stride: StrideEstimate) -> None:
        """Learn the fraction from an extraction with a k_e that came out: if stuck, the motor sets the torque."""
        reported = stride.k_e.valid and not stride.k_e.at_least and isfinite(stride.surface_m)
        if not (stride.released and reported and stride.depth_m > 0.0):
            return
        whole_nm = stride.k_e.value * self._walked_m4[stride.flipper]
        if whole_nm > 0.0 and stride.extraction_torque_nm > 0.0:
            self._fractions_learned += 1
            weight = max(LEARNING, 1.0 / self._fractions_learned)
            fraction = stride.extraction_torque_nm / whole_nm
            self.felt_fraction = clip(self.felt_fraction * (fraction / self.felt_fraction) ** weight, *FRACTIONS)

    def _learn_ratio(self, mud_estimate: MudEstimate) -> None:
        k_s, k_p = mud_estimate.k_s, mud_estimate.k_p
        if k_s is None or k_p is None or k_s.at_least or k_p.at_least:
            return
        pressed = k_p.at(k_s.depth_m)[0]
        ratio = k_s.value / pressed if pressed > 0.0 else 0.0
        if ratio > 0.0 and isfinite(ratio):
            self.shear_ratio = clip(exp(log(self.shear_ratio) + LEARNING * log(ratio / self.shear_ratio)), *RATIOS)

    def reached_m(self, commanded_m: float) -> float:
        """Return the depth reached under load, which is more than commanded, within the flipper's reach."""
        return min(commanded_m + self._sag_m, self.geometry.deepest_m(self.gait.sweep_angle_deg))

    def yield_n(self, commanded_m: float) -> float | None:
        """Return the thrust at which the mud of all flippers yields; None if its shear resistance is unknown."""
        depth_m = self.reached_m(commanded_m)
        reported = [self._yield_n(stride, depth_m) for stride in self._strides]
        known = [yield_n for yield_n in reported if yield_n is not None]
        return self._flippers * fsum(known) / len(known) if known else None

    def _yield_n(self, stride: StrideEstimate, depth_m: float) -> float | None:
        surface_m = _known(stride.surface_m)
        if depth_m <= surface_m or not self.geometry.is_reachable(0.0, depth_m):
            return 0.0
        ratio = (1.0 - THRUST_UNCERTAINTY * RATIO_UNCERTAINTY) * self.shear_ratio
        k_s = self._shear(stride.flipper, depth_m - surface_m, -THRUST_UNCERTAINTY, ratio)
        if k_s is None:
            return None
        plate = submerged_plate(self.geometry, 0.0, self.geometry.adduction_rad(0.0, depth_m), surface_m)
        return k_s * plate.depth_moment_m3

    def _shear(self, flipper: str, submerged_m: float, std_errors: float, ratio: float) -> float | None:
        """Return k_s by itself and by `ratio` times k_p, each with so many of its standard errors; None if unknown."""
        mud_estimate = self._mud_estimate
        k_s, k_p = mud_estimate.k_s or mud_estimate.of(flipper).k_s, mud_estimate.k_p or mud_estimate.of(flipper).k_p
        reported = None if k_s is None else _shifted(k_s, submerged_m, std_errors)
        if k_p is None or (k_s is not None and not k_s.at_least):
            return reported
        felt = ratio * _shifted(k_p, submerged_m, std_errors)
        return felt if reported is None else max(felt, reported)

    def drag_shear(self, depth_m: float) -> float:
        """Return k_s at the depth of the body's pad, on the safe side for drag: the flippers' mean, 0 if unknown."""
        shears = [self._shear(each.flipper, depth_m, THRUST_UNCERTAINTY, self.shear_ratio) for each in self._strides]
        reported = [shear or 0.0 for shear in shears]
        return fsum(reported) / len(reported) if reported and depth_m > 0.0 else 0.0

    def extraction_nm(self, commanded_m: float) -> float:
        """Return the extraction torque of the flipper that needs more."""
        depth_m = self.reached_m(commanded_m)
        return max((self._extraction_nm(stride, depth_m) for stride in self._strides), default=0.0)

    def _extraction_nm(self, stride: StrideEstimate, depth_m: float) -> float:
        surface_m = _known(stride.surface_m)
        submerged_m = depth_m - surface_m
        if submerged_m <= 0.0:
            return 0.0
        moment_m4 = self._lift_moment_m4(depth_m, surface_m)
        estimated_nm = self._estimated_nm(stride, submerged_m, moment_m4)
        if stride.released and stride.extraction_torque_nm > 0.0 and stride.depth_m > 0.0:
            estimated_nm = min(estimated_nm, self._proven_nm(stride, moment_m4))
        held_nm = self.lifting_torque_nm * submerged_m / self._stuck_m.get(stride.flipper, inf)
        return max(estimated_nm, held_nm)

    def _proven_nm(self, stride: StrideEstimate, moment_m4: float) -> float:
        """Return the torque that the last extraction took, scaled to a deeper one as if k_e did not fall with depth."""
        walked_m4 = self._walked_m4[stride.flipper]
        return stride.extraction_torque_nm * max(1.0, moment_m4 / walked_m4) if walked_m4 > 0.0 else inf

    def _estimated_nm(self, stride: StrideEstimate, submerged_m: float, moment_m4: float) -> float:
        """Return the torque by k_e, else by k_p; without either, the motor's limit below the depth reached so far."""
        flipper = self._mud_estimate.of(stride.flipper)
        k_e, k_p = self._mud_estimate.k_e or flipper.k_e, self._mud_estimate.k_p or flipper.k_p
        estimated_nm = self.felt_fraction * _more(k_e, submerged_m) * moment_m4 if k_e is not None else 0.0
        if k_e is not None and not k_e.at_least:
            return estimated_nm
        if k_p is not None:
            return max(estimated_nm, SUCTION_RATIO * _more(k_p, submerged_m) * moment_m4)
        return self.lifting_torque_nm if submerged_m > _known(stride.depth_m) + GRID_M else estimated_nm

    def _lift_moment_m4(self, depth_m: float, surface_m: float) -> float:
        """Return Φ in the pose of the extraction; 0 if a fitted surface puts it out of reach."""
        reached_m = min(depth_m, self.geometry.deepest_m(self.gait.sweep_angle_deg))
        if not self.geometry.is_reachable(self.rear_rad, reached_m):
            return 0.0
        adduction_rad = self.geometry.adduction_rad(self.rear_rad, reached_m)
        plate = submerged_plate(self.geometry, self.rear_rad, adduction_rad, surface_m)
        return stroke_moment_m4(self.geometry, plate, self.rear_rad)

    @property
    def lifting_torque_nm(self) -> float:
        return self.motor_force_n * self.geometry.flipper_length_m

    @property
    def rear_rad(self) -> float:
        return -radians(self.gait.sweep_angle_deg)


def _shifted(k: Coefficient, depth_m: float, std_errors: float) -> float:
    value, std_error = k.at(depth_m)
    return max(0.0, value + std_errors * std_error)


def _more(k: Coefficient, depth_m: float) -> float:
    value, std_error = k.at(depth_m)
    return max(0.0, value) + SUCTION_UNCERTAINTY * std_error


def _known(length_m: float) -> float:
    return length_m if isfinite(length_m) else 0.0
