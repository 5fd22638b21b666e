"""The paper's force map against its matrix in numpy and against numbers worked by hand."""

from math import pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from estimation.force_map import mud_torque_nm, paper_force_n

angles = st.floats(-pi / 3, pi / 3)
torques = st.floats(-2.0, 2.0)


@given(angles, angles, torques, torques, st.floats(0.05, 1.0))
def test_the_force_is_the_papers_matrix_times_the_torques(
    sweep: float, adduction: float, sweep_nm: float, adduction_nm: float, length_m: float
) -> None:
    matrix = np.array(
        [
            [np.cos(sweep) / length_m, 0.0],
            [-np.sin(adduction) * np.sin(sweep) / length_m, np.cos(adduction) * np.cos(sweep) / length_m],
        ]
    )
    force = paper_force_n(sweep, adduction, sweep_nm, adduction_nm, length_m)
    assert force == pytest.approx(tuple(matrix @ [sweep_nm, adduction_nm]), abs=1e-12)


@pytest.mark.parametrize(
    ("sweep_deg", "adduction_deg", "torques_nm", "forces_n"),
    [
        (0, 0, (0.12, 0.24), (1.0, 2.0)),  # level and square: each torque over the arm of 0.12 m
        (60, 0, (0.12, 0.24), (0.5, 1.0)),  # half of both
        (30, -30, (0.48, 0.0), (2.0 * 3.0**0.5, 1.0)),  # 4 cos 30 forward, 4 sin 30 sin 30 up
        (-30, -30, (0.48, 0.0), (2.0 * 3.0**0.5, -1.0)),
        (30, -60, (0.0, 0.48), (0.0, 3.0**0.5)),  # 4 cos 60 cos 30 up
    ],
)
def test_hand_numbers(
    sweep_deg: float, adduction_deg: float, torques_nm: tuple[float, float], forces_n: tuple[float, float]
) -> None:
    force = paper_force_n(radians(sweep_deg), radians(adduction_deg), *torques_nm, 0.12)
    assert force == pytest.approx(forces_n, abs=1e-12)


@given(angles, angles, st.floats(-10.0, 10.0))
def test_a_force_square_to_the_plate_has_exactly_the_forward_part_that_the_map_tells(
    sweep: float, adduction: float, normal_n: float
) -> None:
    jacobian = FlipperGeometry(0.12, 0.0, 0.03).jacobian(sweep, adduction)
    ca, sa, cb, sb = np.cos(sweep), np.sin(sweep), np.cos(adduction), np.sin(adduction)
    force = normal_n * np.array([ca, -sa * cb, -sa * sb])
    sweep_nm, adduction_nm = (np.reshape(jacobian, (3, 2)).T @ force).tolist()
    assert paper_force_n(sweep, adduction, sweep_nm, adduction_nm, 0.12)[0] == pytest.approx(force[0], abs=1e-12)


def test_the_mud_bears_what_motor_and_gravity_do_not_spend_on_motion() -> None:
    assert mud_torque_nm(motor_nm=-0.4, gravity_nm=0.0, inertial_nm=0.0) == pytest.approx(0.4)
    assert mud_torque_nm(motor_nm=0.3, gravity_nm=-0.3, inertial_nm=0.0) == 0.0
    assert mud_torque_nm(motor_nm=0.5, gravity_nm=-0.3, inertial_nm=0.2) == pytest.approx(0.0)
    assert mud_torque_nm(motor_nm=-0.5, gravity_nm=-0.1, inertial_nm=0.2) == pytest.approx(0.8)
