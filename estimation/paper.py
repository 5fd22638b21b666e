"""The paper's method of estimation (sections III-B and III-C), with its biases, for comparison.

The published force map turns joint torques into forces. The surface is the depth where the upward force first exceeds
0.5 N. Below it, over the distinct samples of the stride,

    insertion     f_z =  k_p · A z        A: the plate's edge, width times thickness
    steady stance f_x =  k_s · b z²/2     b: the plate's width
    extraction   -f_z =  k_e · A z

(for a plate that is no rectangle the mean widths with which A z and b z²/2 are its submerged volume and its moment)
are fitted by least squares with a few running sums each, and closed when swing begins. If the body advances on solid
mud the paper adds the body's drag to f_x; with `compensation`, half of it is added to each flipper's force.
"""

from math import isfinite

from control.computing.bounded_work import Work, WorkQueue, finished
from control.geometry import FlipperGeometry
from control.plate_integrals import mean_width_m, moment_width_m
from control.records import UNKNOWN, FlipperLoad, Phase
from estimation.force_map import paper_force_n
from estimation.joint_load import FlipperDrive, JointLoad, motion_at
from estimation.stride_estimator import Learned, StrideEstimator, larger
from estimation.strokes.line_fit import LineFit

SURFACE_FORCE_N = 0.5  # the paper's trigger, chosen above its noise
STEADY_FRACTION = 0.6  # of the sweep's half range around the middle: the force has reached its plateau by then
MOBILISED_M = 0.002  # rise after which the mud under an extracted flipper yields instead of springing back
ADVANCED_M = 0.002  # from here on the body counts as advancing


class PaperEstimator(StrideEstimator):
    """Owns the running sums of the stride under way of one flipper."""

    def __init__(
        self,
        flipper: str,
        geometry: FlipperGeometry,
        drive: FlipperDrive,
        drag_n: float = 0.0,
        work: WorkQueue | None = None,
    ) -> None:
        """`drag_n`, the body's drag on each flipper, is added to the thrust while the body advances; 0: as measured."""
        self.drag_n = drag_n
        self._penetration, self._shear, self._extraction = LineFit(), LineFit(), LineFit()
        super().__init__(flipper, geometry, drive, motion_at, work)

    def _reset_stride(self) -> None:
        for fit in (self._penetration, self._shear, self._extraction):
            fit.reset()
        self._surface_m = UNKNOWN
        self._steady_rad = 0.0
        self._body_at_stance_m = UNKNOWN
        self._extraction_start_m = UNKNOWN
        self._extraction_nm = UNKNOWN

    def _learn(self, now_s: float, phase: Phase, load: JointLoad, body_x_m: float) -> None:
        length_m = self.geometry.flipper_length_m
        force_n = paper_force_n(load.sweep_rad, load.adduction_rad, load.sweep_nm, load.adduction_nm, length_m)
        self.load = FlipperLoad(load.sweep_nm, load.adduction_nm, *force_n, load.depth_m)
        self._record_extremes(phase, self.load, body_x_m)
        if phase is Phase.INSERTION:
            self._learn_insertion(self.load)
        elif phase is Phase.STANCE:
            self._learn_stance(load.sweep_rad, self.load, body_x_m)
        elif phase is Phase.EXTRACTION:
            self._learn_extraction(self.load)

    def _learn_insertion(self, load: FlipperLoad) -> None:
        if not isfinite(self._surface_m):
            if load.force_z_n <= SURFACE_FORCE_N:
                return
            self._surface_m = load.depth_m
        self._deepest_m = larger(load.depth_m, self._deepest_m)
        if load.depth_m >= self._surface_m:
            self._penetration.update(self._volume_m3(load.depth_m - self._surface_m), load.force_z_n)

    def _learn_stance(self, sweep_rad: float, load: FlipperLoad, body_x_m: float) -> None:
        self._deepest_m = larger(load.depth_m, self._deepest_m)
        if self._steady_rad == 0.0:
            self._steady_rad = STEADY_FRACTION * abs(sweep_rad)
            self._body_at_stance_m = body_x_m
        submerged_m = load.depth_m - self.surface_m
        if submerged_m > 0.0 and abs(sweep_rad) <= self._steady_rad:
            advanced = body_x_m - self._body_at_stance_m > ADVANCED_M
            force_x_n = load.force_x_n + (self.drag_n if advanced else 0.0)
            width_m = moment_width_m(self.geometry, submerged_m)
            self._shear.update(width_m * submerged_m * submerged_m / 2.0, force_x_n)

    def _learn_extraction(self, load: FlipperLoad) -> None:
        self._extraction_nm = larger(-load.adduction_torque_nm, self._extraction_nm)
        if not isfinite(self._extraction_start_m):
            self._extraction_start_m = load.depth_m
        submerged_m = load.depth_m - self.surface_m
        if submerged_m > 0.0 and load.depth_m < self._extraction_start_m - MOBILISED_M:
            self._extraction.update(self._volume_m3(submerged_m), -load.force_z_n)

    def _volume_m3(self, submerged_m: float) -> float:
        return mean_width_m(self.geometry, submerged_m) * self.geometry.plate_thickness_m * submerged_m

    @property
    def surface_m(self) -> float:
        """The detected surface, or the nominal one before it is detected."""
        return self._surface_m if isfinite(self._surface_m) else 0.0

    def _learned(self) -> Work[Learned]:
        k_p = self._penetration.estimate()
        if not isfinite(self._surface_m):
            k_p = k_p._replace(reason=f"no force above {SURFACE_FORCE_N} N in insertion")
        depth_m = self._deepest_m - self.surface_m
        learned = Learned(
            k_p=k_p._replace(depth_m=depth_m),
            k_s=self._shear.estimate()._replace(depth_m=depth_m),
            k_e=self._extraction.estimate()._replace(depth_m=depth_m),
            surface_m=self.surface_m,
            extraction_torque_nm=self._extraction_nm,
        )
        return finished(learned)
