"""The mud's shear resistance from one stance: the value of k_s, or a lower bound.

The plate's pressure is k_s ζ only where the mud yields. Because the flippers can move the body, there are four cases
(three in section III-C of the paper), distinguished batch by batch by the plate's slip, its path back through the mud:

    yield             the body stands, the plate shears through the mud: τ₁ = k_s Ψ
    limited_by_body   the body advances and the mud does not yield: the force is the body's drag, a lower bound of k_s
    mixed             the plate slips while the body advances: k_s from the batches that slip
    limited_by_motor  a motor at its limit for more than CLIPPED of the stance sets the force, however the plate creeps,
                      and for any batch a stance in which the mud does not yield: a lower bound of k_s

A batch counts as yielding once the plate has slipped MOBILISED_M since the stance began and still slips. With a fixed
base all travel is slip. On a path the plate sinks and rises too, and a batch counts only where it slips more than that.
Clay presses as much on a face that also moves along itself. Sand resists along the motion, so across the plate by the
cosine of its angle; what that takes away is an uncertainty of k_s. Without a pose the size of the force decides: while
both flippers together push less than the body's drag the body cannot have moved; otherwise the largest force withstood
is a lower bound.
"""

from collections.abc import Sequence
from enum import Enum
from itertools import pairwise
from math import cos, hypot, inf, isfinite, sin
from typing import NamedTuple

from control.computing.bounded_work import Work
from control.computing.exact_sum import exact_sum
from control.geometry import FlipperGeometry
from control.plate_integrals import moment_width_m, stance_moment_m4, submerged_plate
from control.records import UNKNOWN
from estimation.strokes.fit_samples import FitSamples
from estimation.strokes.origin_fit import MIN_BATCHES, OriginFit, fit_through_origin, median
from estimation.strokes.stroke import Batch
from estimation.strokes.stroke_fit import SHORTEST_M, TORQUE_REPEATABILITY, FittedStroke
from estimation.strokes.withstood import SHALLOWEST_M, most_withstood

MOBILISED_M = 0.025  # in the authors' logs the force is on its plateau after 2 to 3 cm
SLIPPING = 0.2  # of the flipper's own travel; a batch with more slips
LEAST_COSINE = 0.7  # of the angle between the plate's motion and its slip
QUICK_UNCERTAINTY = 0.05  # of a bound: mud withstands a tenth more at twice the speed
STANDS = 0.8  # of the body's drag; with less thrust the body certainly stands
HELD = (3, 5)  # batches in a row that must withstand a bound: at most 3 cm, fewer in a short stance
CLIPPED = 0.3  # of a stance's samples, in saturated batches: the mean force is that of the motor within a few percent
CATCHES_UP = 0.5  # of the flipper's travel since the last position: a body that stood meanwhile moves less
DEEP_FRACTION = 0.7  # of the deepest part of a path
MOTOR, BODY = "limited_by_motor", "limited_by_body"
SHORT = "the sweep in the mud is too short"


class Base(Enum):
    """The base that the flippers are mounted on."""

    FIXED = "fixed"
    FREE = "free"


class Shear(NamedTuple):
    fit: OriginFit | None
    at_least: bool
    case: str  # one of control.records.STANCES
    samples: int
    reason: str = ""
    moment_m4: float = inf  # mean Ψ of the batches that count, by which an error of the torque becomes one of k_s
    steady: Sequence[int] = ()  # the batches of the fit; none for a bound
    slipping: float = 1.0  # the plate's slip in them, as a fraction of the flipper's own travel
    oblique: float = 0.0  # uncertainty of k_s because the plate also sinks or rises, as a fraction


def find_shear(
    geometry: FlipperGeometry,
    batches: Sequence[Batch],
    surface_m: float,
    base: Base,
    drag_n: float,
    along_path: bool = False,
) -> Work[Shear]:
    """Fit k_s, or find a lower bound, in bounded units; `drag_n` is the body's drag on each flipper.

    A path goes through all depths. Mud seems the firmer the shallower a plate is, so a bound is that of its deep part.
    """
    moments = [_moment_m4(geometry, batch, surface_m) for batch in batches]
    yield
    least_m4 = DEEP_FRACTION**2 * max(moments, default=0.0) if along_path else 0.0
    held = [moment if moment >= least_m4 else 0.0 for moment in moments]
    if not any(moment > 0.0 for moment in moments):
        return Shear(None, False, "unknown", 0, "no depth in any batch")
    clipped = sum([batch.samples for batch in batches if batch.saturated])
    if clipped > CLIPPED * sum([batch.samples for batch in batches]):
        return _bound(geometry, MOTOR, "a motor at its limit", batches, held)
    slips = slips_m(geometry, batches, base)
    if slips is None:
        return _without_pose(geometry, batches, moments, held, drag_n)
    cosines = _cosines(geometry, batches, slips) if along_path else [1.0] * len(batches)
    steady = [i for i in _yielding(geometry, batches, slips) if cosines[i] > LEAST_COSINE]
    if len(steady) >= MIN_BATCHES:
        shear = _value(_case(geometry, batches, slips), steady, batches, moments)
        oblique = 1.0 - exact_sum(cosines[i] for i in steady) / len(steady)
        return shear._replace(slipping=_slipping(geometry, batches, slips, steady), oblique=oblique)
    if any(batch.saturated for batch in batches):
        return _bound(geometry, MOTOR, "a motor at its limit", batches, held)
    return _bound(geometry, BODY, "the mud held: the body moved", batches, held)


def _moment_m4(geometry: FlipperGeometry, batch: Batch, surface_m: float) -> float:
    """Return Ψ of a batch."""
    plate = submerged_plate(geometry, batch.sweep_rad, batch.adduction_rad, surface_m)
    return stance_moment_m4(geometry, plate)


def _value(case: str, steady: Sequence[int], batches: Sequence[Batch], moments: Sequence[float]) -> Shear:
    fit = fit_through_origin([moments[i] for i in steady], [batches[i].sweep_nm for i in steady])
    moment_m4 = exact_sum(moments[i] for i in steady) / len(steady)
    return Shear(fit, False, case, sum(batches[i].samples for i in steady), moment_m4=moment_m4, steady=steady)


def _cosines(geometry: FlipperGeometry, batches: Sequence[Batch], slips: Sequence[float]) -> list[float]:
    """Return the cosine of the angle between the plate's motion and its slip, of each batch; the first has none."""
    depths_m = [geometry.depth_m(batch.sweep_rad, batch.adduction_rad) for batch in batches]
    motions = zip(slips, pairwise(depths_m), strict=True)
    return [
        0.0,
        *(slip_m / max(hypot(slip_m, after_m - before_m), SHORTEST_M) for slip_m, (before_m, after_m) in motions),
    ]


def _slipping(
    geometry: FlipperGeometry, batches: Sequence[Batch], slips: Sequence[float], steady: Sequence[int]
) -> float:
    swept_m = slips_m(geometry, batches, Base.FIXED) or []
    return exact_sum(slips[i - 1] for i in steady) / exact_sum(swept_m[i - 1] for i in steady)


def sheared_stroke(geometry: FlipperGeometry, batches: Sequence[Batch], surface_m: float, shear: Shear) -> FittedStroke:
    """Return the part of the stance that a value or a bound of k_s is made from, at the plate's speed in the mud."""
    used = [batches[i] for i in shear.steady] or batches
    depths_m = [geometry.depth_m(batch.sweep_rad, batch.adduction_rad) - surface_m for batch in used]
    return FittedStroke(shear.samples, max(depths_m), shear.slipping * median([batch.speed_m_s for batch in used]))


def yield_force_n(
    geometry: FlipperGeometry, batches: Sequence[Batch], shear: Shear, friction_error_nm: float
) -> tuple[float, float]:
    """Return the mean force across the plate while the mud yielded, and its standard error; NaN for a bound.

    The mean over the depth that was reached needs no law of the depth and no surface.
    """
    torques_nm = [batches[i].sweep_nm for i in shear.steady]
    fit = fit_through_origin([1.0] * len(torques_nm), torques_nm)
    if fit is None:
        return UNKNOWN, UNKNOWN
    error_nm = hypot(fit.std_error, friction_error_nm, TORQUE_REPEATABILITY * fit.slope)
    return fit.slope / geometry.flipper_length_m, error_nm / geometry.flipper_length_m


def shear_samples(
    geometry: FlipperGeometry, batches: Sequence[Batch], surface_m: float, shear: Shear, mirrored: bool = False
) -> FitSamples | None:
    """Return the samples of the fit that `find_shear` found; None for a bound. `mirrored`: front is rear in batches."""
    if shear.fit is None or not shear.steady:
        return None
    steady = [batches[i] for i in shear.steady]
    return FitSamples(
        moments_m4=[_moment_m4(geometry, batch, surface_m) for batch in steady],
        torques_nm=[batch.sweep_nm for batch in steady],
        weights_m=[1.0] * len(steady),
        sweeps_rad=[-batch.sweep_rad if mirrored else batch.sweep_rad for batch in steady],
        depths_m=[geometry.depth_m(batch.sweep_rad, batch.adduction_rad) - surface_m for batch in steady],
        slope=shear.fit.slope,
    )


def slips_m(geometry: FlipperGeometry, batches: Sequence[Batch], base: Base) -> list[float] | None:
    """Return the plate's slip through the mud from batch to batch; None if the body's position is unknown."""
    fixed = base is Base.FIXED
    if not fixed and not _is_followed(geometry, batches):
        return None
    positions_m = [geometry.flipper_length_m * sin(b.sweep_rad) + (0.0 if fixed else b.body_m) for b in batches]
    return [before_m - after_m for before_m, after_m in zip(positions_m, positions_m[1:], strict=False)]


def _is_followed(geometry: FlipperGeometry, batches: Sequence[Batch]) -> bool:
    """Return whether the pose follows the body from batch to batch.

    One that comes too rarely is held for some batches, in which the plate seems to slip, and then catches up.
    """
    known = [(batch.body_m, geometry.flipper_length_m * sin(batch.sweep_rad)) for batch in batches]
    moved = [i for i, (before, after) in enumerate(pairwise(known), 1) if before[0] != after[0]]
    held = [(known[i], known[j]) for i, j in pairwise(moved) if j > i + 1]
    jumps = [after_m - before_m > CATCHES_UP * (front_m - rear_m) for (before_m, front_m), (after_m, rear_m) in held]
    return all(isfinite(body_m) for body_m, _ in known) and not any(jumps)


def _yielding(geometry: FlipperGeometry, batches: Sequence[Batch], slips: list[float] | None) -> list[int]:
    """Return the batches in which the plate slips after the mud was mobilised."""
    steady, slipped_m = [], 0.0
    for i, slip_m in enumerate(slips or ()):
        slipped_m += slip_m
        travel_m = geometry.flipper_length_m * (sin(batches[i].sweep_rad) - sin(batches[i + 1].sweep_rad))
        if slipped_m >= MOBILISED_M and slip_m > SLIPPING * travel_m > 0.0:
            steady.append(i + 1)
    return steady


def _case(geometry: FlipperGeometry, batches: Sequence[Batch], slips: Sequence[float]) -> str:
    travel_m = geometry.flipper_length_m * (sin(batches[0].sweep_rad) - sin(batches[-1].sweep_rad))
    return "yield" if exact_sum(slips) > 0.8 * travel_m else "mixed"


def _without_pose(
    geometry: FlipperGeometry,
    batches: Sequence[Batch],
    moments: Sequence[float],
    held: Sequence[float],
    drag_n: float,
) -> Shear:
    """Fit or bound k_s without a pose: flippers that push less than the body's drag cannot have moved it."""
    thrusts_n = [cos(b.sweep_rad) * b.sweep_nm / geometry.flipper_length_m for b in batches]
    if len(batches) > HELD[0] and sorted(thrusts_n)[-HELD[0]] < STANDS * drag_n:
        steady = _yielding(geometry, batches, slips_m(geometry, batches, Base.FIXED))
        if len(steady) >= MIN_BATCHES:
            return _value("yield", steady, batches, moments)
    lack = "the pose comes too rarely" if all(isfinite(b.body_m) for b in batches) else "no pose"
    return _bound(geometry, "unknown", f"{lack}: the body may have moved", batches, held)


def _bound(
    geometry: FlipperGeometry, case: str, reason: str, batches: Sequence[Batch], moments: Sequence[float]
) -> Shear:
    """Return the largest k_s that HELD batches in a row withstood; mud withstands a first quick push better."""
    least_m4 = geometry.flipper_length_m * moment_width_m(geometry, SHALLOWEST_M) * SHALLOWEST_M**2 / 2.0
    withstood = [
        b.sweep_nm / moment if moment > least_m4 else UNKNOWN for b, moment in zip(batches, moments, strict=True)
    ]
    run = min(max(len(withstood) // 3, HELD[0]), HELD[1])
    most = most_withstood(withstood, run)
    samples = sum(batch.samples for batch in batches)
    if most is None:
        known = (case, samples, reason) if case == MOTOR else ("unknown", samples, SHORT)
        return Shear(None, True, *known)
    largest, spread = most
    scatter = spread / 4.0  # of the median of five, whose range is 2.3 times their scatter
    fit = OriginFit(largest, hypot(scatter, QUICK_UNCERTAINTY * largest))
    return Shear(fit, True, case, samples, reason, max(moments))
