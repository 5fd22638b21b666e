"""A drive that fell silent may have torque, even if it last reported that it was idle."""

from __future__ import annotations

import pytest

from command_line.robot_text import is_stale, torque_state


@pytest.mark.parametrize(
    ("age_s", "closed_loop", "state"),
    [
        (0.09, True, "on"),
        (0.09, False, "off"),
        (0.7, True, "unknown"),
        (0.7, False, "unknown"),
        (None, True, "unknown"),
    ],
)
def test_the_torque_of_a_silent_drive_is_unknown(age_s: float | None, closed_loop: bool, state: str) -> None:
    assert torque_state({"heartbeat_age_s": age_s, "closed_loop": closed_loop}) == state


@pytest.mark.parametrize(("age_s", "stale"), [(0.002, False), (0.5, True), (None, True)])
def test_a_position_that_does_not_come_any_more_is_stale(age_s: float | None, stale: bool) -> None:
    assert is_stale({"angle_age_s": age_s}) == stale
