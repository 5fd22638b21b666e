"""A second program on the bus: the drives go idle, and a serial number distinguishes its drives from others."""

from dataclasses import replace

import pytest

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from drivers.can.frames import Frame
from drivers.odrive.codec import (
    ADDRESS,
    CLEAR_ERRORS,
    ESTOP,
    GET_VERSION,
    RX_SDO,
    SDO_READ,
    SET_AXIS_STATE,
    SET_INPUT_TORQUE,
    AxisState,
    Message,
    arbitration_id,
)
from firmware_host.configuration.configuration import Configuration
from tests.copied_robots import copy_of
from tests.firmware_host.recorded_robot import RecordedRobot

SERIAL = "385f324d3037"


def with_serial_number(configuration: Configuration, serial_number: str) -> Configuration:
    drives = dict(configuration.drive)
    drives["left_sweep"] = replace(drives["left_sweep"], serial_number=serial_number)
    return replace(configuration, drive=drives)


@pytest.fixture(scope="module")
def walking(armed_robot: RecordedRobot) -> RecordedRobot:
    robot = copy_of(armed_robot)
    robot.walk(WalkOrder(0.03, adaptive=False))
    robot.run_for(1.0)
    return robot


@pytest.mark.parametrize("kind", ["slow", "intermittent"])
def test_commands_that_come_late_or_by_halves_idle_the_drives(walking: RecordedRobot, kind: str) -> None:
    robot = copy_of(walking)
    robot.fail("left_adduction.command", kind, 2.0)
    assert robot.run_until(lambda: robot.loop.mode not in ENERGISED, 1.0)
    assert "setpoint_mismatch" in robot.fault_names


COMMANDS: list[tuple[Message, bytes, bool]] = [
    (SET_INPUT_TORQUE, bytes(4), True),
    (SET_AXIS_STATE, SET_AXIS_STATE.encode(AxisState.CLOSED_LOOP), True),
    (CLEAR_ERRORS, b"\0", True),
    (Message(0x0C, "<fhh"), bytes(8), True),  # a position
    (Message(0x16, "<B"), b"\0", True),  # a reboot
    (RX_SDO, RX_SDO.encode(1, 100, 0) + bytes(4), True),
    (RX_SDO, RX_SDO.encode(SDO_READ, 100, 0), False),
    (ESTOP, b"", False),  # any program may stop a drive
]


@pytest.mark.parametrize(("message", "data", "counts"), COMMANDS)
def test_every_command_counts_but_a_stop_and_a_reading(
    robot: RecordedRobot, message: Message, data: bytes, counts: bool
) -> None:
    robot.send_foreign("left_sweep", Frame(arbitration_id(1, message), data))
    robot.step()
    assert ("foreign_commands" in robot.fault_names) == counts


def test_the_right_drive_arms(configuration: Configuration) -> None:
    robot = RecordedRobot(with_serial_number(configuration, SERIAL))
    robot.arm()
    assert robot.loop.mode is Mode.HOLD


@pytest.mark.parametrize("answers", [True, False])
def test_another_drive_or_one_that_does_not_answer_does_not_arm(configuration: Configuration, answers: bool) -> None:
    robot = RecordedRobot(with_serial_number(configuration, SERIAL))
    drive = robot.robot.drives[0]
    drive.parameters = replace(drive.parameters, serial_number="000000000001")
    if not answers:
        receive = drive.receive
        drive.receive = lambda frame, now_s: (  # type: ignore[method-assign]
            [] if frame.is_remote and frame.arbitration_id & 0x1F == ADDRESS.command else receive(frame, now_s)
        )
    robot.run_for(2.0)
    assert robot.fault_names == {"wrong_drive"}
    assert robot.loop.request(Request.ARM, robot.now_s, forced="watchdog_unknown")


def test_a_serial_number_is_asked_for_only_of_firmware_that_knows_it(configuration: Configuration) -> None:
    robot = RecordedRobot(with_serial_number(configuration, SERIAL))
    port, drive = robot.buses["left"].open(), robot.robot.drives[0]
    receive = drive.receive
    drive.receive = lambda frame, now_s: (  # type: ignore[method-assign]
        [] if frame.is_remote and frame.arbitration_id == GET_VERSION.command else receive(frame, now_s)
    )
    robot.run_for(2.0)
    assert [frame for frame in port.receive() if frame.arbitration_id == ADDRESS.command] == []
