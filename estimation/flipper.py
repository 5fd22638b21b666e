"""The default method of estimation: one flipper's stride, fitted in torque space.

Each stroke is stored as batches of equal travel (stroke.py). At the end of the insertion the estimator finds the
surface (surface.py) and fits k_p; when the stride closes it fits k_e (stroke_fit.py), and fits or bounds k_s
(shear.py). The clinging weight and the joint's friction are measured again in every swing (tare.py, air.py). A stride
without evidence of mud has no coefficients. The coefficients are linear in the joint torques, so the fits need no third
force component, which two torques cannot determine; forces are mapped for display only.

The fits run in units of bounded work (control/computing/bounded_work.py). The surface of an insertion corrects the
tare, which the loads of the following stance contain. So samples of the stance wait until the tare is corrected, and
the results do not depend on when the units run; only the displayed forces use the previous tare until then. A stance
that ends before the units finishes them at once.
"""

from collections.abc import Sequence
from functools import partial
from math import copysign, cos, hypot, inf, isfinite
from typing import NamedTuple

from control.computing.bounded_work import Work, WorkQueue, finished
from control.geometry import FlipperGeometry
from control.plate_integrals import cross_coupling, growth_exponent, submerged_plate
from control.records import UNKNOWN, Estimate, FlipperLoad, Phase
from estimation.force_map import smallest_force_n
from estimation.joint_load import FlipperDrive, JointLoad, motion_between
from estimation.stride_estimator import Learned, StrideEstimator, larger
from estimation.strokes.air import AirSwing
from estimation.strokes.fit_samples import NO_FITS, StrideFits
from estimation.strokes.lift import lift_uncertainty
from estimation.strokes.origin_fit import median
from estimation.strokes.scatter_memory import ScatterMemory
from estimation.strokes.shear import Base, Shear, find_shear, shear_samples, sheared_stroke, yield_force_n
from estimation.strokes.stroke import Batch, Stroke
from estimation.strokes.stroke_fit import (
    NOT_THERE,
    bound_extraction,
    evaluated,
    extraction_samples,
    fit_extraction,
    fit_insertion,
    insertion_samples,
    level_free,
    levelling_m,
    slide_free,
)
from estimation.strokes.surface import NO_SURFACE, Surface, find_surface
from estimation.strokes.surface_memory import SurfaceMemory, unknown_surface
from estimation.strokes.tare import Tare, Zero
from estimation.strokes.withstood import SHALLOWEST_M

STEPS_M = {Phase.INSERTION: 0.0015, Phase.STANCE: 0.006, Phase.EXTRACTION: 0.001}
OWN_ERROR_M = 0.002  # offset between the mud's surface and the depth where a stroke's own force begins
TWO_SURFACES = "the strokes find two surfaces"
NO_MUD = "no evidence of mud: the torques are those of friction"
DRAGGED = "the swing drags mud: its torque is too much of the stance's"
# of k_p and k_e on a path whose body moves: its advance slides the plate along its edge, so that what sticks to its
# faces (in clay 27 % of k_e and 46 % of k_p at 3 cm) holds it less; at 60° half of that is lost
OUTWARD_UNCERTAINTY = 0.15
HIGHEST_SURFACE = 3.0  # standard errors above the nominal height
FREE_FRACTION = 0.4  # of the clearance: an edge this far above the mud is in free air


class ClosingStride(NamedTuple):
    """The measurements of a stride from which its coefficients are fitted."""

    stance: Stroke
    extraction: Stroke
    surface: Surface
    k_p: Estimate
    deepest_m: float
    is_stuck: bool  # the flipper did not come out
    zero: Zero
    tare_drift_n: float
    friction_error_nm: float
    unknown_friction_nm: float  # of a joint whose friction no swing has shown
    along_path: bool


class FlipperEstimator(StrideEstimator):
    """Owns the strokes, the surfaces, the friction and the tare of one flipper."""

    def __init__(
        self,
        flipper: str,
        geometry: FlipperGeometry,
        drive: FlipperDrive,
        base: Base = Base.FREE,
        drag_n: float = 0.0,
        surface_error_m: float = 0.001,
        lift_n: float = inf,
        work: WorkQueue | None = None,
    ) -> None:
        self.base = base
        self.drag_n = drag_n  # of the body on each flipper
        self.surface_error_m = surface_error_m
        self.lift_n = lift_n  # of each flipper together, that may lift the body
        self._surfaces = SurfaceMemory(surface_error_m, base is Base.FIXED)
        self._own_surfaces = SurfaceMemory(max(surface_error_m, OWN_ERROR_M), base is Base.FIXED)
        self._air = AirSwing()
        self._free_m = -FREE_FRACTION * geometry.clearance_m
        self._tare = Tare()
        self._extractions = ScatterMemory()
        super().__init__(flipper, geometry, drive, motion_between, work)

    def reset(self) -> None:
        self._tare.reset()
        self._air.reset()
        self._surfaces.reset()
        self._own_surfaces.reset()
        self._extractions.reset()
        self._travel_m = self._swept_m = UNKNOWN
        self._along_path = False  # the stroke under way is a part of a path
        self._direction = 1.0  # of a stance that pushes the body forward: it begins in front of the joint; -1: backward
        self._is_fitting = self._is_taring = False  # the work of the last insertion
        self._waiting: list[tuple[float, Phase, JointLoad, float]] = []  # samples, until the tare is corrected
        super().reset()

    def _reset_stride(self) -> None:
        self._strokes = {phase: Stroke(step_m) for phase, step_m in STEPS_M.items()}
        self._surface = unknown_surface(self.surface_error_m)
        self._k_p = NOT_THERE
        self._lift = 0.0

    def _learn(self, now_s: float, phase: Phase, load: JointLoad, body_x_m: float) -> None:
        if self._is_taring:
            self._waiting.append((now_s, phase, load, body_x_m))
            self._update_load(phase, load)
        else:
            self._learn_now(now_s, phase, load, body_x_m)

    def _learn_now(self, now_s: float, phase: Phase, load: JointLoad, body_x_m: float) -> None:
        sweep_rad, adduction_rad, depth_m = load[:3]
        if phase not in self._strokes and depth_m < self._free_m and phase is not Phase.RECOVERY:
            self._tare.update(load.rise_clinging_m, load.adduction_nm)
            self._air.update(sweep_rad, load.sweep_nm)
        sweep_nm, adduction_nm = self._update_load(phase, load)
        stroke = self._strokes.get(phase)
        if stroke is not None:
            pose_and_load = sweep_rad, adduction_rad, sweep_nm, adduction_nm, body_x_m, load.saturated
            swept_m = self.geometry.flipper_length_m * sweep_rad
            self._travel_m = swept_m if phase is Phase.STANCE else depth_m
            stroke.update(now_s, self._travel_m, *pose_and_load)
            if self._is_path and depth_m > 0.0:
                self._strokes[Phase.STANCE].update(now_s, swept_m, *pose_and_load)
                self._swept_m = swept_m
                self._record_extremes(Phase.STANCE, self.load, body_x_m)
            if phase is not Phase.EXTRACTION:
                self._deepest_m = larger(depth_m, self._deepest_m)
            self._record_extremes(phase, self.load, body_x_m)

    def _update_load(self, phase: Phase, load: JointLoad) -> tuple[float, float]:
        """Set `load`; return the torques of the mud on sweep and adduction."""
        sweep_rad, adduction_rad, depth_m = load[:3]
        sweep_nm, adduction_nm = self._mud_torques_nm(phase, load)
        force_x_n, force_z_n = smallest_force_n(self.geometry, sweep_rad, adduction_rad, sweep_nm, adduction_nm)
        if phase is Phase.STANCE:
            force_z_n = UNKNOWN
        self.load = FlipperLoad(sweep_nm, adduction_nm, force_x_n, force_z_n, depth_m)
        return sweep_nm, adduction_nm

    def _mud_torques_nm(self, phase: Phase, load: JointLoad) -> tuple[float, float]:
        """Return the load on sweep and adduction without the clinging mud, and without friction in a stroke."""
        friction_nm, weight_n = self._air.friction_nm, self._tare.zero.weight_n
        sweep_nm = load.sweep_nm + weight_n * load.rise_sweep_m
        adduction_nm = load.adduction_nm + weight_n * load.rise_clinging_m
        if phase is Phase.STANCE or (self._is_path and phase in self._strokes):
            sweep_nm -= self._direction * friction_nm
        if phase is Phase.INSERTION:
            adduction_nm -= friction_nm
        elif phase is Phase.EXTRACTION:
            adduction_nm += friction_nm
        return sweep_nm, adduction_nm

    def _end_phase(self, now_s: float, ended: Phase) -> None:
        if ended in self._strokes:
            self._finish_insertion()
            self._strokes[ended].close(now_s, self._travel_m)
        if ended is Phase.INSERTION:
            self._along_path = self._is_path
            self._is_fitting = self._is_taring = True
            self.work.add(self._learn_insertion(self._strokes[Phase.INSERTION], self._is_path))
        elif ended is Phase.EXTRACTION:
            self._strokes[Phase.STANCE].close(now_s, self._swept_m)  # of a path, which does both at once

    def _finish_insertion(self) -> None:
        if self._is_fitting:
            self.work.finish()

    def _begin_phase(self, phase: Phase) -> None:
        if phase in (Phase.INSERTION, Phase.STANCE):
            self._direction = copysign(1.0, self._loads.angles_rad[0])
        if phase is Phase.INSERTION:
            self._finish_insertion()
            self._air.close()
            self._tare.set_zero(self._air.is_air)

    def _learn_insertion(self, insertion: Stroke, is_path: bool) -> Work[None]:
        """Find the surface and correct the tare by the force above it.

        The fit of k_p is queued last, so that no flipper's tare waits for the fit of another flipper. On a path the
        load across the face is as large as in a stance, so it is subtracted before the surface is known; and a path
        that begins at the surface shows neither the surface nor the force above it.
        """
        batches = insertion.moving()
        length_m, arm_m = self.geometry.flipper_length_m, hypot(self.geometry.flipper_length_m, self.geometry.drop_m)
        depths_m = [b.travel_m for b in batches]
        across_nm = [_across_nm(self.geometry, b) if is_path else 0.0 for b in batches]
        forces_n = [
            (b.adduction_nm - across) / (arm_m * cos(b.sweep_rad)) for b, across in zip(batches, across_nm, strict=True)
        ]
        samples = sum([b.samples for b in batches])
        sample_m = (depths_m[-1] - depths_m[0]) / samples if samples else 0.0
        begins_in_air = not is_path or (depths_m and depths_m[0] < -HIGHEST_SURFACE * self.surface_error_m)
        found = (yield from find_surface(depths_m, forces_n)) if begins_in_air else NO_SURFACE
        yield
        surface = self._surfaces.update(found, sample_m)
        level_n, level_error_n = (value * arm_m / length_m for value in surface[2:4])
        corrected_n = self._tare.correct(-level_n, level_error_n)
        self._learn_waiting()
        below = level_free(batches, -corrected_n * length_m)
        self.work.add(self._fit_insertion(insertion, below, found, surface))

    def _fit_insertion(self, insertion: Stroke, below: Sequence[Batch], found: Surface, surface: Surface) -> Work[None]:
        """Fit k_p from the depth where the stroke's own force begins.

        A lag between angle and current shifts this depth and the force alike.
        """
        own = self._own_surfaces.update(found, 0.0)
        yield
        k_p = yield from fit_insertion(self.geometry, below, own, (self._tare.zero.std_error_n, 0.0))
        lift = 0.0
        if self.lift_n < inf:
            yield
            lift = yield from lift_uncertainty(self.geometry, below, own.depth_m, self.lift_n)
        if self._strokes[Phase.INSERTION] is insertion:  # else a stop ended the stride
            self._surface, self._k_p, self._lift = surface, k_p, lift
        self.fits = StrideFits(k_p=partial(insertion_samples, self.geometry, below, own))
        self._is_fitting = False

    def _learn_waiting(self) -> None:
        """Learn the samples that waited for the corrected tare."""
        self._is_taring = False
        for sample in self._waiting:
            self._learn_now(*sample)
        self._waiting.clear()

    @property
    def surface_m(self) -> float:
        """The estimated depth of the surface below its nominal height."""
        return self._surface.depth_m

    def _learned(self) -> Work[Learned]:
        stance, extraction = self._strokes[Phase.STANCE], self._strokes[Phase.EXTRACTION]
        self.lift = self._lift
        if self._direction < 0.0 and stance.batches and stance.batches[0].travel_m < stance.batches[-1].travel_m:
            stance.mirror()
        if not self._met_mud(stance.batches, extraction.batches):
            self.fits = NO_FITS
            dragged = self._air.is_dragging(self._pushed_nm(stance.batches))
            no_mud = NOT_THERE._replace(reason=DRAGGED if dragged else NO_MUD)
            return finished(Learned(no_mud, no_mud, no_mud, self.surface_m, extraction_torque_nm=UNKNOWN))
        stride = ClosingStride(
            stance=stance,
            extraction=extraction,
            surface=self._surface,
            k_p=self._k_p,
            deepest_m=self._deepest_m,
            is_stuck=self._stuck and self._is_held,
            zero=self._tare.zero,
            tare_drift_n=self._tare.drift_n,
            friction_error_nm=self._air.std_error_nm,
            unknown_friction_nm=self._air.unknown_nm,
            along_path=self._along_path,
        )
        return self._learn_stride(stride)

    def _learn_stride(self, stride: ClosingStride) -> Work[Learned]:
        """Fit k_s and k_e; the next stride may have begun, so no state of the stride under way is read."""
        stance, extraction, surface = stride.stance, stride.extraction, stride.surface
        known = self.geometry, stance.batches, surface.depth_m, self.base, self.drag_n, stride.along_path
        shear = yield from find_shear(*known)
        yield
        rising = extraction.moving()
        if stride.along_path and self.base is Base.FREE and shear.fit is not None:
            under_m = max(stride.deepest_m - surface.depth_m, SHALLOWEST_M)
            rising = slide_free(self.geometry, rising, surface.depth_m, shear.fit.slope, under_m)
        k_e = yield from self._learn_extraction(stride, rising)
        yield
        force_n, force_error_n = yield_force_n(self.geometry, stance.batches, shear, stride.friction_error_nm)
        yield
        self.fits = self.fits._replace(
            k_s=partial(shear_samples, self.geometry, stance.batches, surface.depth_m, shear, stance.mirrored),
            k_e=partial(extraction_samples, self.geometry, rising, surface, extraction.first_m),
        )
        outward = OUTWARD_UNCERTAINTY if stride.along_path and self.base is Base.FREE else 0.0
        return Learned(
            k_p=_widened(_named(stride.k_p, surface), outward),
            k_s=_widened(_named(self._shear_estimate(shear, stride), surface), shear.oblique),
            k_e=_widened(_named(k_e, surface), outward),
            surface_m=surface.depth_m,
            extraction_torque_nm=max([-batch.adduction_nm for batch in extraction.batches], default=UNKNOWN),
            surface_std_error_m=surface.std_error_m,
            other_surface_m=surface.other_m,
            stance=shear.case,
            yield_force_n=force_n,
            yield_force_std_error_n=force_error_n,
            tare_n=max(0.0, stride.zero.weight_n),
            tare_drift_n=stride.tare_drift_n,
        )

    def _met_mud(self, stance: Sequence[Batch], extraction: Sequence[Batch]) -> bool:
        """Return whether the stance or the extraction needs more torque than friction."""
        pulled_nm = median([-batch.adduction_nm for batch in extraction]) if extraction else 0.0
        return self._air.is_push(self._pushed_nm(stance)) or self._air.is_pull(pulled_nm)

    def _pushed_nm(self, stance: Sequence[Batch]) -> float:
        """Return the middle torque of a stance, friction included."""
        return median([batch.sweep_nm + self._air.friction_nm for batch in stance]) if stance else 0.0

    def _learn_extraction(self, stride: ClosingStride, rising: Sequence[Batch]) -> Work[Estimate]:
        """Fit k_e. The zero was found on the way down, so a friction that is not known counts twice on the way up."""
        stroke, surface = stride.extraction, stride.surface
        zero_errors_n = stride.zero.std_error_n, 2.0 * stride.unknown_friction_nm / self.geometry.flipper_length_m
        reported = yield from fit_extraction(
            self.geometry, rising, surface, zero_errors_n, self._extractions, stroke.first_m
        )
        if reported.valid or not stride.is_stuck:
            return reported
        return bound_extraction(self.geometry, stroke.batches, surface)

    def _shear_estimate(self, shear: Shear, stride: ClosingStride) -> Estimate:
        """Add the errors of friction and of the surface, dk = (n + 1) k dδ / z as pressure and area grow with depth."""
        if shear.fit is None:
            return NOT_THERE._replace(samples=shear.samples, reason=shear.reason or NOT_THERE.reason)
        surface, depth_m = stride.surface, stride.deepest_m - stride.surface.depth_m
        power = 1.0 + growth_exponent(self.geometry, depth_m)
        per_surface = power * shear.fit.slope / depth_m if depth_m > 0.0 else 0.0
        friction = stride.friction_error_nm / shear.moment_m4
        stroke = sheared_stroke(self.geometry, stride.stance.batches, surface.depth_m, shear)
        own, shared = hypot(per_surface * surface.own_error_m, friction), per_surface * levelling_m(surface)
        estimate = evaluated(shear.fit, own, shared, stroke)
        at_least = shear.at_least and estimate.valid
        return estimate._replace(at_least=at_least, reason=estimate.reason or shear.reason)


def _across_nm(geometry: FlipperGeometry, batch: Batch) -> float:
    """Return the adduction torque of the load across the face, with the surface at its nominal height."""
    plate = submerged_plate(geometry, batch.sweep_rad, batch.adduction_rad)
    return cross_coupling(geometry, plate, batch.sweep_rad) * batch.sweep_nm


def _widened(estimate: Estimate, uncertainty: float) -> Estimate:
    """Add a relative uncertainty that the strokes of a path have in common."""
    return estimate._replace(std_error=hypot(estimate.std_error, uncertainty * estimate.value))


def _named(estimate: Estimate, surface: Surface) -> Estimate:
    """Add that the trial has two surfaces as the reason of an estimate that has none."""
    is_ambiguous = isfinite(surface.other_m) and not estimate.reason
    return estimate._replace(reason=TWO_SURFACES) if is_ambiguous else estimate
