"""k_p and k_e from the batches of one stroke: synthetic strokes that keep the law, and strokes that deviate from it."""

from collections.abc import Callable, Sequence
from math import cos, hypot, inf, isfinite, nan, radians

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from control.computing.bounded_work import finish
from control.geometry import FlipperGeometry
from control.plate_integrals import cross_coupling, stroke_moment_m4, submerged_plate
from control.records import Estimate
from estimation.strokes.origin_fit import OriginFit
from estimation.strokes.scatter_memory import ScatterMemory
from estimation.strokes.stroke import Batch
from estimation.strokes.stroke_fit import (
    CROSS_COUPLING_UNCERTAINTY,
    LARGEST_UNCERTAINTY,
    MIN_VERTICAL_LEVER_M,
    NOT_OUT,
    NOT_THERE,
    TORQUE_CONSTANT_UNCERTAINTY,
    TORQUE_REPEATABILITY,
    UNOBSERVABLE,
    FittedStroke,
    bound_extraction,
    evaluated,
    fit_extraction,
    fit_insertion,
    level_free,
    slide_free,
    travels_m,
)
from estimation.strokes.surface import Surface

GEOMETRY = FlipperGeometry()
EDGE_M2 = 0.025 * 0.004
STEP_M, SAMPLES = 0.0015, 6
FRONT_RAD = radians(30.0)
K = 1.0e6
EXACT = 1e-9  # rounding

Law = Callable[[float], float]  # fraction of k Φ at a depth


def as_the_law(depth_m: float) -> float:
    return 1.0


def supporting_at_once(depth_m: float) -> float:
    """Return the factor of mud that supports a sixth of the force at 3 cm as soon as it is touched."""
    return 1.0 + 0.005 / max(depth_m, 0.001)


def surface_at(depth_m: float, std_error_m: float = 0.0) -> Surface:
    return Surface(depth_m, std_error_m, 0.0, 0.0, True)


NOMINAL = surface_at(0.0)
CONSTANT = TORQUE_CONSTANT_UNCERTAINTY
STROKE = FittedStroke(samples=7, depth_m=0.03, speed_m_s=0.1)


def batch_at(travel_m: float, sweep_rad: float = FRONT_RAD) -> Batch:
    adduction_rad = GEOMETRY.adduction_rad(sweep_rad, travel_m)
    return Batch(travel_m, sweep_rad, adduction_rad, 0.0, 0.0, 0.0, False, SAMPLES, 0.1)


def loaded(batch: Batch, k: float, surface_m: float = 0.0, law: Law = as_the_law, face_nm: float = 0.0) -> Batch:
    """Load a batch with τ₂ = k Φ and the cross-coupling of a face load that turns the sweep joint by `face_nm`."""
    plate = submerged_plate(GEOMETRY, batch.sweep_rad, batch.adduction_rad, surface_m)
    moment_m4 = law(batch.travel_m - surface_m) * stroke_moment_m4(GEOMETRY, plate, batch.sweep_rad)
    across_nm = cross_coupling(GEOMETRY, plate, batch.sweep_rad) * face_nm
    return batch._replace(sweep_nm=face_nm, adduction_nm=k * moment_m4 + across_nm)


def depths(end_m: float = 0.03, step_m: float = STEP_M) -> list[float]:
    start_m = -0.012
    return [start_m + step_m * (i + 0.5) for i in range(round((end_m - start_m) / step_m))]


def down(k: float = K, surface_m: float = 0.0, face_nm: float = 0.0) -> list[Batch]:
    return [loaded(batch_at(travel_m), k, surface_m, face_nm=face_nm) for travel_m in depths()]


def up(k: float = K, surface_m: float = 0.0, law: Law = as_the_law, face_nm: float = 0.0) -> list[Batch]:
    rising_m = reversed(depths(step_m=0.002))
    return [loaded(batch_at(travel_m, -FRONT_RAD), -k, surface_m, law, face_nm) for travel_m in rising_m]


def insertion(batches: Sequence[Batch], surface: Surface = NOMINAL, zero_error_n: float = 0.0) -> Estimate:
    return finish(fit_insertion(GEOMETRY, batches, surface, (zero_error_n, 0.0)))


def extraction(
    batches: Sequence[Batch], surface: Surface = NOMINAL, zero_error_n: float = 0.0, start_m: float = 0.03
) -> Estimate:
    return finish(fit_extraction(GEOMETRY, batches, surface, (zero_error_n, 0.0), ScatterMemory(), start_m))


# the law is found


@pytest.mark.parametrize("face_nm", [-0.3, 0.0, 0.1, 0.3])
@pytest.mark.parametrize("surface_m", [-0.003, 0.0, 0.0021])
@pytest.mark.parametrize("k", [1e4, 1e6, 3e7])
def test_a_stroke_that_keeps_the_law_gives_its_coefficient(k: float, surface_m: float, face_nm: float) -> None:
    """The coefficient is exact under any load on the face, because the sweep joint measures that load."""
    inserted = insertion(down(k, surface_m, face_nm=face_nm), surface_at(surface_m))
    extracted = extraction(up(k, surface_m, face_nm=face_nm), surface_at(surface_m))
    assert inserted.value == pytest.approx(k, rel=EXACT)
    assert extracted.value == pytest.approx(k, rel=EXACT)


def test_only_batches_in_the_mud_count() -> None:
    """Forces and samples above the surface change nothing, nor does the first quarter of the rise."""
    batches, rising = down(), up()
    start_m = 0.75 * 0.03
    altered_down = [b._replace(adduction_nm=1.0, samples=1) if b.travel_m < -STEP_M else b for b in batches]
    altered_up = [
        b._replace(adduction_nm=1.0, samples=1) if b.travel_m > start_m + 0.001 or b.travel_m < -0.001 else b
        for b in rising
    ]
    assert insertion(altered_down) == insertion(batches)
    assert extraction(altered_up) == extraction(rising)


# parts of batches


@given(
    st.lists(st.floats(1e-4, 3e-3), min_size=2, max_size=40),
    st.floats(-0.02, 0.03),
    st.floats(0.0, 0.05),
    st.booleans(),
)
def test_the_travel_of_all_batches_between_two_depths_adds_up_to_the_distance(
    steps_m: list[float], shallowest_m: float, height_m: float, upward: bool
) -> None:
    """Batches meet half-way between their means; the first and the last extend as far to their outer side."""
    means_m = list(np.cumsum(steps_m) - 0.012)
    first_m, last_m = means_m[0] - steps_m[1] / 2.0, means_m[-1] + steps_m[-1] / 2.0
    ordered = reversed(means_m) if upward else means_m
    batches = [batch_at(0.0)._replace(travel_m=float(travel_m)) for travel_m in ordered]
    deepest_m = shallowest_m + height_m
    inside_m = max(0.0, min(last_m, deepest_m) - max(first_m, shallowest_m))
    parts_m = travels_m(batches, shallowest_m, deepest_m)
    assert len(parts_m) == len(batches)
    assert sum(max(path_m, 0.0) for path_m in parts_m) == pytest.approx(inside_m, abs=1e-12)


@pytest.mark.parametrize("limit", ["surface", "start"])
def test_a_coefficient_moves_smoothly_as_a_limit_crosses_batches(limit: str) -> None:
    """The limit moves over two batches in steps of 10 µm. A batch that counted wholly or not at all, a twentieth of the
    path with a value that is off by some ten percent, would jump by about 1 %; the surface itself moves k by 3/2 · 10
    µm / 2 cm per step.
    """
    stroke = up(law=supporting_at_once)
    values = []
    for i in range(400):
        moved_m = 1e-5 * i
        surface_m, start_m = (moved_m, 0.03) if limit == "surface" else (0.0, 0.026 + moved_m)
        values.append(extraction(stroke, surface_at(surface_m), start_m=start_m).value)
    steps = np.abs(np.diff(values)) / K
    assert 0.0 < steps.max() < 2e-3


# the uncertainty


def systematic(estimate: Estimate) -> float:
    """Return the relative uncertainty without the parts of the torque's repeatability and constant."""
    return float(np.sqrt((estimate.std_error / estimate.value) ** 2 - TORQUE_REPEATABILITY**2 - CONSTANT**2))


@pytest.mark.parametrize("error_m", [0.0002, 0.001])
def test_the_uncertainty_of_the_surface_is_that_of_a_moved_one(error_m: float) -> None:
    """The tolerance is 10 %: the error is of first order in 1 mm of 3 cm, and Φ falls as above."""
    reported = systematic(insertion(down(), surface_at(0.0, error_m)))
    deeper, higher = (insertion(down(), surface_at(sign * error_m)).value for sign in (1.0, -1.0))
    assert reported == pytest.approx((deeper - higher) / 2.0 / K, rel=0.1)


def test_an_error_of_the_zero_that_all_strokes_share_does_not_compare_them() -> None:
    def errors(zero_errors_n: tuple[float, float]) -> tuple[float, float]:
        found = finish(fit_extraction(GEOMETRY, up(), NOMINAL, zero_errors_n, ScatterMemory(), 0.03))
        return found.repeatability, found.std_error

    none, own, shared = errors((0.0, 0.0)), errors((0.8, 0.0)), errors((0.0, 0.8))
    assert shared[0] == none[0] < 0.5 * own[0]
    assert shared[1] == pytest.approx(own[1])


def test_the_uncertainty_of_the_zero_allows_for_a_weight_on_the_edge() -> None:
    """The uncertainty is 3/2 of the weight over the edge and the depth, as for a line through the origin and a plate
    that moves straight down. A leaning plate has less lever for a weight than for its volume, so this exceeds the true
    error by about half.
    """
    weight_n = 0.1
    reported = systematic(insertion(down(), zero_error_n=weight_n))
    lifted = [
        b._replace(adduction_nm=b.adduction_nm + weight_n * GEOMETRY.vertical_lever_m(b.sweep_rad, b.adduction_rad))
        for b in down()
    ]
    truly = insertion(lifted).value / K - 1.0
    assert truly < reported < 2.0 * truly
    assert reported == pytest.approx(
        1.5 * weight_n / (EDGE_M2 * 0.03) / K, rel=0.03
    )  # the middle of the last batch is less deep


@pytest.mark.parametrize("face_nm", [-0.3, 0.2])
def test_a_fraction_of_the_cross_coupling_stays_uncertain(face_nm: float) -> None:
    unfelt = insertion([batch._replace(sweep_nm=0.0) for batch in down(face_nm=face_nm)]).value
    reported = systematic(insertion(down(face_nm=face_nm)))
    assert reported == pytest.approx(CROSS_COUPLING_UNCERTAINTY * abs(unfelt / K - 1.0), rel=1e-3)


# invalid coefficients


def lever_m(batch: Batch) -> float:
    return GEOMETRY.vertical_lever_m(batch.sweep_rad, batch.adduction_rad)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_batches_in_poses_without_a_vertical_lever_do_not_count(sign: float) -> None:
    """The vertical lever is 14 mm at 5 cm and 30 degrees, and 30 mm at 4.68 cm."""
    batches = [loaded(batch_at(travel_m, sign * FRONT_RAD), sign * K) for travel_m in depths(end_m=0.05)[:: int(sign)]]
    unobservable = [batch for batch in batches if lever_m(batch) < MIN_VERTICAL_LEVER_M]
    wrong = [batch._replace(adduction_nm=9.0) if batch in unobservable else batch for batch in batches]
    reported, seen = ((insertion(each) if sign > 0.0 else extraction(each, start_m=0.07)) for each in (wrong, batches))
    assert 0.0468 < min(batch.travel_m for batch in unobservable) < 0.0468 + STEP_M
    assert reported == seen
    assert reported.valid
    assert reported.value == pytest.approx(K, rel=EXACT)
    assert reported.samples == SAMPLES * sum(batch.travel_m > 0.0 and batch not in unobservable for batch in batches)


def test_a_stroke_wholly_in_poses_without_a_vertical_lever_cannot_be_observed() -> None:
    """The mud begins 4.7 cm deep. A stroke that ends above has as few pieces, but not because of its poses."""
    batches = [loaded(batch_at(travel_m), K, 0.047) for travel_m in depths(end_m=0.05, step_m=0.0005)]
    reported = insertion(batches, surface_at(0.047))
    assert (reported.valid, reported.reason, reported.samples) == (False, UNOBSERVABLE, 0)
    above = [batch for batch in batches if lever_m(batch) >= MIN_VERTICAL_LEVER_M]
    assert insertion(above, surface_at(0.047)) == NOT_THERE


def test_a_fit_is_evaluated_with_its_full_error() -> None:
    reported = evaluated(OriginFit(K, 0.03 * K), 0.04 * K, 0.05 * K, STROKE)
    assert reported[:1] + reported[2:6] == (K, 7, True, "", False)
    assert (reported.depth_m, reported.speed_m_s) == (0.03, 0.1)
    assert reported.repeatability == pytest.approx(hypot(0.03, 0.04, TORQUE_REPEATABILITY) * K)
    assert reported.std_error == pytest.approx(hypot(0.03, 0.04, TORQUE_REPEATABILITY, 0.05, CONSTANT) * K)


def test_the_levelling_of_a_set_up_is_no_scatter_of_its_strokes() -> None:
    """The surface of a set-up has an error of 1 mm, of which 0.6 mm are the stroke's own."""
    known, level = insertion(down()), insertion(down(), NOMINAL._replace(std_error_m=0.001, own_error_m=0.0006))
    parts = [each.std_error**2 - each.repeatability**2 for each in (known, level)]
    own = level.repeatability**2 - known.repeatability**2
    assert own / (own + parts[1] - parts[0]) == pytest.approx(0.36)


@pytest.mark.parametrize(
    ("slope", "std_error", "reason"),
    [
        (-K, 0.01 * K, "the force does not oppose the motion"),
        (0.0, 0.01 * K, "the force does not oppose the motion"),
        (K, 1.01 * LARGEST_UNCERTAINTY * K, "the samples do not follow the law"),
        (nan, 1.0, "not finite"),
        (K, inf, "not finite"),
    ],
)
def test_an_invalid_estimate_has_a_reason(slope: float, std_error: float, reason: str) -> None:
    reported = evaluated(OriginFit(slope, std_error), 0.0, 0.0, STROKE)
    assert (reported.valid, reported.at_least, reported.samples, reported.reason) == (False, False, 7, reason)
    assert isfinite(reported.value) == (reason != "not finite")


def test_an_error_up_to_its_limit_is_valid() -> None:
    largest = K * float(np.sqrt(LARGEST_UNCERTAINTY**2 - TORQUE_REPEATABILITY**2 - CONSTANT**2))
    assert evaluated(OriginFit(K, 0.0), 0.99 * largest, 0.0, STROKE).valid
    assert not evaluated(OriginFit(K, 0.0), 0.0, 1.01 * largest, STROKE).valid


@example([0.0] * 28, -5e-324, 0.0)  # a piece of travel whose half underflows to zero
@given(st.lists(st.floats(), min_size=28, max_size=28), st.floats(-0.02, 0.02), st.floats(0.0, 1.0))
def test_no_torque_makes_it_raise(torques_nm: list[float], surface_m: float, zero_error_n: float) -> None:
    batches = [b._replace(adduction_nm=t, sweep_nm=t / 2.0) for b, t in zip(down(), torques_nm, strict=True)]
    for reported in (
        insertion(batches, surface_at(surface_m), zero_error_n),
        extraction(batches[::-1], surface_at(surface_m), zero_error_n),
        bound_extraction(GEOMETRY, batches, surface_at(surface_m)),
    ):
        assert isfinite(reported.value + reported.std_error) or not reported.valid


# the level above the mud


@pytest.mark.parametrize("level_nm", [-0.05, 0.0, 0.08])
def test_a_level_is_subtracted_in_proportion_to_the_arms_reach(level_nm: float) -> None:
    """The level was measured as the force τ₂ / cos α, so each pose loses it times cos α; nothing else changes."""
    batches = [*down(face_nm=0.1), *up(face_nm=0.1)]
    lifted = [b._replace(adduction_nm=b.adduction_nm + level_nm * cos(b.sweep_rad)) for b in batches]
    for freed, batch in zip(level_free(lifted, level_nm), batches, strict=True):
        assert freed.adduction_nm == pytest.approx(batch.adduction_nm, abs=1e-15)
        assert freed._replace(adduction_nm=0.0) == batch._replace(adduction_nm=0.0)


# a flipper that did not come out


def test_mud_that_did_not_yield_gives_a_lower_bound() -> None:
    """The flipper rose by 6 mm, too little for a fit."""
    batches = [loaded(batch_at(travel_m, -FRONT_RAD), -K, face_nm=0.2) for travel_m in (0.03, 0.028, 0.026, 0.024)]
    reported = bound_extraction(GEOMETRY, batches, surface_at(0.0))
    assert (reported.valid, reported.at_least, reported.reason) == (True, True, NOT_OUT)
    assert reported.value == pytest.approx(K, rel=EXACT)
    assert reported.repeatability == pytest.approx(TORQUE_REPEATABILITY * K)
    assert reported.std_error == pytest.approx(hypot(TORQUE_REPEATABILITY, CONSTANT) * K)
    assert reported.samples == 4 * SAMPLES


@pytest.mark.parametrize(
    ("body_m_s", "missing"), [(0.0, (0.0, 0.0)), (0.1, (0.542, 0.085)), (0.4, (2.0, 2.0)), (nan, (0.0, 0.0))]
)
def test_a_plate_that_its_body_slides_inward_is_freed_of_what_its_other_side_pushes(
    body_m_s: float, missing: tuple[float, ...]
) -> None:
    """The other side turns from resisting to pushing, twice the pressure of clay on the thickness, below the arm.

    The pressure is (3 + J ζ/b) times a strength, of which the face has k_s. It is that of 0.8 mm of slide.
    """
    k_s, depths_m, turn_rad_s = 0.4e6, [0.02, 0.018, 0.016], 2.0
    rising = [
        Batch(
            travel_m=depth_m,
            sweep_rad=-FRONT_RAD,
            adduction_rad=turn_rad_s * 0.01 * i,
            sweep_nm=0.3,
            adduction_nm=-0.1,
            body_m=body_m_s * 0.01 * i,
            saturated=False,
            samples=SAMPLES,
            speed_m_s=0.2,
        )
        for i, depth_m in enumerate(depths_m)
    ]
    freed = slide_free(GEOMETRY, rising, 0.0, k_s, 0.03)
    for before, after, part in zip(rising[1:], freed[1:], missing, strict=True):
        depth_m = before.travel_m
        steps_m = np.linspace(0.0, depth_m, 1001)  # from the surface down
        own_k_s = k_s * (0.03 / depth_m) ** 0.5
        strength_pa = own_k_s * depth_m**2 / 2.0 / np.trapezoid(3.0 + 0.5 * steps_m / 0.025, steps_m)
        side_n = strength_pa * 0.004 * np.trapezoid(3.0 + 0.5 * steps_m / 0.004, steps_m)
        side_nm = side_n * (0.05 - depth_m / 3.0)  # as of a pressure that grows with depth
        pushed_nm = part * cos(FRONT_RAD) * side_nm
        assert after.adduction_nm == pytest.approx(before.adduction_nm - pushed_nm, rel=1e-3)
