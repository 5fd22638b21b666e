"""Insertion and extraction: k_p or k_e with its standard error, from the batches of one stroke.

    insertion     τ₂ - cross-coupling =  k_p Φ        from the surface down
    extraction    τ₂ - cross-coupling = -k_e Φ        over the last three quarters of the rise

Φ is the moment of the submerged volume in each pose, and the cross-coupling is the adduction torque of the load across
the plate's face, which the sweep joint measures (both in plate_integrals.py). Each piece of the travel counts by its
length within these limits, unless the adduction joint has no vertical lever there. Over the first quarter of the rise
the mud's force on the plate reverses from supporting it to holding it down.
"""

from collections.abc import Sequence
from math import copysign, cos, hypot, inf, isfinite, sin, sqrt
from typing import NamedTuple

from control.computing.bounded_work import Work, finish
from control.computing.exact_sum import exact_sum
from control.geometry import FlipperGeometry
from control.plate_integrals import cross_coupling, growth_exponent, mean_width_m, stroke_moment_m4, submerged_plate
from control.records import UNKNOWN, Estimate
from estimation.ground_law import MATLOCK_J, PRESSURE_AT_SURFACE
from estimation.strokes.depth_line import SHEAR_LAW
from estimation.strokes.fit_samples import FitSamples
from estimation.strokes.origin_fit import MIN_BATCHES, OriginFit, fit_through_origin, median
from estimation.strokes.scatter_memory import ScatterMemory
from estimation.strokes.stroke import Batch
from estimation.strokes.surface import Surface
from estimation.strokes.withstood import SHALLOWEST_M, most_withstood

REVERSAL_FRACTION = 0.25  # of the rise
SHORTEST_M = 1e-9  # a shorter piece of travel is rounding
MIN_VERTICAL_LEVER_M = 0.03  # below it an upward force hardly loads the adduction joint
TORQUE_REPEATABILITY = 0.032  # of a torque, as the paper measured it
TORQUE_CONSTANT_UNCERTAINTY = 0.032  # of a motor without a calibration: as the simulator's motors differ
# of the cross-coupling. The drop bounds its lever: the load's centre lies between the lower edge and the middle of the
# wet part, 35 to 50 mm below the arm at a depth of 3 cm (10 %), and the drop itself is known to 2 mm (5 %).
CROSS_COUPLING_UNCERTAINTY = 0.12
LARGEST_UNCERTAINTY = 0.75  # of a coefficient: beyond it even the 82 % interval reaches zero
HELD_BATCHES = 3  # in a row, 3 mm of rise, that must withstand a bound
BATCHES_PER_UNIT = 10  # of bounded work
SIDE_YIELDS = 0.2  # of the plate's thickness: Matlock's 4 times 2.5 ε b, with ε = 0.02 of soft clay
TOO_SHORT = f"fewer than {MIN_BATCHES} pieces of travel in the mud"
NOT_THERE = Estimate(UNKNOWN, UNKNOWN, 0, False, TOO_SHORT)
NOT_OUT = "the flipper did not come out"
ZeroErrors = tuple[float, float]  # of the force in air, in N: that of a stroke, and that of all strokes of a session
UNOBSERVABLE = f"vertical lever under {100.0 * MIN_VERTICAL_LEVER_M:g} cm: not observable in this pose"


def fit_insertion(
    geometry: FlipperGeometry, batches: Sequence[Batch], surface: Surface, zero_errors_n: ZeroErrors
) -> Work[Estimate]:
    """Fit k_p, in bounded units."""
    return _fit(geometry, batches, surface, zero_errors_n, None, 1.0, inf)


def fit_extraction(
    geometry: FlipperGeometry,
    batches: Sequence[Batch],
    surface: Surface,
    zero_errors_n: ZeroErrors,
    scatter: ScatterMemory,
    start_m: float,
) -> Work[Estimate]:
    """Fit k_e, in bounded units.

    `start_m` is the depth from which the flipper rises; the scatter of its short strokes is pooled.
    """
    return _fit(geometry, batches, surface, zero_errors_n, scatter, -1.0, _deepest_m(surface, start_m))


def _deepest_m(surface: Surface, start_m: float) -> float:
    """Return the depth above which the force on a rising plate has reversed."""
    return surface.depth_m + (1.0 - REVERSAL_FRACTION) * (start_m - surface.depth_m)


def insertion_samples(geometry: FlipperGeometry, batches: Sequence[Batch], surface: Surface) -> FitSamples | None:
    """Return the samples of `fit_insertion`; None where it has no fit."""
    return _samples(finish(_pieces(geometry, batches, surface, 1.0, inf)))


def extraction_samples(
    geometry: FlipperGeometry, batches: Sequence[Batch], surface: Surface, start_m: float
) -> FitSamples | None:
    """Return the samples of `fit_extraction`; None where it has no fit."""
    return _samples(finish(_pieces(geometry, batches, surface, -1.0, _deepest_m(surface, start_m))))


def _samples(pieces: "_Pieces") -> FitSamples | None:
    fit = fit_through_origin(pieces.moments, pieces.torques)
    if fit is None:
        return None
    moments, torques = ([a / sqrt(w) for a, w in zip(each, pieces.paths_m, strict=True)] for each in pieces[:2])
    return FitSamples(moments, torques, pieces.paths_m, pieces.sweeps_rad, pieces.depths_m, fit.slope)


def bound_extraction(geometry: FlipperGeometry, batches: Sequence[Batch], surface: Surface) -> Estimate:
    """Return the lower bound of k_e from a flipper that did not come out.

    It is the greatest median of HELD_BATCHES in a row, or of all of a flipper that hardly moved. Batches near the
    surface do not count, since an error of the surface would be a large part of their depth.
    """
    deep = [batch for batch in batches if batch.travel_m - surface.depth_m >= SHALLOWEST_M]
    withstood = [_withstood(geometry, batch, surface) for batch in deep]
    samples = sum(batch.samples for batch in deep)
    bound, spread = most_withstood(withstood, min(HELD_BATCHES, len(withstood))) or (0.0, 0.0)
    depth_m = max([batch.travel_m for batch in deep], default=inf) - surface.depth_m
    per_surface = 1.5 * bound / depth_m
    own = hypot(TORQUE_REPEATABILITY * bound, spread / 2.0, per_surface * surface.own_error_m)
    shared = hypot(TORQUE_CONSTANT_UNCERTAINTY * bound, per_surface * levelling_m(surface))
    if not (bound > 0.0 and isfinite(bound + own + shared)):
        return NOT_THERE._replace(samples=samples)
    return Estimate(
        value=bound,
        std_error=hypot(own, shared),
        samples=samples,
        valid=True,
        reason=NOT_OUT,
        at_least=True,
        repeatability=own,
        depth_m=depth_m,
        speed_m_s=median([batch.speed_m_s for batch in deep]),
    )


def _withstood(geometry: FlipperGeometry, batch: Batch, surface: Surface) -> float:
    plate = submerged_plate(geometry, batch.sweep_rad, batch.adduction_rad, surface.depth_m)
    across_nm = cross_coupling(geometry, plate, batch.sweep_rad) * batch.sweep_nm
    return (across_nm - batch.adduction_nm) / stroke_moment_m4(geometry, plate, batch.sweep_rad)


class _Pieces(NamedTuple):
    """The pieces of one stroke, scaled by the root of their length, so that least squares weights them by length."""

    moments: list[float]  # Φ
    torques: list[float]  # that resist the stroke
    crossed_nm: list[float]  # cross-coupling, already subtracted
    depths_m: list[float]
    paths_m: list[float]
    speeds_m_s: list[float]
    sweeps_rad: list[float]
    samples: int
    lever_m: float  # shortest vertical lever of the whole stroke


def _fit(
    geometry: FlipperGeometry,
    batches: Sequence[Batch],
    surface: Surface,
    zero_errors_n: ZeroErrors,
    scatter: ScatterMemory | None,
    sign: float,
    deepest_m: float,
) -> Work[Estimate]:
    pieces = yield from _pieces(geometry, batches, surface, sign, deepest_m)
    fit = fit_through_origin(pieces.moments, pieces.torques)
    if fit is None:
        hidden = pieces.lever_m < MIN_VERTICAL_LEVER_M
        return NOT_THERE._replace(samples=pieces.samples, reason=UNOBSERVABLE if hidden else TOO_SHORT)
    yield
    deepest_m = max(pieces.depths_m)
    edge_m2 = mean_width_m(geometry, deepest_m) * geometry.plate_thickness_m
    scales_m = [depth_m / growth_exponent(geometry, depth_m) for depth_m in pieces.depths_m]
    per_surface = _slope_per_surface(fit, pieces.moments, pieces.torques, scales_m)
    stroke = FittedStroke(pieces.samples, deepest_m, median(pieces.speeds_m_s))
    own_zero, shared_zero = (1.5 * error_n / (edge_m2 * deepest_m) for error_n in zero_errors_n)
    own = hypot(per_surface * surface.own_error_m, own_zero)
    cross_coupling_error = CROSS_COUPLING_UNCERTAINTY * _slope(pieces.moments, pieces.crossed_nm)
    shared = hypot(per_surface * levelling_m(surface), cross_coupling_error, shared_zero)
    return evaluated(scatter.pooled(fit) if scatter else fit, own, shared, stroke)


def _pieces(
    geometry: FlipperGeometry, batches: Sequence[Batch], surface: Surface, sign: float, deepest_m: float
) -> Work[_Pieces]:
    moments, torques, crossed_nm, depths_m, paths_m, speeds_m_s, sweeps_rad = [], [], [], [], [], [], []
    samples, lever_m = 0, inf
    travelled = zip(batches, travels_m(batches, surface.depth_m, deepest_m), strict=True)
    for number, (batch, path_m) in enumerate(travelled, 1):
        if number % BATCHES_PER_UNIT == 0:
            yield
        vertical_m = geometry.vertical_lever_m(batch.sweep_rad, batch.adduction_rad)
        lever_m = min(lever_m, vertical_m)
        if path_m < SHORTEST_M or vertical_m < MIN_VERTICAL_LEVER_M:
            continue
        plate = submerged_plate(geometry, batch.sweep_rad, batch.adduction_rad, surface.depth_m)
        across_nm = cross_coupling(geometry, plate, batch.sweep_rad) * batch.sweep_nm
        root = sqrt(path_m)
        moments.append(root * stroke_moment_m4(geometry, plate, batch.sweep_rad))
        torques.append(root * sign * (batch.adduction_nm - across_nm))
        crossed_nm.append(root * across_nm)
        depths_m.append(max(batch.travel_m - surface.depth_m, path_m / 2.0))
        paths_m.append(path_m)
        speeds_m_s.append(batch.speed_m_s)
        sweeps_rad.append(batch.sweep_rad)
        samples += batch.samples
    yield
    return _Pieces(moments, torques, crossed_nm, depths_m, paths_m, speeds_m_s, sweeps_rad, samples, lever_m)


def travels_m(batches: Sequence[Batch], shallowest_m: float, deepest_m: float) -> list[float]:
    """Return the part of each batch's travel between two depths; batches meet half-way between their means."""
    depths_m = [batch.travel_m for batch in batches]
    if len(depths_m) < 2:
        return [0.0] * len(depths_m)
    middles_m = [(a + b) / 2.0 for a, b in zip(depths_m, depths_m[1:], strict=False)]
    ends_m = [2.0 * depths_m[0] - middles_m[0], *middles_m, 2.0 * depths_m[-1] - middles_m[-1]]
    return [min(max(a, b), deepest_m) - max(min(a, b), shallowest_m) for a, b in zip(ends_m, ends_m[1:], strict=False)]


def _slope(x: Sequence[float], y: Sequence[float]) -> float:
    return exact_sum([a * b for a, b in zip(x, y, strict=True)]) / exact_sum([a * a for a in x])


def _slope_per_surface(
    fit: OriginFit, moments: Sequence[float], torques: Sequence[float], scales_m: Sequence[float]
) -> float:
    """Return dk/dδ for a surface deeper by dδ: Φ falls by about Φ dδ / s with s = z/n, so with k = Σ τΦ / ΣΦ²

    dk/dδ = (2 k Σ Φ²/s - Σ τΦ/s) / ΣΦ², which is 3/2 k/z where τ = k Φ and Φ grows in proportion to depth, n = 1.
    """
    squares = [moment * moment for moment in moments]
    weighted = exact_sum([square / scale_m for square, scale_m in zip(squares, scales_m, strict=True)])
    products = [torque * moment for torque, moment in zip(torques, moments, strict=True)]
    reported = exact_sum([product / scale_m for product, scale_m in zip(products, scales_m, strict=True)])
    return (2.0 * fit.slope * weighted - reported) / exact_sum(squares)


class FittedStroke(NamedTuple):
    """The part of a stroke that an estimate is made from."""

    samples: int
    depth_m: float
    speed_m_s: float


def evaluated(fit: OriginFit, own: float, shared: float, stroke: FittedStroke) -> Estimate:
    """Turn a fit into an estimate with its two standard errors, or with the reason why it is invalid.

    `own` is the error besides the scatter that differs between strokes, `shared` the one that they have in common.
    """
    k = fit.slope
    repeatability = hypot(fit.std_error, own, TORQUE_REPEATABILITY * k)
    std_error = hypot(repeatability, shared, TORQUE_CONSTANT_UNCERTAINTY * k)
    if not isfinite(k + std_error):
        return NOT_THERE._replace(samples=stroke.samples, reason="not finite")
    reason = ""
    if k <= 0.0:
        reason = "the force does not oppose the motion"
    elif std_error > LARGEST_UNCERTAINTY * k:
        reason = "the samples do not follow the law"
    return Estimate(
        value=k,
        std_error=std_error,
        samples=stroke.samples,
        valid=not reason,
        reason=reason,
        repeatability=repeatability,
        depth_m=stroke.depth_m,
        speed_m_s=stroke.speed_m_s,
    )


def levelling_m(surface: Surface) -> float:
    """Return the part of a surface's error that the strokes of a set-up share."""
    return sqrt(max(0.0, surface.std_error_m**2 - surface.own_error_m**2))


def slide_free(
    geometry: FlipperGeometry, batches: Sequence[Batch], surface_m: float, k_s: float, deepest_m: float
) -> list[Batch]:
    """Return the batches of a path with the torque on the narrow sides that a standing body would give.

    A plate that its arc alone moves slides outward as it rises. The body's advance dx adds dx sin α, which is inward at
    the rear. Where it prevails, the other narrow side leads once it has slid SIDE_YIELDS: it meets the pressure of mud
    that has this k_s at `deepest_m`, and pushes the flipper up instead of holding it down. Without a pose nothing is
    known of it.
    """
    freed, drop_m, thickness_m, held = list(batches[:1]), geometry.drop_m, geometry.plate_thickness_m, 0.0
    for before, batch in zip(batches, batches[1:], strict=False):
        depth_m, reach = batch.travel_m - surface_m, cos(batch.sweep_rad)
        outward_m = drop_m * reach * (batch.adduction_rad - before.adduction_rad)
        slide_m = outward_m + sin(batch.sweep_rad) * (batch.body_m - before.body_m)
        held = min(max(held + slide_m / (SIDE_YIELDS * thickness_m), -1.0), 1.0)
        if depth_m > 0.0 and isfinite(held):
            pressed_n = k_s * (depth_m / deepest_m) ** SHEAR_LAW.exponent * thickness_m * depth_m**2 / 2.0
            missing_n = (copysign(1.0, outward_m) - held) * _narrowness(geometry, depth_m) * pressed_n
            missing_nm = missing_n * (drop_m - depth_m / 3.0) * reach
            batch = batch._replace(adduction_nm=batch.adduction_nm - missing_nm)
        freed.append(batch)
    return freed


def _narrowness(geometry: FlipperGeometry, depth_m: float) -> float:
    """Return the pressure of clay on a narrow side over that on a face, down to a depth (Matlock 1970).

    On a body of the width b the pressure at the depth z is (3 + J z/b) times the strength, at most 9 times; J = 0.5.
    """
    widths_m = geometry.plate_thickness_m, geometry.plate_width_m
    side, face = (min(PRESSURE_AT_SURFACE + MATLOCK_J * depth_m / (2.0 * width_m), 9.0) for width_m in widths_m)
    return side / face


def level_free(batches: Sequence[Batch], level_nm: float) -> list[Batch]:
    """Subtract a torque level, given for a straight arm; it shrinks with the arm's lateral reach, cos α."""
    return [b._replace(adduction_nm=b.adduction_nm - level_nm * cos(b.sweep_rad)) for b in batches]
