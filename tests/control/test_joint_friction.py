"""The friction of a joint against numpy, and the laws that any friction must keep."""

from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.joint_friction import NO_FRICTION, SLOW_RAD_S, JointFriction

angles = st.floats(-10.0, 10.0)
velocities = st.floats(-50.0, 50.0)
frictions = st.builds(
    JointFriction,
    coulomb_nm=st.floats(0.0, 0.5),
    viscous_nm_s=st.floats(0.0, 0.1),
    cogging_nm=st.floats(0.0, 0.5),
    cogging_per_turn=st.integers(0, 1000),
    cogging_phase_deg=st.floats(-360.0, 360.0),
)


@given(frictions, angles, velocities)
def test_friction_is_the_docstrings_sum(friction: JointFriction, angle: float, velocity: float) -> None:
    """The tolerance is 1e-9, because a thousand periods a turn multiply the rounding of the angle by as much."""
    phase = np.deg2rad(friction.cogging_phase_deg)
    expected = (
        friction.coulomb_nm * np.tanh(velocity / SLOW_RAD_S)
        + friction.viscous_nm_s * velocity
        + friction.cogging_nm * np.sin(friction.cogging_per_turn * angle + phase)
    )
    assert friction.torque_nm(angle, velocity) == pytest.approx(float(expected), abs=1e-9)


@pytest.mark.parametrize("field", ["coulomb_nm", "viscous_nm_s", "cogging_nm", "cogging_per_turn"])
def test_no_motor_can_be_configured_to_spend_less_than_nothing(field: str) -> None:
    bounds, _ = get_type_hints(JointFriction, include_extras=True)[field].__metadata__
    assert bounds.minimum == 0.0
    assert getattr(NO_FRICTION, field) == 0.0
