"""The force maps: the paper's against its matrix and numbers by hand, the smallest force against a pseudo-inverse."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from estimation.force_map import paper_force_n, smallest_force_n

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


geometries = st.builds(
    FlipperGeometry, flipper_length_m=st.floats(0.05, 1.0), drop_m=st.floats(0.0, 0.5), axis_height_m=st.just(0.06)
)


@given(geometries, angles, angles, torques, torques)
def test_the_smallest_force_is_the_pseudo_inverse_of_the_jacobians_transpose(
    geometry: FlipperGeometry, sweep: float, adduction: float, sweep_nm: float, adduction_nm: float
) -> None:
    """The tolerance is rounding times the condition of JᵀJ, which is a hundred at most in these poses."""
    jacobian = np.reshape(geometry.jacobian(sweep, adduction), (3, 2))
    force = np.linalg.pinv(jacobian.T) @ [sweep_nm, adduction_nm]
    found = smallest_force_n(geometry, sweep, adduction, sweep_nm, adduction_nm)
    assert found == pytest.approx((force[0], force[2]), rel=1e-9, abs=1e-9)
