"""How wrong the coefficients of a stride may be because its insertion lifted the body instead of going down.

Depth is that of the joints. A body of length L that nothing holds down tips over its rear edge once its flippers, which
reach x ahead of its middle, press with F (x + L/2) > W L/2: from half of its weight W on, if L is 2 x or more.
From the depth z₀ where they do, the plate need not follow the joints, and the force alone shows whether it does. Mud's
coefficient k ∝ F/z changes with depth as z^m, m = -0.4 ± 0.3 (STROKE_LAW). One that is measured over the joints' travel
to z changes as z^e, with e = -1 where the force stays constant. Where m > e, the plate is only as deep as d, at which
that mud has that force, and with F ∝ d^(1+m)

    (d/z₀)^(1+m) = (z/z₀)^(1+e)        k(z) / k measured = (z/d)^(1+m) = (z/z₀)^(m-e)

So the uncertainty of ln k_p is ln z/z₀ times the root mean square of max(m - e, 0) over m. The shallower plate has the
same error in k_e, whose force grows alike, and 2.5 times that in k_s, whose force grows as z^1.5.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import erfc, exp, hypot, log, pi, sqrt

from control.computing.bounded_work import Work
from control.computing.exact_sum import exact_sum
from control.geometry import FlipperGeometry
from control.plate_integrals import cross_coupling, stroke_moment_m4, submerged_plate
from control.records import Estimate, StrideEstimate
from estimation.strokes.depth_line import SHEAR_LAW, STROKE_LAW
from estimation.strokes.origin_fit import MIN_BATCHES
from estimation.strokes.stroke import Batch
from estimation.strokes.stroke_fit import BATCHES_PER_UNIT, LARGEST_UNCERTAINTY
from estimation.strokes.withstood import SHALLOWEST_M

LIFTING_FRACTION = 0.5  # of the weight
SHEAR_OVER_STROKE = (2.0 + SHEAR_LAW.exponent) / (1.0 + STROKE_LAW.exponent)
LIFTED = "limited by the body: the insertion's force may have lifted it"
LEAST_FRACTION = 0.05  # of the largest F/z: less is noise, or a plate that bounced off


def lift_uncertainty(
    geometry: FlipperGeometry, batches: Sequence[Batch], surface_m: float, lift_n: float
) -> Work[float]:
    """Return the uncertainty of ln k_p, in bounded units, where `lift_n` on each flipper may lift the body; 0: none."""
    logs, ratios = list[float](), list[float]()
    for number, batch in enumerate(batches, 1):
        if number % BATCHES_PER_UNIT == 0:
            yield
        depth_m = batch.travel_m - surface_m
        plate = submerged_plate(geometry, batch.sweep_rad, batch.adduction_rad, surface_m)
        moment_m4 = stroke_moment_m4(geometry, plate, batch.sweep_rad)
        if depth_m < SHALLOWEST_M or moment_m4 == 0.0:
            continue
        torque_nm = batch.adduction_nm - cross_coupling(geometry, plate, batch.sweep_rad) * batch.sweep_nm
        arm_m = moment_m4 / (plate.area_m2 * geometry.plate_thickness_m)
        force_n = torque_nm * geometry.vertical_lever_m(batch.sweep_rad, batch.adduction_rad) / arm_m**2
        if ratios or force_n >= lift_n:
            logs.append(log(depth_m))
            ratios.append(torque_nm / moment_m4)
    return _excess(_exponent(logs, ratios)) * (logs[-1] - logs[0]) if ratios else 0.0


def _exponent(logs: Sequence[float], ratios: Sequence[float]) -> float:
    """Return d ln k / d ln z by least squares; that of a constant force from too few batches."""
    n, least = len(logs), LEAST_FRACTION * max(ratios)
    mean = exact_sum(logs) / n
    spread = exact_sum([(each - mean) ** 2 for each in logs])
    if n < MIN_BATCHES or not (spread > 0.0 and least > 0.0):
        return -1.0
    return exact_sum([(u - mean) * log(max(v, least)) for u, v in zip(logs, ratios, strict=True)]) / spread


def _excess(exponent: float) -> float:
    """Return the root mean square of max(m - e, 0) over the normal distribution of mud's exponent m."""
    above = (STROKE_LAW.exponent - exponent) / STROKE_LAW.std_error
    probability, density = erfc(-above / sqrt(2.0)) / 2.0, exp(-above * above / 2.0) / sqrt(2.0 * pi)
    return STROKE_LAW.std_error * sqrt(max(0.0, (above * above + 1.0) * probability + above * density))


def less_deep(estimate: Estimate, uncertainty: float) -> Estimate:
    """Add the uncertainty of a body that may have risen. A lower bound stays one, since the plate was less deep."""
    if not estimate.valid or estimate.at_least:
        return estimate
    error = uncertainty * estimate.value
    std_error, repeatability = hypot(estimate.std_error, error), hypot(estimate.repeatability, error)
    valid = std_error <= LARGEST_UNCERTAINTY * estimate.value
    reason = LIFTED if not valid or error > estimate.std_error else estimate.reason
    return estimate._replace(std_error=std_error, repeatability=repeatability, valid=valid, reason=reason)


def as_felt(estimate: Estimate, uncertainty: float) -> Estimate:
    """Add the uncertainty as one that all strides share: the force at a depth of the joints repeats."""
    return estimate._replace(std_error=less_deep(estimate, uncertainty).std_error)


def with_lift(stride: StrideEstimate, lift: float, change: Callable[[Estimate, float], Estimate]) -> StrideEstimate:
    """Change the coefficients of a stride; `lift` is the uncertainty of ln k_p."""
    if lift == 0.0:
        return stride
    k_s = change(stride.k_s, SHEAR_OVER_STROKE * lift)
    return replace(stride, k_p=change(stride.k_p, lift), k_s=k_s, k_e=change(stride.k_e, lift))
