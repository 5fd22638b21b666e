"""The flipper's kinematics against rotation matrices, numeric derivatives and the reference's worked numbers."""

from math import cos, hypot, pi, radians

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from control.geometry import MIN_LEVER_M, FlipperGeometry

AUTHORS = FlipperGeometry(flipper_length_m=0.12, drop_m=0.05, axis_height_m=0.0645)
STEP_RAD = 1e-6

geometries = st.builds(
    FlipperGeometry,
    flipper_length_m=st.floats(0.02, 1.0),
    drop_m=st.floats(0.0, 0.5),
    axis_height_m=st.floats(0.0, 1.0),
)
sweeps = st.floats(-pi / 3, pi / 3)
adductions = st.floats(-pi / 2, pi / 2)


def rotated_edge(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> NDArray[np.float64]:
    """Return the arm as a vector, turned about the flipper's own axis and then about the body's fore-aft axis."""
    arm = np.array([0.0, geometry.flipper_length_m, -geometry.drop_m])
    edge: NDArray[np.float64] = rotation(sweep_rad, adduction_rad) @ arm
    return edge


def rotation(sweep_rad: float, adduction_rad: float) -> NDArray[np.float64]:
    ca, sa, cb, sb = np.cos(sweep_rad), np.sin(sweep_rad), np.cos(adduction_rad), np.sin(adduction_rad)
    sweep_about_z = np.array([[ca, sa, 0.0], [-sa, ca, 0.0], [0.0, 0.0, 1.0]])  # forward positive: clockwise from above
    adduction_about_x = np.array([[1.0, 0.0, 0.0], [0.0, cb, -sb], [0.0, sb, cb]])
    turned: NDArray[np.float64] = adduction_about_x @ sweep_about_z
    return turned


@given(geometries, sweeps, adductions)
def test_the_edge_is_where_rotation_matrices_put_it(geometry: FlipperGeometry, sweep: float, adduction: float) -> None:
    edge = rotated_edge(geometry, sweep, adduction)
    assert geometry.edge_position(sweep, adduction) == pytest.approx(tuple(edge), abs=1e-14)
    assert geometry.depth_m(sweep, adduction) == pytest.approx(-edge[2] - geometry.axis_height_m, abs=1e-14)


@given(geometries, sweeps, adductions)
def test_the_jacobian_is_the_derivative_of_the_rotated_edge(
    geometry: FlipperGeometry, sweep: float, adduction: float
) -> None:
    by_sweep = rotated_edge(geometry, sweep + STEP_RAD, adduction) - rotated_edge(geometry, sweep - STEP_RAD, adduction)
    by_adduction = rotated_edge(geometry, sweep, adduction + STEP_RAD) - rotated_edge(
        geometry, sweep, adduction - STEP_RAD
    )
    numeric = np.column_stack([by_sweep, by_adduction]) / (2.0 * STEP_RAD)
    assert np.reshape(geometry.jacobian(sweep, adduction), (3, 2)) == pytest.approx(numeric, abs=1e-8)


@given(geometries, sweeps, st.floats(-pi, pi))
def test_the_adduction_of_a_depth_comes_back_from_forward_kinematics(
    geometry: FlipperGeometry, sweep: float, adduction: float
) -> None:
    assume(geometry.vertical_lever_m(sweep, adduction) >= MIN_LEVER_M)
    depth = geometry.depth_m(sweep, adduction)
    assert geometry.adduction_rad(sweep, depth) == pytest.approx(adduction, abs=1e-9)


@given(geometries, sweeps, st.floats(-1.0, 1.0))
def test_every_depth_is_either_reached_or_refused(geometry: FlipperGeometry, sweep: float, depth: float) -> None:
    try:
        adduction = geometry.adduction_rad(sweep, depth)
    except ValueError:
        assert not geometry.is_reachable(sweep, depth)
    else:
        assert geometry.depth_m(sweep, adduction) == pytest.approx(depth, abs=1e-12)


@given(sweeps, st.floats(-0.03, 0.045), st.floats(-10.0, 10.0), st.floats(-1.0, 1.0))
def test_the_adduction_velocity_is_the_derivative_of_the_depth_law(
    sweep: float, depth: float, sweep_velocity: float, depth_velocity: float
) -> None:
    time = 1e-6
    assume(AUTHORS.is_reachable(abs(sweep) + 0.01, depth + 0.001))
    later = AUTHORS.adduction_rad(sweep + sweep_velocity * time, depth + depth_velocity * time)
    before = AUTHORS.adduction_rad(sweep - sweep_velocity * time, depth - depth_velocity * time)
    velocity = AUTHORS.adduction_velocity_rad_s(
        sweep, AUTHORS.adduction_rad(sweep, depth), sweep_velocity, depth_velocity
    )
    assert velocity == pytest.approx((later - before) / (2.0 * time), rel=1e-5, abs=1e-5)


@given(geometries, sweeps, adductions)
def test_the_vertical_lever_is_the_rise_of_the_edge_per_radian(
    geometry: FlipperGeometry, sweep: float, adduction: float
) -> None:
    assert geometry.vertical_lever_m(sweep, adduction) == pytest.approx(
        geometry.jacobian(sweep, adduction).z_adduction, abs=1e-15
    )


def test_the_edge_cannot_pass_508_cm_at_thirty_degrees() -> None:
    AUTHORS.adduction_rad(radians(30.0), 0.0508)
    with pytest.raises(ValueError, match="out of the flipper's reach"):
        AUTHORS.adduction_rad(radians(30.0), 0.0509)
    with pytest.raises(ValueError, match="out of the flipper's reach"):
        AUTHORS.adduction_rad(radians(-30.0), 0.0509)
    with pytest.raises(ValueError, match="out of the flipper's reach"):
        AUTHORS.adduction_rad(0.0, -0.2)


@given(geometries, st.floats(1.0, 60.0))
def test_deepest_and_reachable_agree_at_the_edge(geometry: FlipperGeometry, sweep_deg: float) -> None:
    sweep = radians(sweep_deg)
    assume(hypot(geometry.flipper_length_m * cos(sweep), geometry.drop_m) > 1.1 * MIN_LEVER_M)
    deepest = geometry.deepest_m(sweep_deg)
    assume(deepest + geometry.axis_height_m > 1e-3)
    assert geometry.is_reachable(sweep, deepest - 1e-9)
    assert not geometry.is_reachable(sweep, deepest + 1e-9)
    assert geometry.vertical_lever_m(sweep, geometry.adduction_rad(sweep, deepest)) == pytest.approx(
        MIN_LEVER_M, abs=1e-9
    )


def test_an_arm_shorter_than_the_least_lever_reaches_no_depth_below_its_axis() -> None:
    stub = FlipperGeometry(flipper_length_m=0.02, drop_m=0.0, axis_height_m=0.05)
    assert stub.deepest_m(75.0) == -0.05
    assert not stub.is_reachable(radians(75.0), -0.05 + 1e-9)


def test_the_clearance_is_the_height_of_the_level_edge() -> None:
    assert AUTHORS.clearance_m == pytest.approx(0.0145)
    assert AUTHORS.depth_m(0.7, 0.0) == pytest.approx(-AUTHORS.clearance_m)
