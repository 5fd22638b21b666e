"""What every simulated drive does alike, commanded and read by the axes of its type over a bus."""

from dataclasses import replace
from math import exp

import pytest

from simulation.devices.drive import DriveError
from tests.simulation.devices.driven_drives import CONSTANT_NM_A, TICK_S, TYPES, DrivenDrives

STEP_NM = 0.01  # of the coarsest codes of torque

each_type = pytest.mark.parametrize("name", TYPES)


@each_type
@pytest.mark.parametrize("sign", [-1, 1])
def test_angle_velocity_and_torque_are_the_joint_s_whatever_the_sign_and_the_zero(name: str, sign: int) -> None:
    drives = DrivenDrives(name, sign=sign, zero_turn=0.25)
    drives.devices[0].measure(0.5, 2.0)
    drives.arm()
    drives.tick(0.3, count=3)
    assert drives.torque_nm() == pytest.approx(0.3, abs=STEP_NM)
    state = drives.state
    assert (state.angle_rad, state.velocity_rad_s) == pytest.approx((0.5, 2.0), abs=0.02)
    assert state.current_a * CONSTANT_NM_A == pytest.approx(0.3, abs=STEP_NM)
    counted = drives.drives
    assert (counted.malformed_frames, counted.unknown_frames, counted.refused_commands) == (0, 0, 0)


@each_type
@pytest.mark.parametrize("changes", [{"temperature_c": -50.0}, {"temperature_c": 200.0}, {"bus_voltage_v": 100.0}])
def test_a_temperature_or_voltage_beyond_its_codes_does_not_silence_a_drive(
    name: str, changes: dict[str, float]
) -> None:
    drives = DrivenDrives(name, changes)
    drives.tick(count=60)
    assert drives.state.heartbeat_stamp_s > 10.0 and not drives.drives.malformed_frames


@each_type
def test_a_drive_follows_torque_only_while_it_is_armed(name: str) -> None:
    drives = DrivenDrives(name)
    drives.devices[0].receive(drives.devices[0].forge_torque(5.0), drives.now_s)  # of another program, and idle
    drives.tick(count=3)
    assert not drives.axis.closed_loop and drives.torque_nm() == 0.0
    drives.arm()
    assert drives.axis.closed_loop and all(device.energised for device in drives.devices)
    assert abs(drives.torque_nm()) < STEP_NM
    drives.tick(0.3)
    drives.disarm()
    assert not any(device.energised for device in drives.devices) and drives.torque_nm() == 0.0
    drives.tick(count=60)
    assert not drives.axis.closed_loop


@each_type
def test_without_commands_the_watchdog_ends_torque_unless_it_is_off(name: str) -> None:
    for watchdog_s in (0.1, 0.0):
        drives = DrivenDrives(name, {"watchdog_s": watchdog_s})
        drives.arm()
        drives.tick(0.3)
        drives.wait(0.09)
        assert drives.torque_nm() == pytest.approx(0.3, abs=STEP_NM)
        drives.wait(0.02)
        assert (abs(drives.torque_nm()) < STEP_NM) is (watchdog_s > 0.0) is not drives.devices[0].energised


@each_type
def test_an_error_ends_torque_and_is_reported_until_it_is_cleared(name: str) -> None:
    drives = DrivenDrives(name)
    drives.arm()
    drives.devices[0].trip(DriveError.OVERCURRENT)
    drives.tick(0.3, count=60)
    assert drives.torque_nm() == 0.0 and not drives.axis.closed_loop
    assert drives.state.error_flags and drives.axis.health.active_errors and not drives.drives.axes[1].health.errors
    drives.disarm()
    drives.axis.clear_errors()
    if "AK80" in name:  # the errors of a CubeMars end with its supply
        drives.devices[0].restart(drives.now_s)
    drives.exchange()
    drives.tick(count=300 if "AK80" in name else 60)
    assert drives.state.error_flags == 0 and not drives.devices[0].failed and not drives.devices[0].energised


@each_type
def test_a_restart_while_armed_is_silent_counted_and_ends_without_torque(name: str) -> None:
    drives = DrivenDrives(name)
    drives.arm()
    drives.devices[0].restart(drives.now_s)
    before_s = drives.state.angle_stamp_s
    drives.tick(0.0, count=round(0.4 / TICK_S))
    assert drives.state.angle_stamp_s - before_s < 0.02
    drives.tick(0.0, count=round(0.9 / TICK_S))
    assert [axis.health.restarts for axis in drives.drives.axes] == [1, 0, 0, 0]
    assert not drives.axis.closed_loop and not drives.devices[0].energised


@each_type
def test_the_motor_s_own_clip_bounds_torque_in_both_directions(name: str) -> None:
    drives = DrivenDrives(name, {"motor_current_limit_a": 3.0})
    drives.arm()
    for sign in (1.0, -1.0):
        drives.tick(sign * 0.5, count=3)
        assert drives.torque_nm() == pytest.approx(sign * 3.0 * CONSTANT_NM_A)
        assert drives.state.current_a == pytest.approx(sign * 3.0, abs=0.1)


@each_type
def test_current_follows_its_command_with_the_stated_time_constant(name: str) -> None:
    drives = DrivenDrives(name, {"current_lag_s": 0.01})
    drives.arm()
    drives.tick(0.3)
    begun_nm, begun_s = drives.torque_nm(), drives.now_s
    for drives.now_s in (begun_s + 0.005, begun_s + 0.02):  # steps of any length
        torque_nm = drives.torque_nm()
    assert torque_nm == pytest.approx(0.3 + (begun_nm - 0.3) * exp(-2.0), abs=STEP_NM)


@each_type
def test_a_frozen_encoder_repeats_its_last_angle_at_exactly_zero_velocity(name: str) -> None:
    drives = DrivenDrives(name, {"velocity_noise_rad_s": 0.1})
    drives.arm()
    drives.devices[0].measure(0.5, 3.0)
    drives.tick(0.0, count=3)
    for device in drives.devices:
        device.parameters = replace(device.parameters, encoder_frozen=True)
    drives.devices[0].measure(0.9, 5.0)
    drives.tick(0.0, count=3)
    assert drives.state.angle_rad == pytest.approx(0.5, abs=1e-3)
    assert drives.state.velocity_rad_s == pytest.approx(0.0, abs=0.02)


@each_type
def test_late_and_repeated_values_are_of_the_past_and_the_newest_one_is_last(name: str) -> None:
    drives = DrivenDrives(name, {"message_delay_s": 0.02, "repeated_fraction": 0.5})
    drives.arm()
    start_s, angles_rad, ages_s = drives.now_s, list[float](), list[float]()
    for _ in range(400):
        drives.devices[0].measure(0.1 * (drives.now_s - start_s), 0.1)
        drives.tick(0.0)
        angles_rad.append(drives.state.angle_rad)
        ages_s.append(drives.now_s - start_s - angles_rad[-1] / 0.1)
    assert angles_rad == sorted(angles_rad)
    assert -0.005 < min(ages_s) < 0.02 < max(ages_s) < 0.1  # the age of repeated values is not bounded
    assert not drives.drives.malformed_frames


@each_type
@pytest.mark.parametrize("change", [{"message_delay_s": 0.02}, {"repeated_fraction": 0.5}])
def test_what_was_late_or_repeated_does_not_come_when_that_begins_again(name: str, change: dict[str, float]) -> None:
    drives, oldest_s = DrivenDrives(name), 0.0
    drives.arm()
    start_s, sound = drives.now_s, dict.fromkeys(change, 0.0)
    for changes in (change, sound, change, sound, change):
        for device in drives.devices:
            device.parameters = replace(device.parameters, **changes)  # type: ignore[arg-type]
        for _ in range(50):
            drives.devices[0].measure(0.1 * (drives.now_s - start_s), 0.1)
            drives.tick(0.0)
            oldest_s = max(oldest_s, drives.now_s - start_s - drives.state.angle_rad / 0.1)
    assert oldest_s < 0.06
