"""The error of a predicted load is known where the loads follow the laws themselves."""

from math import radians, sin, sqrt

import pytest

from control.geometry import FlipperGeometry
from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.rate import PERIOD_S
from control.records import Phase
from experiments.trials.predicted_load import LoadError, load_errors
from experiments.trials.trial import TrueLoad

TRUE_N_M3 = {"k_p": 1e6, "k_s": 3e5, "k_e": 8e5}
GEOMETRY, SURFACE_M, DEPTH_M, FRONT_RAD = FlipperGeometry(), 0.002, 0.03, radians(30.0)
SIGNS = {Phase.INSERTION: 1.0, Phase.EXTRACTION: -1.0}
LAWS = {Phase.INSERTION: "k_p", Phase.EXTRACTION: "k_e"}


def load(number: int, phase: Phase, sweep_rad: float, depth_m: float) -> TrueLoad:
    """Return the load by the laws, of a flipper on a body at rest."""
    angles_rad = sweep_rad, GEOMETRY.adduction_rad(sweep_rad, depth_m + SURFACE_M)
    plate = submerged_plate(GEOMETRY, *angles_rad, SURFACE_M)
    sweep_nm = TRUE_N_M3["k_s"] * stance_moment_m4(GEOMETRY, plate) if phase is Phase.STANCE else 0.0
    lifting_nm = 0.0
    if phase in LAWS:
        lifting_nm = SIGNS[phase] * TRUE_N_M3[LAWS[phase]] * stroke_moment_m4(GEOMETRY, plate, sweep_rad)
    across_nm = cross_coupling(GEOMETRY, plate, sweep_rad) * sweep_nm
    return TrueLoad(number * PERIOD_S, phase, angles_rad, 0.0, sweep_nm, lifting_nm + across_nm)


def crutching() -> list[TrueLoad]:
    """Return a stride that goes down, sweeps to the other side, and comes up."""
    steps = [DEPTH_M * n / 100.0 for n in range(-5, 101)]
    sweeps = [FRONT_RAD * (1.0 - n / 50.0) for n in range(101)]
    parts = [(Phase.INSERTION, sweeps[0], depth_m) for depth_m in steps]
    parts += [(Phase.STANCE, sweep_rad, DEPTH_M) for sweep_rad in sweeps]
    parts += [(Phase.EXTRACTION, sweeps[-1], depth_m) for depth_m in reversed(steps)]
    return [load(number, *part) for number, part in enumerate(parts)]


def errors_of(loads: list[TrueLoad], **factors: float) -> dict[str, LoadError]:
    predicted = {name: factor * TRUE_N_M3[name] for name, factor in factors.items()}
    return load_errors(loads, GEOMETRY, SURFACE_M, predicted)


def test_a_right_prediction_of_a_lawful_ground_has_no_error() -> None:
    found = errors_of(crutching(), k_p=1.0, k_s=1.0, k_e=1.0)
    assert found.keys() == TRUE_N_M3.keys()
    assert [*found.values()] == [pytest.approx((0.0, 0.0), abs=0.003)] * 3  # of batches of 1 to 6 mm


def test_a_tenth_too_much_is_a_tenth_of_the_torque_that_it_predicts() -> None:
    """The torque of the paper's plate grows in proportion to depth, whose RMS is 1/√3 of its end; a stance has one."""
    loads = crutching()
    found = errors_of(loads, k_p=1.1, k_s=0.9)
    plate = submerged_plate(GEOMETRY, FRONT_RAD, GEOMETRY.adduction_rad(FRONT_RAD, DEPTH_M + SURFACE_M), SURFACE_M)
    pushed_nm = TRUE_N_M3["k_p"] * stroke_moment_m4(GEOMETRY, plate, FRONT_RAD)
    largest_nm = max(each.sweep_nm for each in loads)
    assert found["k_p"].prediction == pytest.approx(0.1 * pushed_nm / largest_nm / sqrt(3.0), rel=0.1)
    assert found["k_s"].prediction == pytest.approx(0.1, rel=0.1)


def test_a_walk_backward_has_the_same_errors() -> None:
    loads = crutching()
    mirrored = [
        each._replace(angles_rad=(-each.angles_rad[0], each.angles_rad[1]), sweep_nm=-each.sweep_nm) for each in loads
    ]
    forward, backward = (errors_of(each, k_p=1.1, k_s=1.1, k_e=1.1) for each in (loads, mirrored))
    assert backward == {name: pytest.approx(error) for name, error in forward.items()}


def test_mud_that_holds_has_no_error_of_its_shear() -> None:
    """The body advances as far as the flippers sweep."""
    held = [each._replace(body_m=-GEOMETRY.flipper_length_m * sin(each.angles_rad[0])) for each in crutching()]
    assert errors_of(held, k_p=1.0, k_s=1.0).keys() == {"k_p"}
