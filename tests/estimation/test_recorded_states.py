"""A log's ages turn back into the stamps that the loop had, so that live and replay agree to the last digit."""

from math import inf

from hypothesis import given
from hypothesis import strategies as st

from control.records import NEVER_S, DriveState, Joints
from estimation.recorded_states import recorded_states


@given(st.floats(1e-3, 1e9), st.floats(0.0, 0.5))
def test_a_stamp_survives_the_log(now_s: float, fraction: float) -> None:
    stamp_s = now_s - fraction * now_s
    ages_s = (now_s - stamp_s,) * 4
    states = recorded_states(now_s, (1.0, 2.0, 3.0, 4.0), (0.0,) * 4, (5.0, 6.0, 7.0, 8.0), ages_s, ages_s)
    assert [state.angle_stamp_s for state in states] == [state.current_stamp_s for state in states] == [stamp_s] * 4


def test_each_signal_goes_to_its_joint_and_an_infinite_age_means_never() -> None:
    ages_s = (0.0, inf, 0.5, 0.25)
    states = recorded_states(1.0, (1.0, 2.0, 3.0, 4.0), (0.1, 0.2, 0.3, 0.4), (5.0, 6.0, 7.0, 8.0), ages_s)
    assert states == Joints(
        DriveState(1.0, 0.1, 1.0, 5.0, 1.0),
        DriveState(2.0, 0.2, NEVER_S, 6.0, 1.0),
        DriveState(3.0, 0.3, 0.5, 7.0, 1.0),
        DriveState(4.0, 0.4, 0.75, 8.0, 1.0),
    )
