"""A free body may rise instead of its flippers going down: the uncertainty against muds whose law is known."""

from math import inf, log

import numpy as np
import pytest

from control.computing.bounded_work import finish
from control.controller import WalkOrder
from control.mud_estimate import Coefficient
from control.plate_integrals import stroke_moment_m4, submerged_plate
from control.records import Estimate, StrideEstimate
from estimation.strokes.depth_line import STROKE_LAW
from estimation.strokes.lift import LIFTED, less_deep, lift_uncertainty
from estimation.strokes.stroke import Batch
from experiments.robot.lockstep_robot import simulated_configuration, start_walk
from simulation.harness.lockstep import plant_of
from simulation.mud.clay import Clay
from simulation.mud.track import Track
from tests.estimation.synthetic_strides import GEOMETRY

SWEEP_RAD, DEEPEST_M = 0.5, 0.03
K_P = 1.0e6  # N/m³, at the deepest point of the joints
KNOWN = Estimate(K_P, 0.07 * K_P, 20, True, repeatability=0.05 * K_P)


def batch(depth_m: float, k_p: float) -> Batch:
    adduction_rad = GEOMETRY.adduction_rad(SWEEP_RAD, depth_m)
    moment_m4 = stroke_moment_m4(GEOMETRY, submerged_plate(GEOMETRY, SWEEP_RAD, adduction_rad), SWEEP_RAD)
    return Batch(depth_m, SWEEP_RAD, adduction_rad, 0.0, k_p * moment_m4, 0.0, False, 5, 0.1)


def insertion(exponent: float) -> list[Batch]:
    """Return the batches of a coefficient that changes with the joints' depth to this power."""
    depths_m = np.arange(0.001, DEEPEST_M + 1e-9, 0.0005)
    return [batch(depth_m, K_P * (depth_m / DEEPEST_M) ** exponent) for depth_m in depths_m]


def uncertainty(batches: list[Batch], lift_n: float = 0.0) -> float:
    return finish(lift_uncertainty(GEOMETRY, batches, 0.0, lift_n))


@pytest.mark.parametrize("rise", [0.0, 0.3, 0.7, 1.0])
def test_the_uncertainty_is_the_error_that_a_rising_body_makes_over_muds_of_all_laws(rise: float) -> None:
    """The plate goes on by (1 - rise) of the joints' travel, in logarithms, through mud of the exponent -0.4."""
    z0_m, mud = 0.005, STROKE_LAW.exponent
    exponent = (1.0 + mud) * (1.0 - rise) - 1.0  # of the force that mud has at the plate's own depth, over the joints'
    muds = np.random.default_rng(1).normal(*STROKE_LAW, 100_000)
    errors = np.maximum(muds - exponent, 0.0) * log(DEEPEST_M / z0_m)
    found = uncertainty(insertion(exponent))
    assert found == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.03)
    true_error = log((DEEPEST_M / z0_m) ** (mud - exponent))
    assert true_error <= found  # of the mud with the middle law


def test_a_force_that_cannot_lift_the_body_leaves_no_uncertainty_and_one_that_can_late_little() -> None:
    constant = insertion(-1.0)
    force_n = K_P * DEEPEST_M * GEOMETRY.plate_thickness_m * GEOMETRY.plate_width_m
    assert uncertainty(constant, inf) == uncertainty(constant, 1.5 * force_n) == 0.0
    growing = insertion(0.0)
    assert 0.0 < uncertainty(growing, 0.6 * force_n) < 0.5 * uncertainty(growing)


def test_too_few_pieces_after_the_body_may_have_risen_count_as_a_constant_force() -> None:
    strong = insertion(1.0)
    assert uncertainty(strong[-2:]) == pytest.approx(
        uncertainty(insertion(-1.0)) / log(6.0) * log(30.0 / 29.5), rel=0.1
    )
    dry = [
        each._replace(adduction_rad=0.5) for each in strong
    ]  # as a plate may be whose corner is not under its middle
    assert uncertainty([]) == uncertainty(dry) == 0.0


def test_an_uncertain_depth_widens_both_errors_and_leaves_no_value_without_meaning() -> None:
    widened = less_deep(KNOWN, 0.3)
    assert (widened.value, widened.valid, widened.reason) == (K_P, True, LIFTED)
    assert [widened.std_error, widened.repeatability] == pytest.approx([0.308e6, 0.304e6], rel=1e-3)
    lost = less_deep(KNOWN, 0.8)
    assert not lost.valid and lost.reason == LIFTED
    assert less_deep(KNOWN, 0.02).reason == ""  # less than the other errors
    bound = KNOWN._replace(at_least=True)
    assert less_deep(bound, 0.8) == bound


def test_a_free_body_that_its_flippers_lift_claims_no_coefficient_that_is_wrong() -> None:
    """0.5 kg in 6 kPa stands on its flippers at the surface: k_p would be 0.8 instead of 2.8 N/cm³ and claim 12 %."""
    (held, by_held), (free, by_free) = walked(False), walked(True)
    assert all(each.k_p.value < 0.5 * 2.8e6 for each in (*held, *free))
    assert all(each.k_p.valid for each in held) and not any(each.k_p.valid for each in free)
    assert {each.k_p.reason for each in free} == {LIFTED}
    # What the robot predicts by is what the joints feel, lifted or not; only the error that it reports is wider.
    assert by_free.value == by_held.value and by_free.repeatability == by_held.repeatability
    assert by_held.std_error < 0.2 * by_held.value < 0.6 * by_free.value < by_free.std_error


def walked(free: bool) -> tuple[list[StrideEstimate], Coefficient]:
    """Return the first stride of both flippers, and the left one's k_p in the robot's memory."""
    known = f"[adaptation]\nbody_mass_kg = 0.5\n[estimation]\nfree_body = {str(free).lower()}\n"
    configuration, mud = simulated_configuration(known), Track([(9.0, Clay("firm", 6000.0))])
    plant = plant_of(configuration, body_mass_kg=0.5, free_body=True)
    robot = start_walk(configuration, mud, 1, WalkOrder(0.03, adaptive=False), plant=plant)
    learning = robot.loop.learning
    assert robot.run_until(lambda: len(learning.strides) == 2, 4.0)
    remembered = learning.estimator.mud_estimate.left.k_p
    assert remembered is not None
    return [each.estimate for each in learning.strides], remembered
