"""A drive that fell silent may have torque, even if it last reported that it was idle."""

from typing import Any

import pytest

from command_line.robot_text import is_stale, quota_text, torque_state, unheard_text
from control.records import JOINTS


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


def test_the_status_names_drives_that_were_not_heard_yet() -> None:
    heard: dict[str, Any] = {"angle_age_s": 0.0, "current_age_s": 0.0, "heartbeat_age_s": 0.1}
    drives = [heard | {"joint": joint} for joint in JOINTS]
    drives[1] = drives[1] | {"heartbeat_age_s": None}
    drives[3] = drives[3] | {"angle_age_s": None}
    line = unheard_text({"drives": drives})
    assert "left_adduction, right_adduction" in line and "left_sweep" not in line


@pytest.mark.parametrize(
    ("quota_bytes", "free", "text"),
    [
        (8e9, 0.1, "at more than 8 GB of logs or less than 10 % of the disk free the oldest copied log is deleted"),
        (0, 0.05, "at less than 5 % of the disk free the oldest copied log is deleted, uncopied ones last"),
        (0, 0.0, "no log is deleted"),
    ],
)
def test_it_is_said_which_logs_are_deleted_and_when(quota_bytes: int, free: float, text: str) -> None:
    assert quota_text(quota_bytes, free).startswith(text)
