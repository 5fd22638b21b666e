"""What one flipper learns from one stride: the paper's method (sections III-B and III-C), sample by sample.

The surface is where the upward force first passes 0.5 N. From there on, over the distinct samples of the stride,

    insertion     f_z =  k_p · A z        A: the plate's edge, width times thickness
    steady stance f_x =  k_s · b z²/2     b: the plate's width
    extraction   -f_z =  k_e · A z

are fitted by least squares, a few running sums each, and closed when swing begins. A message that is read a second
time carries nothing new and does not count again.
"""

from __future__ import annotations

from math import inf, isfinite

from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass
from control.records import NO_LOAD, UNKNOWN, FlipperLoad, Phase, StrideEstimate
from estimation.force_map import mud_torque_nm, paper_force_n
from estimation.line_fit import LineFit

SURFACE_FORCE_N = 0.5  # the paper's trigger, chosen above its noise
STEADY_SHARE = 0.6  # of the sweep's half range around the middle: the force has reached its plateau by then
MOBILISED_M = 0.002  # rise after which the mud under an extracted flipper yields instead of springing back
RELEASED_M = 0.003  # depth up to which a flipper counts as out of the mud

STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION)


class FlipperEstimator:
    """Owns the running sums of the stride under way of one flipper."""

    def __init__(
        self,
        flipper: str,
        geometry: FlipperGeometry,
        mass: ArmMass,
        sweep_constant_nm_a: float,
        adduction_constant_nm_a: float,
    ) -> None:
        self.flipper = flipper
        self.geometry = geometry
        self.mass = mass
        self.sweep_constant_nm_a = sweep_constant_nm_a
        self.adduction_constant_nm_a = adduction_constant_nm_a
        self.edge_m2 = geometry.plate_width_m * geometry.plate_thickness_m
        self._penetration, self._shear, self._extraction = LineFit(), LineFit(), LineFit()
        self.reset()

    def reset(self) -> None:
        """Forget everything, the count of strides included."""
        self._index = 0
        self._phase = Phase.REST
        self._last_sample = (UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)
        self._last_motion = (UNKNOWN, UNKNOWN, UNKNOWN)
        self._load = NO_LOAD
        self._body_at_close_m = UNKNOWN
        self._begin_stride(0.0, UNKNOWN)

    def _begin_stride(self, now_s: float, body_x_m: float) -> None:
        for fit in (self._penetration, self._shear, self._extraction):
            fit.reset()
        self._start_s = now_s
        self._duration_s = {phase: 0.0 for phase in STROKES}
        self._phase_start_s = now_s
        self._surface_m = UNKNOWN
        self._deepest_m = -inf
        self._steady_rad = 0.0
        self._extraction_start_m = UNKNOWN
        self._insertion_force_n = self._stance_force_n = self._extraction_force_n = UNKNOWN
        if self._index == 0 and not isfinite(self._body_at_close_m):
            self._body_at_close_m = body_x_m

    def update(
        self,
        now_s: float,
        phase: Phase,
        sweep_rad: float,
        adduction_rad: float,
        sweep_velocity_rad_s: float,
        adduction_velocity_rad_s: float,
        sweep_current_a: float,
        adduction_current_a: float,
        body_x_m: float,
    ) -> tuple[FlipperLoad, StrideEstimate | None]:
        """The load now and, on the first sample after a stride's extraction, what the stride said."""
        closed = self._change_phase(now_s, phase, body_x_m) if phase is not self._phase else None
        sample = (sweep_rad, adduction_rad, sweep_current_a, adduction_current_a)
        if not isfinite(sum(sample)):
            return NO_LOAD, closed
        if sample == self._last_sample:
            return self._load, closed
        self._last_sample = sample
        accelerations = self._accelerations(now_s, sweep_velocity_rad_s, adduction_velocity_rad_s)
        self._load = self._mud_load(*sample, *accelerations)
        self._learn(phase, sweep_rad, self._load)
        return self._load, closed

    def _accelerations(self, now_s: float, sweep_rad_s: float, adduction_rad_s: float) -> tuple[float, float]:
        """rad/s² of both joints since the last distinct sample; zero where velocities are not known."""
        last_s, last_sweep_rad_s, last_adduction_rad_s = self._last_motion
        self._last_motion = (now_s, sweep_rad_s, adduction_rad_s)
        rates = (sweep_rad_s - last_sweep_rad_s, adduction_rad_s - last_adduction_rad_s)
        if not (now_s > last_s and isfinite(sum(rates))):
            return 0.0, 0.0
        return rates[0] / (now_s - last_s), rates[1] / (now_s - last_s)

    def _mud_load(
        self,
        sweep_rad: float,
        adduction_rad: float,
        sweep_current_a: float,
        adduction_current_a: float,
        sweep_rad_s2: float,
        adduction_rad_s2: float,
    ) -> FlipperLoad:
        mass, geometry = self.mass, self.geometry
        gravity_sweep_nm, gravity_adduction_nm = mass.gravity_torques_nm(sweep_rad, adduction_rad)
        sweep_nm = mud_torque_nm(
            self.sweep_constant_nm_a * sweep_current_a, gravity_sweep_nm, mass.sweep_inertia_kg_m2 * sweep_rad_s2
        )
        adduction_nm = mud_torque_nm(
            self.adduction_constant_nm_a * adduction_current_a,
            gravity_adduction_nm,
            mass.adduction_inertia_kg_m2 * adduction_rad_s2,
        )
        force_n = paper_force_n(sweep_rad, adduction_rad, sweep_nm, adduction_nm, geometry.flipper_length_m)
        return FlipperLoad(sweep_nm, adduction_nm, *force_n, geometry.depth_m(sweep_rad, adduction_rad))

    def _learn(self, phase: Phase, sweep_rad: float, load: FlipperLoad) -> None:
        if phase is Phase.INSERTION:
            self._learn_insertion(load)
        elif phase is Phase.STANCE:
            self._learn_stance(sweep_rad, load)
        elif phase is Phase.EXTRACTION:
            self._learn_extraction(load)

    def _learn_insertion(self, load: FlipperLoad) -> None:
        self._insertion_force_n = _larger(load.force_z_n, self._insertion_force_n)
        if not isfinite(self._surface_m):
            if load.force_z_n <= SURFACE_FORCE_N:
                return
            self._surface_m = load.depth_m
        self._deepest_m = max(self._deepest_m, load.depth_m)
        if load.depth_m >= self._surface_m:
            self._penetration.update(self.edge_m2 * (load.depth_m - self._surface_m), load.force_z_n)

    def _learn_stance(self, sweep_rad: float, load: FlipperLoad) -> None:
        self._stance_force_n = _larger(load.force_x_n, self._stance_force_n)
        self._deepest_m = max(self._deepest_m, load.depth_m)
        if self._steady_rad == 0.0:
            self._steady_rad = STEADY_SHARE * abs(sweep_rad)
        submerged_m = load.depth_m - self.surface_m
        if submerged_m > 0.0 and abs(sweep_rad) <= self._steady_rad:
            self._shear.update(self.geometry.plate_width_m * submerged_m * submerged_m / 2.0, load.force_x_n)

    def _learn_extraction(self, load: FlipperLoad) -> None:
        self._extraction_force_n = -_larger(-load.force_z_n, -self._extraction_force_n)
        if not isfinite(self._extraction_start_m):
            self._extraction_start_m = load.depth_m
        submerged_m = load.depth_m - self.surface_m
        if submerged_m > 0.0 and load.depth_m < self._extraction_start_m - MOBILISED_M:
            self._extraction.update(self.edge_m2 * submerged_m, -load.force_z_n)

    @property
    def surface_m(self) -> float:
        """The detected surface, or the nominal one while none was found."""
        return self._surface_m if isfinite(self._surface_m) else 0.0

    def _change_phase(self, now_s: float, phase: Phase, body_x_m: float) -> StrideEstimate | None:
        if self._phase in STROKES:
            self._duration_s[self._phase] = now_s - self._phase_start_s
        closed = None
        if phase in (Phase.SWING, Phase.INSERTION, Phase.REST):
            complete = all(duration_s > 0.0 for duration_s in self._duration_s.values())
            cut_short = phase is Phase.REST  # the walk was ended within the stride
            closed = self._close(now_s, body_x_m) if complete and not cut_short else None
            self._begin_stride(now_s, body_x_m)
        self._phase = phase
        self._phase_start_s = now_s
        return closed

    def _close(self, now_s: float, body_x_m: float) -> StrideEstimate:
        k_p = self._penetration.estimate()
        if not isfinite(self._surface_m):
            k_p = k_p._replace(reason=f"no force above {SURFACE_FORCE_N} N in insertion")
        deepest_m = self._deepest_m if isfinite(self._deepest_m) else UNKNOWN
        estimate = StrideEstimate(
            flipper=self.flipper,
            index=self._index,
            t_start_s=self._start_s,
            t_end_s=now_s,
            insertion_s=self._duration_s[Phase.INSERTION],
            stance_s=self._duration_s[Phase.STANCE],
            extraction_s=self._duration_s[Phase.EXTRACTION],
            k_p=k_p,
            k_s=self._shear.estimate(),
            k_e=self._extraction.estimate(),
            surface_m=self.surface_m,
            depth_m=deepest_m - self.surface_m,
            released=not self._load.depth_m > self.surface_m + RELEASED_M,
            insertion_force_n=self._insertion_force_n,
            stance_force_n=self._stance_force_n,
            extraction_force_n=self._extraction_force_n,
            step_m=body_x_m - self._body_at_close_m,
        )
        self._index += 1
        self._body_at_close_m = body_x_m
        return estimate


def _larger(value: float, largest: float) -> float:
    """The larger one, also while there is none yet (NaN)."""
    return largest if largest >= value else value
