"""The simulated drive with firmware 0.5, held against its firmware's source: what differs from 0.6."""

from math import pi
from typing import Any

import pytest

from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, arbitration_id
from drivers.odrive05 import codec as codec05
from simulation.devices.drive import DriveError, Forgery
from simulation.devices.odrive05.device import SimulatedOdrive05, join_boards
from tests.drivers.bench.simulated_bus import simulated
from tests.simulation.devices.test_odrive import NODE, arm, ask, report

ANSWERED = [
    codec05.HEARTBEAT, codec05.GET_MOTOR_ERROR, codec05.GET_ENCODER_ERROR, codec05.GET_CONTROLLER_ERROR,
    codec05.GET_ENCODER_COUNT, codec.GET_ENCODER_ESTIMATES, codec.GET_IQ, codec.GET_BUS_VOLTAGE_CURRENT,
]  # fmt: skip


def make_drive(armed: bool = False, **changes: Any) -> SimulatedOdrive05:
    drive = simulated("odrive05", NODE, **({"current_noise_a": 0.0} | changes))
    assert isinstance(drive, SimulatedOdrive05)
    drive.reset(0.0)
    if armed:
        arm(drive)
    return drive


def test_requests_are_answered_as_remote_frames_and_as_empty_data_frames_and_no_others() -> None:
    drive = make_drive()
    answered = {message.command for message in ANSWERED}
    for command in set(range(32)) - codec05.COMMANDS:
        for request in (Frame(NODE << 5 | command, is_remote=True), Frame(NODE << 5 | command)):
            answers = [(answer.arbitration_id, len(answer.data)) for answer in drive.receive(request, 0.0)]
            assert answers == ([(NODE << 5 | command, 8)] if command in answered else [])
    assert drive.receive(Frame(NODE << 5 | codec.RX_SDO.command, bytes(4)), 0.0) == []


def test_it_sends_no_temperature_and_no_error_word_of_0_6() -> None:
    drive = make_drive()
    sent = {frame.arbitration_id & 31 for step in range(500) for frame in drive.cyclic_frames(step / 1000.0)}
    assert sent == {message.command for message in ANSWERED} - {codec05.GET_ENCODER_COUNT.command}


def test_the_position_is_zero_until_the_first_closed_loop_and_the_counts_are_true() -> None:
    drive = make_drive(encoder_counts=8192, zero_turn=0.25)
    drive.measure(-1.0, 2.0)
    for now_s in (0.0, 0.01):
        assert ask(drive, codec.GET_ENCODER_ESTIMATES, now_s) == (0.0, 0.0)
    counts, in_turn = ask(drive, codec05.GET_ENCODER_COUNT)
    report(drive, codec.SET_AXIS_STATE, AxisState.CLOSED_LOOP)
    drive.torque_nm(0.0)
    report(drive, codec.SET_AXIS_STATE, AxisState.IDLE)
    turns, turns_s = ask(drive, codec.GET_ENCODER_ESTIMATES)
    assert turns * 8192 == counts == round((0.25 - 0.5 / pi) * 8192)
    assert in_turn == counts % 8192
    assert turns_s == pytest.approx(1.0 / pi)
    drive.restart(1.0)
    assert ask(drive, codec.GET_ENCODER_ESTIMATES, 1.0 + drive.boot_s) == (0.0, 0.0)


@pytest.mark.parametrize("armed", [False, True])
def test_the_watchdog_runs_in_every_state_any_frame_feeds_it_and_it_prevents_closed_loop(armed: bool) -> None:
    drive = make_drive(armed)
    for step in range(1, 10):
        drive.receive(Frame(NODE << 5 | step, is_remote=True), 0.09 * step)
        drive.torque_nm(0.09 * step)
    assert not drive.failed and drive.energised is armed
    drive.torque_nm(0.92)
    report(drive, codec.SET_AXIS_STATE, AxisState.CLOSED_LOOP, now_s=0.92)
    assert ask(drive, codec05.HEARTBEAT, 0.92) == (codec05.ERROR_WATCHDOG, AxisState.IDLE, 0, 0, 0)
    report(drive, codec05.CLEAR_ERRORS, now_s=0.92)
    report(drive, codec.SET_AXIS_STATE, AxisState.CLOSED_LOOP, now_s=0.92)
    assert drive.energised and not drive.failed


@pytest.mark.parametrize("direction", [-1, 1])
def test_an_idle_drive_repeats_its_last_current_and_the_set_point_of_its_newest_command(direction: int) -> None:
    drive, measured_a = make_drive(armed=True, encoder_direction=direction), 2.0 * direction
    for message, value, setpoint_a in (
        (codec.SET_INPUT_TORQUE, 0.166, measured_a),
        (codec.SET_AXIS_STATE, AxisState.IDLE, measured_a),
        (codec.SET_INPUT_TORQUE, 0.0, 0.0),
    ):
        report(drive, message, value)
        drive.torque_nm(0.0)
        assert ask(drive, codec.GET_IQ) == pytest.approx((setpoint_a, measured_a))


@pytest.mark.parametrize(
    ("error", "flags", "parts"),
    [
        (DriveError.OVERCURRENT, codec05.ERROR_MOTOR, (1, 0, 0)),
        (DriveError.OVERSPEED, codec05.ERROR_CONTROLLER, (0, 0, 1)),
        (DriveError.UNDERVOLTAGE, codec05.ERROR_MOTOR, (1, 0, 0)),
        (DriveError.BRAKE_RESISTOR, codec05.ERROR_MOTOR, (1, 0, 0)),
        (DriveError.WATCHDOG, codec05.ERROR_WATCHDOG, (0, 0, 0)),
        (None, codec05.ERROR_ESTOP, (0, 0, 0)),
    ],
)
def test_an_error_ends_torque_and_its_part_has_an_error_word(
    error: DriveError | None, flags: int, parts: tuple[int, int, int]
) -> None:
    drive = make_drive(armed=True)
    if error is None:
        drive.receive(drive.forge(Forgery.EMERGENCY_STOP), 0.0)
    else:
        drive.trip(error)
    assert ask(drive, codec05.HEARTBEAT) == (flags, AxisState.IDLE, *parts)
    words = (codec05.GET_MOTOR_ERROR, codec05.GET_ENCODER_ERROR, codec05.GET_CONTROLLER_ERROR)
    assert tuple(bool(ask(drive, word)[0]) for word in words) == tuple(map(bool, parts))


def test_a_drive_that_restarts_is_not_fed_meanwhile() -> None:
    drive = make_drive()
    drive.restart(0.0)
    drive.receive(Frame(NODE << 5 | 0xA, is_remote=True), 0.5)
    for wait_s, failed in ((0.09, False), (0.11, True)):
        drive.torque_nm(drive.boot_s + wait_s)
        assert drive.failed is failed


@pytest.mark.parametrize("command", [codec05.CLEAR_ERRORS.command, codec.REBOOT.command])
def test_the_two_axes_of_a_board_are_cleared_and_restarted_together(command: int) -> None:
    first, second, other = (make_drive(armed=True) for _ in range(3))
    join_boards((first, second, other))
    for drive in (first, second, other):
        drive.trip(DriveError.OVERCURRENT)
    first.receive(Frame(NODE << 5 | command, bytes(8)), 0.0)
    assert [drive.failed for drive in (first, second, other)] == [False, False, True]
    request = Frame(arbitration_id(NODE, codec.GET_IQ), is_remote=True)
    silent = [not drive.receive(request, 0.1) for drive in (first, second, other)]
    assert silent == [command == codec.REBOOT.command] * 2 + [False]
