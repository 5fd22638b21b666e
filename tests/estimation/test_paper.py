"""The paper's method on strokes through synthetic mud that keeps the paper's laws: it recovers them, with the known
bias of its trigger.
"""

from collections.abc import Callable, Iterable, Sequence
from math import cos, inf, nan, radians, sin
from typing import NamedTuple

import numpy as np
import pytest

from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.rate import PERIOD_S
from control.records import Phase, StrideEstimate
from estimation.joint_load import FlipperDrive
from estimation.paper import MOBILISED_M, STEADY_FRACTION, SURFACE_FORCE_N, PaperEstimator
from firmware_host.configuration.gait_file import PROTOCOLS
from tests.estimation.synthetic_strides import (
    GAIT,
    GEOMETRY,
    WEIGHTLESS,
    Moment,
    Row,
    strides_of,
    update,
    walked,
)

EDGE_M2, WIDTH_M, LENGTH_M = 0.025 * 0.004, 0.025, 0.12
SWEEP_NM_A, ADDUCTION_NM_A = 0.083, 0.09
HEAVY = ArmMass(0.3, 0.07, 0.0004, 0.0006)
DRIVE = FlipperDrive(WEIGHTLESS, SWEEP_NM_A, ADDUCTION_NM_A)
EXACT = 1e-6


class Mud(NamedTuple):
    k_p: float = 1.0e6  # N/m³
    k_s: float = 0.6e6
    k_e: float = 0.7e6
    surface_m: float = 0.004


Force = tuple[float, float]  # forward and up, N
Law = Callable[[Moment], Force]
MUD = Mud()


def law_of(mud: Mud) -> Law:
    """Return the paper's three laws below the mud's surface."""

    def force_n(sample: Moment) -> Force:
        submerged_m = max(0.0, sample.depth_m - mud.surface_m)
        if sample.phase is Phase.INSERTION:
            return 0.0, mud.k_p * EDGE_M2 * submerged_m
        if sample.phase is Phase.STANCE:
            return mud.k_s * WIDTH_M * submerged_m**2 / 2.0, 1.5  # the upward force follows no law and must not matter
        if sample.phase is Phase.EXTRACTION:
            return 0.0, -mud.k_e * EDGE_M2 * submerged_m
        return 0.0, 0.0

    return force_n


def first_below(samples: Iterable[Moment], depth_m: float) -> Moment:
    return next(sample for sample in samples if sample.depth_m > depth_m)


def loaded(samples: Sequence[Moment], law: Law, mass: ArmMass = WEIGHTLESS) -> list[Row]:
    """Return the samples with the currents of the law's forces: the paper's map inverted, plus gravity and inertia."""
    result, before = [], samples[0]
    for sample in samples:
        force_x_n, force_z_n = law(sample)
        sa, ca, sb, cb = (trig(angle) for angle in (sample.sweep_rad, sample.adduction_rad) for trig in (sin, cos))
        mud_sweep_nm = LENGTH_M * force_x_n / ca
        mud_adduction_nm = (LENGTH_M * force_z_n + sb * sa * mud_sweep_nm) / (cb * ca)
        weight_nm = mass.arm_mass_kg * 9.81 * mass.center_of_mass_m
        dt_s = sample.now_s - before.now_s or inf
        sweep_rad_s2 = (sample.sweep_rad_s - before.sweep_rad_s) / dt_s
        adduction_rad_s2 = (sample.adduction_rad_s - before.adduction_rad_s) / dt_s
        sweep_nm = mass.sweep_inertia_kg_m2 * sweep_rad_s2 - mud_sweep_nm - weight_nm * sa * sb
        adduction_nm = mass.adduction_inertia_kg_m2 * adduction_rad_s2 - mud_adduction_nm + weight_nm * ca * cb
        before = sample
        result.append(sample.measured(sweep_nm / SWEEP_NM_A, adduction_nm / ADDUCTION_NM_A))
    return result


def triggered(samples: Sequence[Moment], mud: Mud, mass: ArmMass = WEIGHTLESS) -> list[Row]:
    """Load the samples as `loaded` does, from a sample on whose jump in force the trigger takes for the surface.

    There is no mud above it, so nothing is biased by finding the surface late.
    """
    start = first_below(samples, mud.surface_m)
    law = law_of(mud._replace(surface_m=start.depth_m))
    return loaded(samples, lambda sample: (0.0, 2.0 * SURFACE_FORCE_N) if sample is start else law(sample), mass)


def estimator(mass: ArmMass = WEIGHTLESS) -> PaperEstimator:
    return PaperEstimator("left", GEOMETRY, FlipperDrive(mass, SWEEP_NM_A, ADDUCTION_NM_A))


def one(rows: Iterable[Row], flipper: PaperEstimator | None = None) -> StrideEstimate:
    (stride,) = strides_of(rows, flipper or estimator())
    return stride


def assert_found(stride: StrideEstimate, mud: Mud) -> None:
    for estimate, truth in zip((stride.k_p, stride.k_s, stride.k_e), mud, strict=False):
        assert estimate.valid
        assert estimate.value == pytest.approx(truth, rel=EXACT)


# the law is found


@pytest.mark.parametrize("depth_m", [0.025, 0.03, 0.04, 0.05])
@pytest.mark.parametrize("mud", [MUD, Mud(0.25e6, 0.137e6, 0.25e6, 0.0), Mud(2.2e6, 1.1e6, 2.06e6, -0.005)])
def test_the_three_coefficients_of_known_mud_are_found(mud: Mud, depth_m: float) -> None:
    """The stride before, in another mud, does not count."""
    flipper, firm = estimator(), Mud(3.0e6, 2.0e6, 2.5e6)
    assert_found(one(triggered(walked(), firm), flipper), firm)
    assert_found(one(triggered(walked(depth_m), mud), flipper), mud)


def test_the_load_is_the_force_that_the_mud_exerts() -> None:
    law, flipper = law_of(MUD), estimator()
    for sample, row in zip(walked(), loaded(walked(), law), strict=True):
        load, _ = update(flipper, *row)
        assert (load.force_x_n, load.force_z_n) == pytest.approx(law(sample), abs=1e-12)
        assert load.depth_m == sample.depth_m


def test_forces_and_durations_of_the_stride_are_reported() -> None:
    samples = triggered(walked(), MUD)
    stride = one(samples)
    start = first_below(walked(), MUD.surface_m)
    submerged_m = 0.03 - start.depth_m
    assert stride.surface_m == start.depth_m
    assert stride.depth_m == pytest.approx(submerged_m, abs=1e-5)
    assert stride.insertion_force_n == pytest.approx(MUD.k_p * EDGE_M2 * submerged_m, rel=1e-3)
    assert stride.stance_force_n == pytest.approx(MUD.k_s * WIDTH_M * submerged_m**2 / 2.0)
    assert stride.extraction_force_n == pytest.approx(-MUD.k_e * EDGE_M2 * submerged_m, rel=1e-2)
    assert stride.insertion_s == pytest.approx(0.0445 / 0.1, abs=1.5 * PERIOD_S)
    assert stride.stance_s == pytest.approx(2.0 * radians(30.0) * 0.12 / 0.5, abs=1.5 * PERIOD_S)
    assert stride.extraction_s == pytest.approx(0.0445 / 0.5, abs=1.5 * PERIOD_S)
    assert stride.t_start_s == samples[0].now_s
    assert stride.t_end_s == next(sample.now_s for sample in samples if sample.phase is Phase.SWING)


def test_the_force_outside_of_the_steady_part_of_stance_does_not_count() -> None:
    law, steady_rad = law_of(MUD), STEADY_FRACTION * radians(30.0)
    samples = walked()

    def slow_to_mobilise(sample: Moment) -> Force:
        unsteady = sample.phase is Phase.STANCE and abs(sample.sweep_rad) > steady_rad
        return (0.0, 0.0) if unsteady else law(sample)

    assert one(loaded(samples, slow_to_mobilise)).k_s == one(loaded(samples, law)).k_s


def test_the_first_rise_of_the_extraction_does_not_count() -> None:
    law, samples = law_of(MUD), walked()

    def springy(sample: Moment) -> Force:
        springing = sample.phase is Phase.EXTRACTION and sample.depth_m > 0.03 - 0.9 * MOBILISED_M
        return (0.0, 2.0) if springing else law(sample)

    assert one(loaded(samples, springy)).k_e == one(loaded(samples, law)).k_e


def test_a_sample_of_the_insertion_above_the_surface_that_was_found_does_not_count() -> None:
    rows = triggered(walked(), MUD)
    last = max(index for index, row in enumerate(rows) if row.phase is Phase.INSERTION)
    above = rows[0].pushed(0.0, -5.0)._replace(now_s=rows[last].now_s)
    assert above.depth_m < MUD.surface_m
    assert one([*rows[: last + 1], above, *rows[last + 1 :]]).k_p == one(rows).k_p


# the trigger's known bias


@pytest.mark.parametrize("slope_n_m", [50.0, 100.0, 160.0, 300.0])
def test_the_trigger_finds_the_surface_too_deep_by_its_force_over_the_slope_which_biases_each_coefficient(
    slope_n_m: float,
) -> None:
    mud = Mud(k_p=slope_n_m / EDGE_M2, surface_m=0.0)
    samples = walked()
    stride = one(loaded(samples, law_of(mud)))
    late_m, per_tick_m = stride.surface_m, 0.1 / 0.88 * PERIOD_S
    assert SURFACE_FORCE_N / slope_n_m < late_m <= SURFACE_FORCE_N / slope_n_m + per_tick_m

    def line_bias(phase: Phase, shallowest_m: float, deepest_m: float) -> float:
        depths = np.array([sample.depth_m for sample in samples if sample.phase is phase])
        u = depths[(depths >= shallowest_m) & (depths < deepest_m)] - late_m
        return float((u @ (u + late_m)) / (u @ u))

    top_m = next(sample.depth_m for sample in samples if sample.phase is Phase.EXTRACTION)
    bias = stride.k_p.value / mud.k_p
    assert bias == pytest.approx(line_bias(Phase.INSERTION, late_m, inf))
    assert bias == pytest.approx(1.0 + 1.5 * late_m / stride.depth_m, rel=0.05)  # of even samples
    assert stride.k_e.value / mud.k_e == pytest.approx(line_bias(Phase.EXTRACTION, late_m, top_m - MOBILISED_M))
    assert stride.k_s.value / mud.k_s == pytest.approx((0.03 / (0.03 - late_m)) ** 2)


# gravity and inertia


@pytest.mark.parametrize(("mass", "gait"), [(WEIGHTLESS, PROTOCOLS["single_flipper"]), (HEAVY, GAIT)])
def test_the_law_is_found_through_pauses_and_without_gravity_and_inertia(mass: ArmMass, gait: GaitParameters) -> None:
    assert_found(one(triggered(walked(gait=gait), MUD, mass), estimator(mass)), MUD)


# the body's drag


def advancing(rows: Sequence[Row], speed_m_s: float) -> list[Row]:
    return [row._replace(body_m=speed_m_s * row.now_s) for row in rows]


def test_half_of_the_drag_is_added_while_the_body_advances() -> None:
    """At 0.2 m/s the body has advanced by 2 mm long before the steady part of stance."""
    samples, drag_n = triggered(walked(), MUD), 2.5
    plain = one(samples)
    reported = one(advancing(samples, 0.2), PaperEstimator("left", GEOMETRY, DRIVE, drag_n))
    added_n_m3 = drag_n / (WIDTH_M * plain.depth_m**2 / 2.0)
    assert reported.k_s.value == pytest.approx(
        MUD.k_s + added_n_m3, rel=1e-3
    )  # the deepest sample is 1 µm below the rest
    assert (reported.k_p, reported.k_e) == (plain.k_p, plain.k_e)


@pytest.mark.parametrize("speed_m_s", [0.0, -0.2, nan])
def test_no_drag_is_added_where_the_body_does_not_advance(speed_m_s: float) -> None:
    samples = triggered(walked(), MUD)
    reported = one(advancing(samples, speed_m_s), PaperEstimator("left", GEOMETRY, DRIVE, 2.5))
    assert reported.k_s == one(samples).k_s


# when a stride closes, and what it reports


def test_without_contact_nothing_is_valid_and_every_reason_is_given() -> None:
    stride = one(loaded(walked(), lambda sample: (0.0, 0.0)))
    assert stride.k_p.reason == "no force above 0.5 N in insertion"
    for estimate in (stride.k_p, stride.k_s, stride.k_e):
        assert not estimate.valid
        assert estimate.reason
    assert stride.surface_m == 0.0
    assert stride.released
