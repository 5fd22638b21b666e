"""A drive's set-point against the last commands: other programs, late commands, and differences that are no fault."""

from math import nan, pi
from random import Random

import pytest

from control.rate import PERIOD_S
from drivers.setpoint_monitor import SetpointMonitor

REPORTS_A_HEARTBEAT = 50
TURN_RAD = 2.0 * pi
LONGEST_REPORTS = 250  # 0.5 s


def make_monitor(command_delay_s: float = 0.0079) -> SetpointMonitor:
    return SetpointMonitor(command_delay_s, velocity_limit_turn_s=4.0, velocity_gain_nm_s_turn=0.5)


def commanded(*torques_nm: float) -> SetpointMonitor:
    """Return the monitor after these commands, or after three of 0.3 N·m."""
    monitor = make_monitor()
    for torque_nm in torques_nm or [0.3] * 3:
        monitor.on_command(torque_nm)
    return monitor


def reports_until_found(monitor: SetpointMonitor, setpoints_nm: list[float], velocity_rad_s: float = 0.0) -> int | None:
    """Return after how many reports, in closed loop with heartbeats, a mismatch is found."""
    for number, setpoint_nm in enumerate(setpoints_nm, start=1):
        monitor.on_report(setpoint_nm, velocity_rad_s)
        if number % REPORTS_A_HEARTBEAT == 0:
            monitor.on_heartbeat(closed_loop=True)
        if monitor.found:
            return number
    return None


@pytest.mark.parametrize(("every", "longest"), [(1, 6), (2, 12), (4, 30), (10, 100), (20, 600)])
def test_a_foreign_torque_after_every_nth_command_is_found(every: int, longest: int) -> None:
    monitor = commanded()
    found = reports_until_found(monitor, [1.0 if number % every == 0 else 0.3 for number in range(1000)])
    assert found is not None and found <= longest


def test_one_report_in_thirty_that_differs_is_never_a_fault() -> None:
    monitor = commanded()
    assert reports_until_found(monitor, [1.0 if number % 30 == 0 else 0.3 for number in range(30000)]) is None


@pytest.mark.parametrize("setpoint_nm", [0.1, 0.2, 0.3, 0.15, 0.25, 0.07, 0.38])
def test_the_last_three_commands_and_torques_between_them_are_followed(setpoint_nm: float) -> None:
    monitor = commanded(0.7, 0.1, 0.2, 0.3)
    assert reports_until_found(monitor, [setpoint_nm] * LONGEST_REPORTS) is None


@pytest.mark.parametrize("setpoint_nm", [-0.1, 0.7, -0.3, 0.45])
def test_older_commands_and_other_torques_are_not(setpoint_nm: float) -> None:
    monitor = commanded(0.7, 0.1, 0.2, 0.3)
    assert reports_until_found(monitor, [setpoint_nm] * LONGEST_REPORTS) == 6


def test_a_longer_delay_of_commands_is_allowed_where_it_is_configured() -> None:
    monitor = make_monitor(command_delay_s=20 * PERIOD_S)
    for torque_nm in (0.7, *[0.1] * 19):
        monitor.on_command(torque_nm)
    assert reports_until_found(monitor, [0.7] * LONGEST_REPORTS) is None
    monitor.on_command(0.1)
    assert reports_until_found(monitor, [0.7] * LONGEST_REPORTS) == 6


@pytest.mark.parametrize("factor", [0.83, 1.18])
def test_a_drive_with_another_convention_of_its_torque_constant_is_no_mismatch(factor: float) -> None:
    monitor, random = make_monitor(), Random(1)
    for _ in range(2000):
        torque_nm = random.uniform(-0.75, 0.75)
        monitor.on_command(torque_nm)
        monitor.on_report(torque_nm * factor, 0.0)
    assert not monitor.found


@pytest.mark.parametrize("absent", [0.0, nan])
def test_a_drive_that_left_closed_loop_by_itself_is_no_mismatch(absent: float) -> None:
    monitor = commanded()
    for _ in range(REPORTS_A_HEARTBEAT - 1):
        monitor.on_report(absent, 0.0)
    assert not monitor.found
    monitor.on_heartbeat(closed_loop=False)
    monitor.on_heartbeat(closed_loop=True)
    assert not monitor.found


def test_zero_torque_of_another_program_is_found_at_the_next_heartbeat() -> None:
    monitor = commanded()
    found = reports_until_found(monitor, [0.0, 0.3] * LONGEST_REPORTS)
    assert found == REPORTS_A_HEARTBEAT


@pytest.mark.parametrize(("velocity_turn_s", "found"), [(0.0, True), (1.5, True), (3.6, False), (9.0, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_torque_that_the_drive_reduces_near_its_velocity_limit_is_no_mismatch(
    velocity_turn_s: float, sign: int, found: bool
) -> None:
    """The limit is 4 turns/s and the gain 0.5 N·m per turn/s."""
    for setpoint_nm in (0.1, -0.4):
        monitor = commanded(*[sign * 0.5] * 3)
        reported = reports_until_found(
            monitor, [sign * setpoint_nm] * LONGEST_REPORTS, sign * velocity_turn_s * TURN_RAD
        )
        assert (reported is not None) == found


@pytest.mark.parametrize("sign", [1, -1])
def test_torque_that_speeds_a_fast_joint_up_is_a_mismatch(sign: int) -> None:
    monitor = commanded(0.0, 0.0, 0.0)
    assert reports_until_found(monitor, [sign * 1.0] * 10, sign * 9.0 * TURN_RAD) == 6


def test_commands_that_may_not_have_left_are_not_expected_back() -> None:
    monitor = commanded()
    for _ in range(LONGEST_REPORTS):
        monitor.on_command(0.5)
        monitor.forget_commands()
        monitor.on_report(-0.7, 0.0)
    assert not monitor.found
    for _ in range(3):
        monitor.on_command(0.5)
    assert reports_until_found(monitor, [-0.7] * LONGEST_REPORTS) == 6


def test_a_mismatch_ends_with_the_closed_loop_and_with_matching_reports() -> None:
    for end in (lambda m: m.on_heartbeat(closed_loop=False), lambda m: [m.on_report(0.3, 0.0) for _ in range(300)]):
        monitor = commanded()
        assert reports_until_found(monitor, [1.0] * 20) is not None
        end(monitor)
        assert not monitor.found
