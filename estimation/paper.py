"""The paper's method (sections III-B and III-C), kept under its name beside the truthful one.

The published force map turns joint torques into forces. The surface is where the upward force first passes 0.5 N. From
there on, over the distinct samples of the stride,

    insertion     f_z =  k_p · A z        A: the plate's edge, width times thickness
    steady stance f_x =  k_s · b z²/2     b: the plate's width
    extraction   -f_z =  k_e · A z

are fitted by least squares, a few running sums each, and closed when swing begins. Where the body advances on solid
mud the paper adds the body's drag to f_x; half of it is this flipper's, if `compensated`.
"""

from __future__ import annotations

from math import inf, isfinite

from control.gait.recovery import is_in_mud
from control.geometry import FlipperGeometry
from control.records import NO_LOAD, UNKNOWN, DriveState, FlipperLoad, Phase, StrideEstimate
from estimation.force_map import paper_force_n
from estimation.joint_load import NO_COMMANDS, CommandTimes, FlipperDrive, JointLoads, motion_at
from estimation.stride_clock import StrideClock
from estimation.strokes.line_fit import LineFit

SURFACE_FORCE_N = 0.5  # the paper's trigger, chosen above its noise
STEADY_FRACTION = 0.6  # of the sweep's half range around the middle: the force has reached its plateau by then
MOBILISED_M = 0.002  # rise after which the mud under an extracted flipper yields instead of springing back
ADVANCED_M = 0.002  # from which the body has moved


class PaperEstimator:
    """Owns the running sums of the stride under way of one flipper."""

    def __init__(
        self,
        flipper: str,
        geometry: FlipperGeometry,
        drive: FlipperDrive,
        body_drag_n: float = 0.0,
    ) -> None:
        """`body_drag_n`: added to the thrust of both flippers while the body advances; 0 leaves it as measured."""
        self.flipper = flipper
        self.geometry = geometry
        self.body_drag_n = body_drag_n
        self.edge_m2 = geometry.plate_width_m * geometry.plate_thickness_m
        self._loads = JointLoads(geometry, drive, motion_at)
        self._clock = StrideClock()
        self._penetration, self._shear, self._extraction = LineFit(), LineFit(), LineFit()
        self.reset()

    def reset(self) -> None:
        """Forget everything, the count of strides included."""
        self._loads.reset()
        self._clock.reset()
        self._load = NO_LOAD
        self._body_at_close_m = UNKNOWN
        self._begin_stride(0.0, UNKNOWN)

    def _begin_stride(self, now_s: float, body_x_m: float) -> None:
        self._clock.begin(now_s)
        for fit in (self._penetration, self._shear, self._extraction):
            fit.reset()
        self._surface_m = UNKNOWN
        self._stuck = False
        self._deepest_m = -inf
        self._steady_rad = 0.0
        self._body_at_stance_m = self._body_at_insertion_m = UNKNOWN
        self._extraction_start_m = UNKNOWN
        self._insertion_force_n = self._stance_force_n = self._extraction_force_n = UNKNOWN
        self._extraction_nm = UNKNOWN
        if self._clock.index == 0 and not isfinite(self._body_at_close_m):
            self._body_at_close_m = body_x_m

    def update(
        self,
        now_s: float,
        phase: Phase,
        sweep: DriveState,
        adduction: DriveState,
        body_x_m: float,
        commands_s: CommandTimes = NO_COMMANDS,
    ) -> tuple[FlipperLoad, StrideEstimate | None]:
        """The load now and, on the first sample after a stride's extraction, what the stride said."""
        closed = self._change_phase(now_s, phase, body_x_m) if phase is not self._clock.phase else None
        if not isfinite(sweep.angle_rad + adduction.angle_rad + sweep.current_a + adduction.current_a):
            return NO_LOAD, closed
        load = self._loads.update(sweep, adduction, commands_s)
        if load is not None:
            length_m = self.geometry.flipper_length_m
            force_n = paper_force_n(load.sweep_rad, load.adduction_rad, load.sweep_nm, load.adduction_nm, length_m)
            self._load = FlipperLoad(load.sweep_nm, load.adduction_nm, *force_n, load.depth_m)
            self._learn(phase, load.sweep_rad, self._load, body_x_m)
        return self._load, closed

    def _learn(self, phase: Phase, sweep_rad: float, load: FlipperLoad, body_x_m: float) -> None:
        if phase is Phase.INSERTION:
            self._body_at_insertion_m = body_x_m
            self._learn_insertion(load)
        elif phase is Phase.STANCE:
            self._learn_stance(sweep_rad, load, body_x_m)
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

    def _learn_stance(self, sweep_rad: float, load: FlipperLoad, body_x_m: float) -> None:
        self._stance_force_n = _larger(load.force_x_n, self._stance_force_n)
        self._deepest_m = max(self._deepest_m, load.depth_m)
        if self._steady_rad == 0.0:
            self._steady_rad = STEADY_FRACTION * abs(sweep_rad)
            self._body_at_stance_m = body_x_m
        submerged_m = load.depth_m - self.surface_m
        if submerged_m > 0.0 and abs(sweep_rad) <= self._steady_rad:
            advanced = body_x_m - self._body_at_stance_m > ADVANCED_M
            force_x_n = load.force_x_n + (self.body_drag_n / 2.0 if advanced else 0.0)
            self._shear.update(self.geometry.plate_width_m * submerged_m * submerged_m / 2.0, force_x_n)

    def _learn_extraction(self, load: FlipperLoad) -> None:
        self._extraction_force_n = -_larger(-load.force_z_n, -self._extraction_force_n)
        self._extraction_nm = _larger(-load.adduction_torque_nm, self._extraction_nm)
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
        change = self._clock.change(now_s, phase)
        if phase is Phase.RECOVERY or change.closes_stride:
            self._stuck = self._stuck or is_in_mud(self.geometry, *self._loads.angles_rad)
        closed = self._close(now_s, body_x_m) if change.closes_stride else None
        if change.begins_stride:
            self._begin_stride(now_s, body_x_m)
        return closed

    def _close(self, now_s: float, body_x_m: float) -> StrideEstimate:
        k_p = self._penetration.estimate()
        if not isfinite(self._surface_m):
            k_p = k_p._replace(reason=f"no force above {SURFACE_FORCE_N} N in insertion")
        deepest_m = self._deepest_m if isfinite(self._deepest_m) else UNKNOWN
        estimate = StrideEstimate(
            flipper=self.flipper,
            index=self._clock.index,
            t_start_s=self._clock.start_s,
            t_end_s=now_s,
            insertion_s=self._clock.duration_s[Phase.INSERTION],
            stance_s=self._clock.duration_s[Phase.STANCE],
            extraction_s=self._clock.duration_s[Phase.EXTRACTION],
            k_p=k_p,
            k_s=self._shear.estimate(),
            k_e=self._extraction.estimate(),
            surface_m=self.surface_m,
            depth_m=deepest_m - self.surface_m,
            released=not self._stuck,
            insertion_force_n=self._insertion_force_n,
            stance_force_n=self._stance_force_n,
            extraction_force_n=self._extraction_force_n,
            step_m=body_x_m - self._body_at_close_m,
            position_m=self._body_at_insertion_m,
            extraction_torque_nm=self._extraction_nm,
        )
        self._clock.index += 1
        self._body_at_close_m = body_x_m
        return estimate


def _larger(value: float, largest: float) -> float:
    """The larger one, also while there is none yet (NaN)."""
    return largest if largest >= value else value
