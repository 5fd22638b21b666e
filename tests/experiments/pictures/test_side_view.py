"""The side view of the flipper agrees with the kinematics of control/ and with the plate's integrals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from experiments.pictures.side_view import view_from_side

GEOMETRY = FlipperGeometry()
SWEEPS = st.floats(-1.0, 1.0)
ADDUCTIONS = st.floats(-1.2, 0.6)


@given(SWEEPS, ADDUCTIONS, st.floats(-2.0, 2.0))
def test_the_edge_is_where_the_kinematics_put_it(sweep_rad: float, adduction_rad: float, body_x_m: float) -> None:
    view = view_from_side(GEOMETRY, sweep_rad, adduction_rad, body_x_m)
    x_m, _, z_m = GEOMETRY.edge_position(sweep_rad, adduction_rad)
    assert view.edge == pytest.approx((body_x_m + x_m, GEOMETRY.axis_height_m + z_m), abs=1e-12)
    assert view.edge[1] == pytest.approx(-GEOMETRY.depth_m(sweep_rad, adduction_rad), abs=1e-12)
    assert view.shoulder == (body_x_m, GEOMETRY.axis_height_m)


@given(SWEEPS, ADDUCTIONS, st.integers(0, 2**32 - 1))
def test_every_point_of_the_plate_is_seen_within_its_outline(sweep_rad: float, adduction_rad: float, seed: int) -> None:
    """The reference is a rotation about z by the sweep and then about x by the adduction, with matrices."""
    random = np.random.default_rng(seed)
    size = np.array([GEOMETRY.plate_thickness_m, GEOMETRY.plate_width_m, GEOMETRY.plate_height_m])
    inside = random.uniform(-0.5, 0.5, (20, 3)) * size + [0.0, GEOMETRY.flipper_length_m, size[2] / 2 - GEOMETRY.drop_m]
    sa, ca, sb, cb = np.sin(sweep_rad), np.cos(sweep_rad), np.sin(adduction_rad), np.cos(adduction_rad)
    sweep = np.array([[ca, sa, 0.0], [-sa, ca, 0.0], [0.0, 0.0, 1.0]])
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, cb, -sb], [0.0, sb, cb]])
    turned = inside @ (tilt @ sweep).T
    outline = np.array(view_from_side(GEOMETRY, sweep_rad, adduction_rad).plate)
    sides = np.roll(outline, -1, axis=0) - outline
    for x_m, _, z_m in turned:
        to_point = np.array([x_m, z_m + GEOMETRY.axis_height_m]) - outline
        assert np.all(sides[:, 0] * to_point[:, 1] - sides[:, 1] * to_point[:, 0] > -1e-12)
