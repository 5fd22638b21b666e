"""The simulated drive follows ODrive's documentation: states, watchdog, clamps, periods, answers, imperfections."""

from collections import Counter
from math import cos, nan, pi, radians
from random import Random
from typing import Any

import numpy as np
import pytest

from drivers.can.frames import Frame
from drivers.odrive.codec import (
    CLEAR_ERRORS,
    ERROR_ESTOP,
    ERROR_INITIALIZING,
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
from simulation.devices.odrive.device import SimulatedOdrive
from simulation.devices.odrive.settings import ENDPOINTS

NODE = 3
CONSTANT_NM_A = 0.083
TURN_RAD = 2.0 * pi
PERIODIC = {GET_ENCODER_ESTIMATES: 500, GET_IQ: 500, HEARTBEAT: 10, GET_ERROR: 10, GET_TEMPERATURE: 10,
            GET_BUS_VOLTAGE_CURRENT: 10}  # messages a second  # fmt: skip


def make_drive(seed: int = 1, **changes: Any) -> SimulatedOdrive:
    return SimulatedOdrive(SimulatedDriveParameters(NODE, **changes), Random(seed))


def report(drive: SimulatedOdrive, message: Message, *values: float, now_s: float = 0.0) -> None:
    assert drive.receive(Frame(arbitration_id(NODE, message), message.encode(*values)), now_s) == []


def ask(drive: SimulatedOdrive, message: Message, now_s: float = 0.0) -> tuple[float, ...]:
    (answer,) = drive.receive(Frame(arbitration_id(NODE, message), is_remote=True), now_s)
    assert answer.arbitration_id == arbitration_id(NODE, message)
    return message.decode(answer.data)


def arm(drive: SimulatedOdrive, velocity_limit_turn_s: float = 100.0, current_limit_a: float = 100.0) -> None:
    report(drive, SET_CONTROLLER_MODE, 1, 1)
    report(drive, SET_LIMITS, velocity_limit_turn_s, current_limit_a)
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP)


def make_armed_drive(
    velocity_limit_turn_s: float = 100.0, current_limit_a: float = 100.0, **changes: Any
) -> SimulatedOdrive:
    drive = make_drive(**({"current_noise_a": 0.0} | changes))
    arm(drive, velocity_limit_turn_s, current_limit_a)
    return drive


def torque_nm(drive: SimulatedOdrive, commanded_nm: float, now_s: float = 0.0) -> float:
    report(drive, SET_INPUT_TORQUE, commanded_nm, now_s=now_s)
    return drive.torque_nm(now_s)


def frames_of(drive: SimulatedOdrive, message: Message, steps: int) -> list[Frame]:
    """Return the cyclic messages of one kind, from a joint whose angle grows by a count of 4096 a millisecond."""
    frames = []
    for step in range(steps):
        drive.measure(TURN_RAD * step / 4096.0, 0.0)
        frames += [each for each in drive.cyclic_frames(step / 1000.0)]
    return [frame for frame in frames if frame.arbitration_id == arbitration_id(NODE, message)]


# states


def test_an_armed_drive_exerts_its_setpoint_in_torque_passthrough_until_it_is_idle() -> None:
    drive = make_armed_drive()
    for modes, exerted_nm in (((1, 1), 0.25), ((3, 1), 0.0), ((1, 6), 0.0), ((2, 2), 0.0), ((1, 1), 0.25)):
        report(drive, SET_CONTROLLER_MODE, *modes)
        assert torque_nm(drive, 0.25) == exerted_nm
    assert ask(drive, HEARTBEAT)[:2] == (0, AxisState.CLOSED_LOOP)
    report(drive, SET_AXIS_STATE, AxisState.IDLE)
    assert drive.torque_nm(0.0) == 0.0
    assert ask(drive, HEARTBEAT)[:2] == (0, AxisState.IDLE)


def test_a_restarting_drive_is_silent_and_deaf_then_reports_its_initialisation_once_without_its_mode() -> None:
    drive = make_armed_drive()
    drive.measure(1.0, 0.0)
    assert torque_nm(drive, 0.25, now_s=5.0) == 0.25
    drive.restart(5.0)
    assert drive.torque_nm(5.001) == 0.0
    assert not any(list(drive.cyclic_frames(5.0 + step / 1000.0)) for step in range(round(1000 * drive.boot_s)))
    assert drive.receive(Frame(arbitration_id(NODE, GET_VERSION), is_remote=True), 5.5) == []
    report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP, now_s=5.9)
    frames = [frame for step in range(400) for frame in drive.cyclic_frames(5.0 + drive.boot_s + step / 1000.0)]
    heartbeats = [HEARTBEAT.decode(frame.data)[:2] for frame in frames if frame.arbitration_id & 0x1F == 0x01]
    assert heartbeats == [(ERROR_INITIALIZING, AxisState.IDLE)] + [(0, AxisState.IDLE)] * (len(heartbeats) - 1)
    assert len(heartbeats) >= 3
    assert ask(drive, GET_ENCODER_ESTIMATES, 7.0)[0] == pytest.approx(1.0 / TURN_RAD, abs=1e-4)
    for modes, exerted_nm in ((), 0.0), ((1, 1), 0.25):
        if modes:
            report(drive, SET_CONTROLLER_MODE, *modes, now_s=7.0)
        report(drive, SET_AXIS_STATE, AxisState.CLOSED_LOOP, now_s=7.0)
        assert torque_nm(drive, 0.25, now_s=7.0) == exerted_nm


# limits


@pytest.mark.parametrize(("turns_s", "largest_nm", "least_nm"), [(0.0, 2 / 6, -2 / 6), (1.0, 1 / 6, -3 / 6)])
def test_the_velocity_limit_clamps_torque_silently(turns_s: float, largest_nm: float, least_nm: float) -> None:
    drive = make_armed_drive(velocity_limit_turn_s=2.0)  # pitfall: 0.333 N·m at rest with ODrive's defaults
    drive.measure(0.0, turns_s * TURN_RAD)
    for wanted_nm, given_nm in ((1.0, largest_nm), (-1.0, least_nm), (0.1, 0.1)):
        assert torque_nm(drive, wanted_nm) == pytest.approx(given_nm)
    assert ask(drive, GET_ERROR) == (0, 0)


@pytest.mark.parametrize(
    ("fraction", "turns_s", "trips"), [(0.0, 9.0, False), (1.2, 4.7, False), (1.2, 4.9, True), (1.2, -4.9, True)]
)
def test_overspeed_trips_only_where_it_is_on_and_above_its_fraction_of_the_limit(
    fraction: float, turns_s: float, trips: bool
) -> None:
    drive = make_armed_drive(4.0, 12.0, overspeed_fraction=fraction)
    drive.measure(0.0, TURN_RAD * turns_s)
    drive.torque_nm(0.001)
    assert drive.failed is trips is not drive.energised


# messages


def test_cyclic_messages_keep_their_periods_and_delayed_ones_are_not_sent_later() -> None:
    drive = make_drive()
    counted = Counter(frame.arbitration_id for step in range(1000) for frame in drive.cyclic_frames(step / 1000.0))
    assert counted == {
        arbitration_id(NODE, message): pytest.approx(count, abs=1) for message, count in PERIODIC.items()
    }
    assert len(list(drive.cyclic_frames(10.0))) == len(PERIODIC)
    assert list(drive.cyclic_frames(10.0)) == []


def test_remote_requests_are_answered_and_no_others() -> None:
    drive, identifier = make_drive(), arbitration_id(NODE, GET_IQ)
    for message in PERIODIC:
        assert len(ask(drive, message)) == len(message.decode(bytes(8)))
    assert ask(drive, GET_VERSION)[4:7] == (0, 6, 11)
    unanswered = (Frame(identifier + 0x20, is_remote=True), Frame(identifier, is_remote=True, is_extended=True))
    for frame in (*unanswered, Frame(arbitration_id(NODE, ESTOP), is_remote=True)):
        assert drive.receive(frame, 0.0) == []
    drive.receive(Frame(arbitration_id(NODE + 1, ESTOP)), 0.0)
    assert not drive.failed


@pytest.mark.parametrize(("message", "size"), [(SET_INPUT_TORQUE, 3), (SET_AXIS_STATE, 2), (SET_LIMITS, 4)])
def test_commands_that_are_too_short_and_of_no_number_change_nothing(message: Message, size: int) -> None:
    drive = make_armed_drive()
    assert torque_nm(drive, 0.25) == 0.25
    drive.receive(Frame(arbitration_id(NODE, message), bytes(size)), 0.0)
    assert drive.torque_nm(0.0) == torque_nm(drive, nan) == 0.25


def test_clearing_errors_also_clears_the_reason_of_the_disarming() -> None:
    drive = make_armed_drive()
    report(drive, ESTOP)
    assert ask(drive, GET_ERROR) == (ERROR_ESTOP, ERROR_ESTOP)
    report(drive, CLEAR_ERRORS, 0)
    assert ask(drive, GET_ERROR) == (0, 0)


@pytest.mark.parametrize(("volts", "flag"), [(10.4, 0x200), (10.6, 0), (59.9, 0), (60.1, 0x100)])
def test_a_supply_outside_of_its_levels_trips_the_drive(volts: float, flag: int) -> None:
    drive = make_armed_drive(bus_voltage_v=volts)
    assert (torque_nm(drive, 0.25) == 0.0) is bool(flag) and ask(drive, GET_ERROR) == (flag, flag)


def test_it_answers_under_a_node_id_that_another_program_writes() -> None:
    drive = make_drive()
    (answer,) = drive.receive(
        Frame(arbitration_id(NODE, RX_SDO), RX_SDO.encode(1, ENDPOINTS["axis0.config.can.node_id"], 0) + b"\5\0\0\0"),
        0.0,
    )
    assert answer.arbitration_id >> 5 == 5 and drive.receive(Frame(arbitration_id(5, GET_IQ), is_remote=True), 0.0)
    assert {frame.arbitration_id >> 5 for frame in drive.cyclic_frames(1.0)} == {5}


def reported_setting(drive: SimulatedOdrive, endpoint: int) -> bytes:
    (answer,) = drive.receive(Frame(arbitration_id(NODE, RX_SDO), RX_SDO.encode(0, endpoint, 0)), 0.0)
    assert answer.arbitration_id == arbitration_id(NODE, TX_SDO)
    assert answer.data[:4] == bytes([0, endpoint, 0, 0])
    return answer.data[4:]


@pytest.mark.parametrize(("watchdog_s", "enabled", "timeout"), [(0.1, "01", "cdcccc3d"), (0.0, "00", "00000000")])
def test_the_watchdog_s_settings_are_answered_byte_for_byte(watchdog_s: float, enabled: str, timeout: str) -> None:
    drive = make_drive(watchdog_s=watchdog_s)
    assert (reported_setting(drive, 2).hex(), reported_setting(drive, 1).hex()) == (enabled, timeout)


# imperfections


def test_noise_is_as_stated_around_the_truth_and_angles_are_whole_counts() -> None:
    drive = make_armed_drive(current_noise_a=0.2, encoder_noise_rad=0.01)
    torque_nm(drive, 3.0 * CONSTANT_NM_A)
    currents_a = np.array([ask(drive, GET_IQ) for _ in range(4000)])
    assert currents_a[:, 0] == pytest.approx(3.0)
    assert np.std(currents_a[:, 1]) == pytest.approx(0.2, rel=0.05)
    assert np.mean(currents_a[:, 1]) == pytest.approx(3.0, abs=0.02)
    turns = np.array([ask(drive, GET_ENCODER_ESTIMATES)[0] for _ in range(4000)])
    assert np.std(turns) * TURN_RAD == pytest.approx(0.01, rel=0.05)  # standard error of 4000 draws: 1 %
    assert turns * 16384 == pytest.approx(np.round(turns * 16384), abs=1e-2)


def test_a_seed_repeats_its_frames_and_disabled_imperfections_draw_nothing() -> None:
    dressed = make_drive(7, torque_constant_error=0.1, cogging_nm=0.1, current_lag_s=0.01)
    drives = (make_drive(7), make_drive(7), dressed, make_drive(8))
    first, same, plain, other = (frames_of(drive, GET_IQ, 500) for drive in drives)
    assert first == same == plain != other


@pytest.mark.parametrize("error_deg", [0.0, 60.0, -90.0, 180.0])
@pytest.mark.parametrize("error", [0.0, -0.1])
def test_a_motor_with_another_constant_or_commutation_reports_the_believed_current(
    error: float, error_deg: float
) -> None:
    drive = make_armed_drive(torque_constant_error=error, commutation_error_deg=error_deg)
    assert torque_nm(drive, 0.3) == pytest.approx(0.3 * (1.0 + error) * cos(radians(error_deg)), abs=1e-7)
    assert ask(drive, GET_IQ)[1] == pytest.approx(0.3 / CONSTANT_NM_A)


@pytest.mark.parametrize("sign", [1, -1])
def test_cogging_has_the_stated_amplitude_and_number_per_turn_and_gives_no_energy(sign: int) -> None:
    """It needs no power, adds to the set-point, is not reported, and is where the joint is, not where it is read."""
    cogging: dict[str, Any] = {"cogging_nm": 0.02, "cogging_per_turn": 14, "sign": sign, "encoder_offset_rad": 0.01}
    idle, armed, torques_nm = make_drive(**cogging), make_armed_drive(**cogging), []
    for angle_rad in np.arange(1400) * TURN_RAD / 1400:
        idle.measure(angle_rad, 0.0)
        torques_nm.append(idle.torque_nm(0.0))
    spectrum = np.abs(np.fft.rfft(torques_nm)) * 2.0 / 1400
    assert (spectrum[14], spectrum[28]) == pytest.approx((0.02, 0.005))
    assert sum(spectrum) == pytest.approx(0.025)  # no other terms and no mean, so a turn does no work
    assert torques_nm[1] < 0.0 < torques_nm[-1]  # a detent holds the joint where it is
    armed.measure(TURN_RAD / 1400, 0.0)
    assert torque_nm(armed, 0.3) == pytest.approx(sign * 0.3 + torques_nm[1])
    assert ask(armed, GET_IQ)[1] == pytest.approx(0.3 / CONSTANT_NM_A)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_encoder_s_offset_is_read_as_an_angle_of_the_joint(sign: int) -> None:
    drive = make_drive(encoder_offset_rad=0.1, sign=sign, zero_turn=0.25)
    drive.measure(0.4, 0.0)
    turns, _ = ask(drive, GET_ENCODER_ESTIMATES)
    assert sign * (turns - 0.25) * TURN_RAD == pytest.approx(0.5, abs=TURN_RAD / 16384)  # one step of the encoder
