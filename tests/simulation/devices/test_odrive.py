"""The simulated drive follows ODrive's documentation: states, watchdog, clamps, periods, answers."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from math import exp, isfinite, pi
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.frames import Frame
from drivers.odrive.codec import (
    CLEAR_ERRORS,
    ERROR_ESTOP,
    ERROR_INITIALIZING,
    ERROR_WATCHDOG,
    ESTOP,
    GET_BUS_VOLTAGE_CURRENT,
    GET_ENCODER_ESTIMATES,
    GET_ERROR,
    GET_IQ,
    GET_TEMPERATURE,
    GET_VERSION,
    HEARTBEAT,
    RX_SDO,
    SET_AXIS_STATE,
    SET_CONTROLLER_MODE,
    SET_INPUT_TORQUE,
    SET_LIMITS,
    TX_SDO,
    AxisState,
    Message,
    arbitration_id,
)
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.odrive.device import BOOT_S, SimulatedOdrive

NODE = 3
ANSWERED = [
    GET_VERSION, HEARTBEAT, GET_ERROR, GET_ENCODER_ESTIMATES, GET_IQ, GET_TEMPERATURE, GET_BUS_VOLTAGE_CURRENT
]  # fmt: skip


def make_drive(**changes: float) -> SimulatedOdrive:
    return SimulatedOdrive(SimulatedDriveParameters(NODE, **changes), Random(1))  # type: ignore[arg-type]


def report(drive: SimulatedOdrive, message: Message, *values: float, now_s: float = 0.0) -> None:
    assert drive.receive(Frame(arbitration_id(NODE, message), message.encode(*values)), now_s) == []


def ask(drive: SimulatedOdrive, message: Message) -> tuple[float, ...]:
    (answer,) = drive.receive(Frame(arbitration_id(NODE, message), is_remote=True), 0.0)
    assert answer.arbitration_id == arbitration_id(NODE, message)
    return message.decode(answer.data)


def make_armed_drive(
    velocity_limit_turn_s: float = 100.0, current_limit_a: float = 100.0, **changes: float
) -> SimulatedOdrive:
    drive = make_drive(**changes)
    report(drive, SET_CONTROLLER_MODE, 1, 1)
    report(drive, SET_LIMITS, velocity_limit_turn_s, current_limit_a)
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP)
    return drive


def cyclic_frames(drive: SimulatedOdrive, duration_s: float) -> list[Frame]:
    return [frame for step in range(round(duration_s * 1000)) for frame in drive.cyclic_frames(step / 1000.0)]


def test_a_drive_is_idle_and_without_torque_after_power_on() -> None:
    drive = make_drive()
    report(drive, SET_CONTROLLER_MODE, 1, 1)
    report(drive, SET_INPUT_TORQUE, 0.2)
    assert drive.torque_nm(0.0) == 0.0
    assert ask(drive, HEARTBEAT)[:2] == (0, AxisState.IDLE)


def test_an_armed_drive_exerts_its_setpoint_until_it_is_idle() -> None:
    drive = make_armed_drive()
    report(drive, SET_INPUT_TORQUE, 0.25)
    assert drive.torque_nm(0.0) == 0.25
    assert ask(drive, HEARTBEAT)[:2] == (0, AxisState.CLOSED_LOOP)
    report(drive, SET_AXIS_STATE, AxisState.IDLE)
    assert drive.torque_nm(0.0) == 0.0
    assert ask(drive, HEARTBEAT)[:2] == (0, AxisState.IDLE)


@pytest.mark.parametrize("modes", [(3, 1), (1, 6), (2, 2)])
def test_modes_other_than_torque_passthrough_exert_nothing_here(modes: tuple[int, int]) -> None:
    drive = make_armed_drive()
    report(drive, SET_CONTROLLER_MODE, *modes)
    report(drive, SET_INPUT_TORQUE, 0.25)
    assert drive.torque_nm(0.0) == 0.0


def test_an_emergency_stop_is_latched_until_errors_are_cleared() -> None:
    drive = make_armed_drive()
    report(drive, SET_INPUT_TORQUE, 0.25)
    report(drive, ESTOP)
    assert drive.torque_nm(0.0) == 0.0
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP)
    assert ask(drive, HEARTBEAT)[:2] == (ERROR_ESTOP, AxisState.IDLE)
    assert ask(drive, GET_ERROR) == (ERROR_ESTOP, ERROR_ESTOP)
    report(drive, CLEAR_ERRORS, 0)
    assert ask(drive, GET_ERROR) == (0, ERROR_ESTOP)
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP)
    assert ask(drive, HEARTBEAT)[:2] == (0, AxisState.CLOSED_LOOP)
    assert ask(drive, GET_ERROR) == (0, 0)


def test_the_watchdog_cuts_the_torque_when_commands_stop() -> None:
    drive = make_armed_drive(watchdog_s=0.1)
    report(drive, SET_INPUT_TORQUE, 0.25, now_s=1.0)
    assert drive.torque_nm(1.0999) == 0.25
    assert drive.torque_nm(1.1001) == 0.0
    assert ask(drive, GET_ERROR) == (ERROR_WATCHDOG, ERROR_WATCHDOG)
    report(drive, SET_INPUT_TORQUE, 0.25, now_s=1.2)
    assert drive.torque_nm(1.2) == 0.0


def test_the_watchdog_is_fed_by_torque_commands() -> None:
    drive = make_armed_drive(watchdog_s=0.1)
    for step in range(20):
        report(drive, SET_INPUT_TORQUE, 0.25, now_s=step * 0.09)
        assert drive.torque_nm(step * 0.09) == 0.25


def test_the_watchdog_sleeps_outside_of_closed_loop_and_where_it_is_off() -> None:
    idle, unwatched = make_drive(watchdog_s=0.1), make_armed_drive(watchdog_s=0.0)
    for drive in (idle, unwatched):
        drive.torque_nm(1000.0)
        assert ask(drive, GET_ERROR) == (0, 0)
    assert ask(unwatched, HEARTBEAT)[1] == AxisState.CLOSED_LOOP


@pytest.mark.parametrize(("turns_s", "largest_nm", "least_nm"), [(0.0, 2 / 6, -2 / 6), (1.0, 1 / 6, -3 / 6)])
def test_the_velocity_limit_clamps_torque_silently(turns_s: float, largest_nm: float, least_nm: float) -> None:
    drive = make_armed_drive(velocity_limit_turn_s=2.0)  # pitfall: 0.333 N·m at rest with ODrive's defaults
    drive.measure(0.0, turns_s * 2.0 * pi)
    for wanted_nm, given_nm in ((1.0, largest_nm), (-1.0, least_nm), (0.1, 0.1)):
        report(drive, SET_INPUT_TORQUE, wanted_nm)
        assert drive.torque_nm(0.0) == pytest.approx(given_nm)
    assert ask(drive, GET_ERROR) == (0, 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_current_limit_bounds_torque_in_both_directions(sign: int) -> None:
    drive = make_armed_drive(current_limit_a=5.0, current_noise_a=0.0)
    report(drive, SET_INPUT_TORQUE, sign * 3.0)
    assert drive.torque_nm(0.0) == pytest.approx(sign * 5.0 * 0.083)
    assert ask(drive, GET_IQ) == pytest.approx((sign * 5.0, sign * 5.0))


@pytest.mark.parametrize(("bus_a", "motor_a", "given_a"), [(5.0, 3.0, 3.0), (2.0, 3.0, 2.0)])
def test_the_smaller_one_of_the_motor_s_clip_and_the_bus_s_limit_holds(
    bus_a: float, motor_a: float, given_a: float
) -> None:
    drive = make_armed_drive(current_limit_a=bus_a, motor_current_limit_a=motor_a, current_noise_a=0.0)
    for sign in (1.0, -1.0):
        report(drive, SET_INPUT_TORQUE, sign * 3.0)
        assert drive.torque_nm(0.0) == pytest.approx(sign * given_a * 0.083)
        assert ask(drive, GET_IQ)[1] == pytest.approx(sign * given_a)


def test_a_mirrored_motor_turns_angle_velocity_and_torque() -> None:
    drive = make_armed_drive(sign=-1, zero_turn=0.25)
    report(drive, SET_INPUT_TORQUE, 0.2)
    assert drive.torque_nm(0.0) == pytest.approx(-0.2)
    drive.measure(pi / 2.0, pi)
    assert ask(drive, GET_ENCODER_ESTIMATES) == (0.0, -0.5)


@given(st.floats(-10.0, 10.0), st.sampled_from([100, 4096, 16384]))
def test_the_encoder_reports_whole_counts(angle_rad: float, counts: int) -> None:
    drive = make_drive(encoder_counts=counts)
    drive.measure(angle_rad, 0.0)
    turns, _ = ask(drive, GET_ENCODER_ESTIMATES)
    assert turns * counts == pytest.approx(round(turns * counts), abs=1e-2)  # to the resolution of 32 bits
    assert abs(turns - angle_rad / (2.0 * pi)) <= 0.5 / counts + 1e-6


def test_cyclic_messages_keep_their_periods() -> None:
    counted = Counter(frame.arbitration_id for frame in cyclic_frames(make_drive(), 1.0))
    expected = {
        GET_ENCODER_ESTIMATES: 500, GET_IQ: 500, HEARTBEAT: 10, GET_ERROR: 10, GET_TEMPERATURE: 10,
        GET_BUS_VOLTAGE_CURRENT: 10,
    }  # fmt: skip
    assert counted.keys() == {arbitration_id(NODE, message) for message in expected}
    for message, number in expected.items():
        assert abs(counted[arbitration_id(NODE, message)] - number) <= 1


def test_delayed_messages_are_not_sent_later() -> None:
    drive = make_drive()
    assert len(list(drive.cyclic_frames(10.0))) == 6
    assert list(drive.cyclic_frames(10.0)) == []


@pytest.mark.parametrize("message", ANSWERED)
def test_remote_requests_are_answered(message: Message) -> None:
    assert len(ask(make_drive(), message)) == len(message.decode(bytes(8)))


def test_the_drive_reports_firmware_0_6() -> None:
    assert ask(make_drive(), GET_VERSION)[4:7] == (0, 6, 11)


def test_other_nodes_extended_ids_and_unknown_requests_are_not_answered() -> None:
    drive = make_drive()
    known = arbitration_id(NODE, GET_IQ)
    assert drive.receive(Frame(known + 0x20, is_remote=True), 0.0) == []
    assert drive.receive(Frame(known, is_remote=True, is_extended=True), 0.0) == []
    assert drive.receive(Frame(arbitration_id(NODE, ESTOP), is_remote=True), 0.0) == []
    drive.receive(Frame(arbitration_id(NODE + 1, ESTOP)), 0.0)
    assert ask(drive, GET_ERROR) == (0, 0)


def test_the_current_is_noisy_as_stated_around_the_true_one() -> None:
    drive = make_armed_drive(current_noise_a=0.2)
    report(drive, SET_INPUT_TORQUE, 3.0 * 0.083)
    drive.torque_nm(0.0)
    currents_a = np.array([ask(drive, GET_IQ) for _ in range(4000)])
    assert currents_a[:, 0] == pytest.approx(3.0)
    assert np.std(currents_a[:, 1]) == pytest.approx(0.2, rel=0.05)
    assert np.mean(currents_a[:, 1]) == pytest.approx(3.0, abs=0.02)


def test_the_same_seed_gives_the_same_frames_and_another_one_others() -> None:
    first, second, third = (SimulatedOdrive(SimulatedDriveParameters(NODE), Random(seed)) for seed in (7, 7, 8))
    frames = cyclic_frames(first, 0.5)
    assert frames == cyclic_frames(second, 0.5)
    assert frames != cyclic_frames(third, 0.5)


@given(st.lists(st.builds(Frame, st.integers(NODE << 5, (NODE << 5) + 31), st.binary(max_size=8), st.booleans())))
def test_random_frames_never_raise_and_leave_a_finite_torque(frames: list[Frame]) -> None:
    drive = make_drive()
    for frame in frames:
        drive.receive(frame, 0.0)
    assert isfinite(drive.torque_nm(0.0))
    assert len(list(drive.cyclic_frames(1.0))) == 6


@pytest.mark.parametrize(
    ("message", "size"), [(SET_INPUT_TORQUE, 8), (SET_INPUT_TORQUE, 3), (SET_AXIS_STATE, 8), (SET_LIMITS, 4)]
)
def test_commands_of_another_length_change_nothing(message: Message, size: int) -> None:
    drive = make_armed_drive()
    report(drive, SET_INPUT_TORQUE, 0.25)
    drive.receive(Frame(arbitration_id(NODE, message), bytes(size)), 0.0)
    assert drive.torque_nm(0.0) == 0.25


def test_a_torque_that_is_no_number_is_ignored() -> None:
    drive = make_armed_drive()
    report(drive, SET_INPUT_TORQUE, float("nan"))
    assert isfinite(drive.torque_nm(0.0))


def test_a_motor_with_another_constant_exerts_another_torque_and_reports_the_believed_current() -> None:
    drive = make_armed_drive(torque_constant_error=-0.1, current_noise_a=0.0)
    report(drive, SET_INPUT_TORQUE, 0.3)
    assert drive.torque_nm(0.0) == pytest.approx(0.27)
    assert ask(drive, GET_IQ)[1] == pytest.approx(0.3 / 0.083)


@pytest.mark.parametrize("sign", [1, -1])
def test_cogging_has_the_stated_amplitude_and_number_per_turn_and_gives_no_energy(sign: int) -> None:
    drive = make_drive(cogging_nm=0.02, cogging_per_turn=14, sign=sign)  # idle: cogging needs no power
    angles_rad = np.arange(1400) * 2.0 * pi / 1400
    torques_nm = []
    for angle_rad in angles_rad:
        drive.measure(angle_rad, 0.0)
        torques_nm.append(drive.torque_nm(0.0))
    spectrum = np.abs(np.fft.rfft(torques_nm)) * 2.0 / 1400
    assert spectrum[14] == pytest.approx(0.02)
    assert spectrum[28] == pytest.approx(0.005)
    assert sum(spectrum) == pytest.approx(0.025)  # no other terms and no mean, so a turn does no work
    assert torques_nm[1] < 0.0 < torques_nm[-1]  # a detent holds the joint where it is


def test_cogging_adds_to_the_setpoint_and_is_not_reported() -> None:
    drive = make_armed_drive(cogging_nm=0.02, cogging_phase_deg=90.0, current_noise_a=0.0)
    report(drive, SET_INPUT_TORQUE, 0.3)
    assert drive.torque_nm(0.0) == pytest.approx(0.28)
    assert ask(drive, GET_IQ)[1] == pytest.approx(0.3 / 0.083)


@pytest.mark.parametrize("step_s", [0.001, 0.0001])
def test_current_follows_its_command_with_the_stated_time_constant_at_any_step(step_s: float) -> None:
    drive = make_armed_drive(current_lag_s=0.01, watchdog_s=0.0)
    report(drive, SET_INPUT_TORQUE, 0.3)
    for step in range(round(0.02 / step_s)):
        torque_nm = drive.torque_nm((step + 1) * step_s)
    assert torque_nm == pytest.approx(0.3 * (1.0 - exp(-2.0)))


def test_a_lagging_current_is_the_one_that_is_reported_and_falls_at_once_when_the_power_is_cut() -> None:
    drive = make_armed_drive(current_lag_s=0.01, current_noise_a=0.0)
    report(drive, SET_INPUT_TORQUE, 0.3)
    torque_nm = drive.torque_nm(0.005)
    assert 0.0 < torque_nm < 0.2
    assert ask(drive, GET_IQ)[1] == pytest.approx(torque_nm / 0.083)
    report(drive, ESTOP)
    assert drive.torque_nm(0.006) == 0.0
    assert ask(drive, GET_IQ)[1] == 0.0


@pytest.mark.parametrize("sign", [1, -1])
def test_an_encoder_s_offset_is_read_as_an_angle_of_the_joint(sign: int) -> None:
    drive = make_drive(encoder_offset_rad=0.1, sign=sign, zero_turn=0.25)
    drive.measure(0.4, 0.0)
    turns, _ = ask(drive, GET_ENCODER_ESTIMATES)
    assert sign * (turns - 0.25) * 2.0 * pi == pytest.approx(0.5, abs=2.0 * pi / 16384)  # one step of the encoder


def test_encoder_noise_is_as_stated_and_comes_in_whole_counts() -> None:
    drive = make_drive(encoder_noise_rad=0.01)
    turns = np.array([ask(drive, GET_ENCODER_ESTIMATES)[0] for _ in range(4000)])
    assert np.std(turns) * 2.0 * pi == pytest.approx(0.01, rel=0.05)  # standard error of 4000 draws: 1 %
    assert turns * 16384 == pytest.approx(np.round(turns * 16384), abs=1e-2)


def test_the_cogging_is_where_the_joint_is_not_where_the_encoder_reads_it() -> None:
    reported_nm = []
    for offset_rad in (0.0, 0.01):
        drive = make_drive(cogging_nm=0.02, encoder_offset_rad=offset_rad)
        drive.measure(0.01, 0.0)
        reported_nm.append(drive.torque_nm(0.0))
    assert reported_nm[0] == reported_nm[1] != 0.0


def test_late_messages_keep_their_order_and_number_and_report_an_earlier_state() -> None:
    drive, late_ms = make_drive(message_delay_s=0.01), []
    for step in range(2000):
        drive.measure(2.0 * pi * step / 4096.0, 0.0)
        for frame in drive.cyclic_frames(step / 1000.0):
            if frame.arbitration_id == arbitration_id(NODE, GET_ENCODER_ESTIMATES):
                turns, _ = GET_ENCODER_ESTIMATES.decode(frame.data)
                assert frame.stamp_s == step / 1000.0
                late_ms.append(step - turns * 4096.0)
    assert len(late_ms) == pytest.approx(1000, abs=6)  # one each 2 ms; the last 10 ms of them are still in transit
    assert 0.0 <= min(late_ms) < 3.0
    assert 9.0 < max(late_ms) <= 11.0  # the bound, plus the test's step of 1 ms


def test_the_stated_fraction_of_messages_repeats_the_previous_one_to_the_last_bit() -> None:
    drive, payloads = make_drive(repeated_fraction=0.6), []
    for step in range(10000):
        drive.measure(step / 1000.0, 0.0)
        payloads += [
            frame.data
            for frame in drive.cyclic_frames(step / 1000.0)
            if frame.arbitration_id == arbitration_id(NODE, GET_IQ)
        ]
    repeated = np.mean([one == other for one, other in pairwise(payloads)])
    assert repeated == pytest.approx(0.6, abs=0.03)  # standard error of 5000 messages: 0.007


def test_a_heartbeat_is_never_an_old_one() -> None:
    drive = make_drive(repeated_fraction=0.99)
    cyclic_frames(drive, 0.5)
    report(drive, ESTOP)
    beats = [frame for frame in drive.cyclic_frames(10.0) if frame.arbitration_id == arbitration_id(NODE, HEARTBEAT)]
    assert [HEARTBEAT.decode(tick.data)[0] for tick in beats] == [ERROR_ESTOP]


def test_disabled_imperfections_draw_nothing() -> None:
    plain, dressed = make_drive(), make_drive(torque_constant_error=0.1, cogging_nm=0.1, current_lag_s=0.01)
    assert cyclic_frames(plain, 0.5) == cyclic_frames(dressed, 0.5)


def reported_setting(drive: SimulatedOdrive, endpoint: int) -> bytes:
    question = Frame(arbitration_id(NODE, RX_SDO), RX_SDO.encode(0, endpoint, 0))
    (answer,) = drive.receive(question, 0.0)
    assert answer.arbitration_id == arbitration_id(NODE, TX_SDO)
    assert answer.data[:4] == bytes([0, endpoint, 0, 0])
    return answer.data[4:]


@pytest.mark.parametrize(("watchdog_s", "enabled", "timeout"), [(0.1, "01", "cdcccc3d"), (0.0, "00", "00000000")])
def test_the_watchdog_s_settings_are_answered_byte_for_byte(watchdog_s: float, enabled: str, timeout: str) -> None:
    drive = make_drive(watchdog_s=watchdog_s)
    assert reported_setting(drive, 2) == bytes.fromhex(enabled)
    assert reported_setting(drive, 1) == bytes.fromhex(timeout)


@pytest.mark.parametrize("data", ["01 02 00 00", "00 03 00 00", "00 02 00", "00 02 00 00 00", ""])
def test_no_other_parameter_is_answered_and_none_is_written(data: str) -> None:
    assert make_drive().receive(Frame(arbitration_id(NODE, RX_SDO), bytes.fromhex(data)), 0.0) == []


def test_a_restarting_drive_is_silent_and_deaf_then_reports_its_initialisation_once() -> None:
    drive = make_armed_drive()
    drive.measure(1.0, 0.0)
    report(drive, SET_INPUT_TORQUE, 0.25, now_s=5.0)
    drive.restart(5.0)
    assert drive.torque_nm(5.001) == 0.0
    assert not any(list(drive.cyclic_frames(5.0 + step / 1000.0)) for step in range(round(1000 * BOOT_S)))
    assert drive.receive(Frame(arbitration_id(NODE, GET_VERSION), is_remote=True), 5.5) == []
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP, now_s=5.9)
    frames = [frame for step in range(400) for frame in drive.cyclic_frames(5.0 + BOOT_S + step / 1000.0)]
    heartbeats = [HEARTBEAT.decode(frame.data)[:2] for frame in frames if frame.arbitration_id & 0x1F == 0x01]
    assert heartbeats == [(ERROR_INITIALIZING, AxisState.IDLE)] + [(0, AxisState.IDLE)] * (len(heartbeats) - 1)
    assert len(heartbeats) >= 3
    assert ask_at(drive, GET_ERROR, 7.0) == (0, 0)
    assert ask_at(drive, GET_ENCODER_ESTIMATES, 7.0)[0] == pytest.approx(1.0 / (2.0 * pi), abs=1e-4)


def test_a_drive_that_was_restarted_has_forgotten_its_mode() -> None:
    drive = make_armed_drive()
    drive.restart(0.0)
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP, now_s=2.0)
    report(drive, SET_INPUT_TORQUE, 0.25, now_s=2.0)
    assert drive.torque_nm(2.0) == 0.0
    report(drive, SET_CONTROLLER_MODE, 1, 1, now_s=2.0)
    assert drive.torque_nm(2.0) == 0.25


def ask_at(drive: SimulatedOdrive, message: Message, now_s: float) -> tuple[float, ...]:
    (answer,) = drive.receive(Frame(arbitration_id(NODE, message), is_remote=True), now_s)
    return message.decode(answer.data)


def test_a_commutation_error_weakens_and_inverts_the_torque_that_the_drive_reports_unchanged() -> None:
    for error_deg, fraction in ((0.0, 1.0), (60.0, 0.5), (-90.0, 0.0), (180.0, -1.0)):
        drive = make_armed_drive(commutation_error_deg=error_deg, current_noise_a=0.0)
        report(drive, SET_INPUT_TORQUE, 0.5)
        assert drive.torque_nm(0.001) == pytest.approx(fraction * 0.5, abs=1e-9)
        assert ask(drive, GET_IQ)[1] == pytest.approx(0.5 / drive.parameters.torque_constant_nm_a, rel=1e-6)


def test_a_frozen_encoder_repeats_its_last_angle_at_exactly_zero_velocity() -> None:
    drive = make_armed_drive()
    drive.measure(0.5, 3.0)
    before_turns, _ = ask(drive, GET_ENCODER_ESTIMATES)
    drive.parameters = replace(drive.parameters, encoder_frozen=True)
    drive.measure(0.9, 5.0)
    assert ask(drive, GET_ENCODER_ESTIMATES) == (before_turns, 0.0)


def test_overspeed_trips_only_where_it_is_on_and_above_its_fraction_of_the_limit() -> None:
    for fraction, turns_s, trips in ((0.0, 9.0, False), (1.2, 4.7, False), (1.2, 4.9, True), (1.2, -4.9, True)):
        drive = make_armed_drive(overspeed_fraction=fraction)
        report(drive, SET_LIMITS, 4.0, 12.0)
        drive.measure(0.0, 2.0 * pi * turns_s)
        drive.torque_nm(0.001)
        assert drive.failed is trips
        assert drive.energised is not trips
