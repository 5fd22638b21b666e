"""Every fault on both sides of its bound, and the order in which joints are blamed."""

from math import inf, nan, radians
from typing import Any

import pytest

from control.faults import HEARTBEAT_SILENCE_S, Fault, find_fault, held_by_the_mud
from control.limits import JointLimits, JointRange
from control.records import JOINTS, NEVER_S, DriveState, DriveStates

NOW_S = 100.0
SILENCE_S = 0.05
LIMITS = JointLimits(position_margin_deg=10.0)
SWEEP, ADDUCTION = JointRange(radians(-60.0), radians(60.0)), JointRange(radians(-75.0), radians(45.0))
RANGES = (SWEEP, ADDUCTION, SWEEP, ADDUCTION)
HEALTHY = DriveState(
    angle_rad=0.1,
    velocity_rad_s=0.0,
    angle_stamp_s=NOW_S,
    current_a=0.0,
    current_stamp_s=NOW_S,
    closed_loop=True,
    heartbeat_stamp_s=NOW_S,
    temperature_c=25.0,
)


def found(joint: int, expected: bool = True, /, **changes: Any) -> Fault | None:
    """The fault of four healthy drives of which one is different."""
    drives = [HEALTHY, HEALTHY, HEALTHY, HEALTHY]
    drives[joint] = HEALTHY._replace(**changes)
    a, b, c, d = drives
    return find_fault((a, b, c, d), RANGES, LIMITS, SILENCE_S, expected, NOW_S)


def test_healthy_drives_have_no_fault() -> None:
    assert found(0) is None


@pytest.mark.parametrize("joint", range(4))
@pytest.mark.parametrize(
    ("stamp", "signal", "bound_s"),
    [
        ("angle_stamp_s", "position", SILENCE_S),
        ("current_stamp_s", "current", SILENCE_S),
        ("heartbeat_stamp_s", "heartbeat", HEARTBEAT_SILENCE_S),
    ],
)
def test_a_signal_is_silent_from_its_bound_on(joint: int, stamp: str, signal: str, bound_s: float) -> None:
    assert found(joint, **{stamp: NOW_S - bound_s + 1e-6}) is None
    fault = found(joint, **{stamp: NOW_S - bound_s - 1e-6})
    silence_ms = f"{bound_s * 1e3:.0f}"
    sentence = f"No {signal} came from the {JOINTS[joint]} drive for {silence_ms} ms."
    assert fault == Fault("drive_silent", sentence)


@pytest.mark.parametrize("joint", range(4))
@pytest.mark.parametrize("stamp", ["angle_stamp_s", "current_stamp_s", "heartbeat_stamp_s"])
def test_a_signal_that_never_came_is_said_to_be_missing_at_all(joint: int, stamp: str) -> None:
    fault = found(joint, **{stamp: NEVER_S})
    assert fault is not None
    assert fault.name == "drive_silent"
    assert fault.sentence.endswith(f"came from the {JOINTS[joint]} drive at all.")


@pytest.mark.parametrize("joint", range(4))
@pytest.mark.parametrize("flags", [1, 0x10, 0x4000000])
def test_any_error_flag_is_a_fault(joint: int, flags: int) -> None:
    assert found(joint, error_flags=flags) == Fault(
        "drive_error", f"The {JOINTS[joint]} drive reports error 0x{flags:x}."
    )


@pytest.mark.parametrize("joint", range(4))
def test_a_joint_may_be_past_its_range_by_the_margin_and_no_further(joint: int) -> None:
    for edge, outward in ((RANGES[joint].max_rad + radians(10.0), 1.0), (RANGES[joint].min_rad - radians(10.0), -1.0)):
        assert found(joint, angle_rad=edge - outward * 1e-9) is None
        fault = found(joint, angle_rad=edge + outward * 1e-9)
        assert fault is not None
        assert fault.name == "joint_position"
        assert JOINTS[joint] in fault.sentence


@pytest.mark.parametrize("angle", [nan, inf, -inf])
def test_an_angle_that_is_not_a_number_is_out_of_range(angle: float) -> None:
    fault = found(1, angle_rad=angle)
    assert fault is not None
    assert fault.name == "joint_position"


@pytest.mark.parametrize("joint", range(4))
def test_a_motor_is_hot_from_its_bound_on(joint: int) -> None:
    assert found(joint, temperature_c=LIMITS.temperature_hot_c - 0.01) is None
    for temperature in (LIMITS.temperature_hot_c, 200.0, inf):
        fault = found(joint, temperature_c=temperature)
        assert fault is not None
        assert fault.name == "motor_hot"
        assert JOINTS[joint] in fault.sentence


def test_a_drive_without_thermistor_is_never_hot() -> None:
    assert found(2, temperature_c=nan) is None
    assert found(2, temperature_c=0.0) is None


@pytest.mark.parametrize("joint", range(4))
def test_a_drive_out_of_closed_loop_is_a_fault_only_where_it_is_expected_there(joint: int) -> None:
    assert found(joint, False, closed_loop=False) is None
    assert found(joint, True, closed_loop=False) == Fault(
        "drive_disarmed", f"The {JOINTS[joint]} drive left closed loop by itself."
    )


def test_the_first_joint_at_fault_is_named() -> None:
    broken = HEALTHY._replace(error_flags=1)
    hot = HEALTHY._replace(temperature_c=120.0)
    states: DriveStates = (HEALTHY, hot, HEALTHY, broken)
    fault = find_fault(states, RANGES, LIMITS, SILENCE_S, True, NOW_S)
    assert fault is not None
    assert (fault.name, JOINTS[1] in fault.sentence) == ("motor_hot", True)


def test_of_one_joint_silence_is_named_before_anything_it_may_have_caused() -> None:
    fault = found(3, angle_stamp_s=NEVER_S, angle_rad=nan, error_flags=1, temperature_c=120.0, closed_loop=False)
    assert fault is not None
    assert fault.name == "drive_silent"


def test_drives_that_were_never_heard_are_silent() -> None:
    fault = find_fault((DriveState(),) * 4, RANGES, LIMITS, SILENCE_S, False, NOW_S)
    assert fault == Fault("drive_silent", "No position came from the left_sweep drive at all.")


def test_stuck_flippers_are_named_with_the_attempts_and_what_to_do() -> None:
    one, both = held_by_the_mud(["right"], 1), held_by_the_mud(["left", "right"], 3)
    assert one.name == both.name == "flipper_stuck"
    assert one.sentence.startswith("The right flipper is stuck in the mud after 1 attempt: free it by hand")
    assert both.sentence.startswith("Both flippers are stuck in the mud after 3 attempts: free them by hand")
