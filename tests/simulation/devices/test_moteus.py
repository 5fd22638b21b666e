"""The simulated moteus follows its makers' documentation: modes, watchdog, limits, answers, console."""

from dataclasses import replace
from math import isnan, nan, pi
from random import Random
from typing import Any

import pytest

from drivers.can.frames import Frame
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode, Reply
from drivers.moteus.registers import Register, Resolution
from drivers.moteus.settings import IDENTITY, POLL, encode_question
from simulation.devices.drive import DriveError, SimulatedDriveParameters
from simulation.devices.moteus.device import BOOT_S, SimulatedMoteus
from simulation.devices.moteus.forgeries import command_frame

IDEAL = SimulatedDriveParameters(7, type="moteus", torque_constant_nm_a=0.0719, current_noise_a=0.0)
TURN_RAD = 2.0 * pi


class Bench:
    def __init__(self, **changes: Any) -> None:
        self.drive = SimulatedMoteus(replace(IDEAL, **changes), Random(1))
        self.now_s = 0.0

    def send(self, data: bytes) -> list[Frame]:
        return self.drive.receive(command_frame(7, data), self.now_s)

    def ask(self) -> Reply:
        (frame,) = self.send(codec.QUERY_ALONE)
        return codec.decode_reply(frame.data)

    def torque_after(self, wait_s: float) -> float:
        self.now_s += wait_s
        return self.drive.torque_nm(self.now_s)

    def write(self, **values: float) -> None:
        """Command position mode with these registers as floats and all others at their defaults."""
        data = bytes.fromhex("01000a")
        for name, value in values.items():
            data += registers.encode_values(registers.WRITE, Resolution.FLOAT, Register[name.upper()], [value])
        self.send(registers.padded(data))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_it_sends_nothing_unless_it_is_asked(bench: Bench) -> None:
    for _ in range(100):
        bench.torque_after(0.001)
        assert list(bench.drive.cyclic_frames(bench.now_s)) == []
    unwanted = command_frame(7, codec.QUERY_ALONE)._replace(arbitration_id=7, is_extended=False)
    assert bench.drive.receive(unwanted, 0.1) == [] == list(bench.drive.cyclic_frames(0.1))
    assert len(bench.send(codec.QUERY_ALONE)) == 1


def test_it_answers_with_the_values_of_before_the_command(bench: Bench) -> None:
    (frame,) = bench.send(codec.encode_torque(0.5))
    assert (frame.arbitration_id, frame.is_fd, frame.is_extended) == (0x700, True, False)
    reply = codec.decode_reply(frame.data)
    assert (reply.mode, reply.control_torque_nm) == (Mode.STOPPED, 0.0)
    assert bench.torque_after(0.001) == pytest.approx(0.5)
    reply = bench.ask()
    assert reply.mode == Mode.POSITION and reply.control_torque_nm == pytest.approx(0.5)
    assert reply.q_current_a == pytest.approx(0.5 / 0.0719)


def test_the_usual_frames_and_the_general_reader_agree(bench: Bench) -> None:
    other = Bench()
    for torque_nm in (0.3, -0.2):
        bench.drive.measure(0.3, -1.0)
        other.drive.measure(0.3, -1.0)
        data = codec.encode_torque(torque_nm)
        slow = registers.padded(data + bytes([registers.NOP]))  # one byte more
        assert bench.send(data)[0].data == other.send(slow)[0].data
        assert bench.torque_after(0.001) == other.torque_after(0.001)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_sign_turns_angle_velocity_and_torque_alike(sign: int) -> None:
    bench = Bench(sign=sign, zero_turn=0.25)
    bench.drive.measure(0.5, 2.0)
    reply = bench.ask()
    assert reply.position_turn == pytest.approx(0.25 + sign * 0.5 / TURN_RAD, abs=1e-4)
    assert reply.velocity_turn_s == pytest.approx(sign * 2.0 / TURN_RAD)
    bench.send(codec.encode_torque(0.4))
    assert bench.torque_after(0.001) == pytest.approx(sign * 0.4)


def test_the_current_is_limited_by_its_own_setting() -> None:
    bench = Bench(current_limit_a=5.0)
    bench.send(codec.encode_torque(1.0))
    assert bench.torque_after(0.001) == pytest.approx(5.0 * 0.0719)


def test_without_commands_it_latches_the_mode_timeout_until_a_stop(bench: Bench) -> None:
    bench.send(codec.encode_torque(0.5))
    assert bench.torque_after(0.099) == pytest.approx(0.5)
    assert bench.ask().mode == Mode.POSITION  # a question does not feed the watchdog
    assert bench.torque_after(0.002) == 0.0
    assert bench.ask().mode == Mode.TIMEOUT and bench.drive.failed
    bench.send(codec.encode_torque(0.5))
    assert bench.torque_after(0.001) == 0.0 and bench.ask().mode == Mode.TIMEOUT
    bench.send(codec.STOP_AND_QUERY)
    assert bench.ask().mode == Mode.STOPPED and not bench.drive.failed
    bench.send(codec.encode_torque(0.5))
    assert bench.torque_after(0.001) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("watchdog_s", "register_s", "trips"), [(0.1, 0.0, True), (0.1, 0.5, False), (0.1, nan, False)]
)
def test_a_command_may_state_its_own_watchdog(watchdog_s: float, register_s: float, trips: bool) -> None:
    bench = Bench(watchdog_s=watchdog_s)
    bench.write(command_torque=0.2, kp_scale=0.0, kd_scale=0.0, watchdog=register_s)
    bench.torque_after(0.2)
    assert (bench.ask().mode == Mode.TIMEOUT) is trips


def test_a_watchdog_that_is_off_never_trips() -> None:
    bench = Bench(watchdog_s=0.0)
    bench.send(codec.encode_torque(0.2))
    assert bench.torque_after(60.0) == pytest.approx(0.2)


@pytest.mark.parametrize(("kd_scale", "damps"), [(1.0, True), (0.5, True), (0.0, False)])
def test_the_timeout_damps_by_default_but_not_after_a_pure_torque(kd_scale: float, damps: bool) -> None:
    """The timeout uses the kd scale of the last command, like ISR_DoZeroVelocity of the firmware."""
    bench = Bench()
    bench.write(command_position=nan, command_torque=0.2, kp_scale=0.0, kd_scale=kd_scale)
    bench.drive.measure(0.0, 3.0)
    torque_nm = bench.torque_after(0.2)
    assert bench.ask().mode == Mode.TIMEOUT
    assert (torque_nm < 0.0) is damps and (torque_nm == 0.0) is not damps


@pytest.mark.parametrize(("timeout_mode", "damps"), [(0, False), (12, False), (15, True), (10, True)])
def test_after_our_torque_commands_the_timeout_mode_decides(timeout_mode: int, damps: bool) -> None:
    bench = Bench(timeout_mode=timeout_mode)
    bench.send(codec.encode_torque(0.2))
    bench.drive.measure(0.0, 3.0)
    assert (bench.torque_after(0.2) < 0.0) is damps


def test_a_position_command_with_its_defaults_holds_a_position(bench: Bench) -> None:
    bench.write(command_position=0.1)
    assert bench.torque_after(0.001) > 0.0
    bench.drive.measure(0.2 * TURN_RAD, 0.0)
    assert bench.torque_after(0.001) < 0.0
    bench.write(command_position=nan, max_torque=0.01)
    bench.drive.measure(0.5 * TURN_RAD, 0.0)
    assert bench.torque_after(0.001) == pytest.approx(-0.01)


def test_a_fault_ends_torque_and_is_cleared_by_a_stop(bench: Bench) -> None:
    bench.send(codec.encode_torque(0.2))
    bench.drive.trip(DriveError.OVERCURRENT)
    assert bench.torque_after(0.001) == 0.0
    assert (bench.ask().mode, bench.ask().fault) == (Mode.FAULT, 33)
    bench.send(codec.encode_torque(0.2))
    assert bench.ask().mode == Mode.FAULT
    bench.send(codec.STOP_AND_QUERY)
    assert (bench.ask().mode, bench.ask().fault) == (Mode.STOPPED, 0)


def test_a_restart_is_silent_and_ends_stopped(bench: Bench) -> None:
    bench.send(codec.encode_torque(0.2))
    bench.drive.restart(bench.now_s)
    bench.now_s += 0.99 * BOOT_S
    assert bench.send(codec.QUERY_ALONE) == []
    bench.now_s += 0.02 * BOOT_S
    assert bench.ask().mode == Mode.STOPPED


def test_the_console_reports_and_changes_settings(bench: Bench) -> None:
    def answer(data: bytes) -> bytes:
        (frame,) = bench.send(data)
        return b"".join(each.text for each in registers.decode_frame(frame.data))

    assert answer(encode_question("servo.default_timeout_s")) == b""  # the answer comes with the next poll
    assert answer(POLL) == b"0.100000\r\n"
    assert answer(encode_question("servo.timeout_mode")) + answer(POLL) == b"12\r\n"
    assert answer(encode_question("no.such_key")) + answer(POLL) == b"ERR error reading\r\n"
    change = registers.encode_console(registers.CONSOLE_INPUT, b"conf set servo.default_timeout_s nan\n")
    bench.send(registers.padded(change))
    assert answer(POLL) == b"OK\r\n"
    bench.send(codec.encode_torque(0.2))
    assert bench.torque_after(5.0) == pytest.approx(0.2)


def test_it_reports_its_identity() -> None:
    bench = Bench(serial_number="0123456789abcdef00112233")
    (frame,) = bench.send(IDENTITY)
    values = registers.replied_values(registers.decode_frame(frame.data))
    assert values[Register.REGISTER_MAP] == 5 and values[Register.FIRMWARE] == 0x010100
    words = [int(values[Register.SERIAL_NUMBER + index]) & 0xFFFFFFFF for index in range(3)]
    assert words == [0x01234567, 0x89ABCDEF, 0x00112233]


def test_malformed_frames_and_other_ids_are_ignored(bench: Bench) -> None:
    random = Random(2)
    for _ in range(500):
        bench.drive.receive(command_frame(7, random.randbytes(random.randint(0, 64))), 0.0)
    assert bench.drive.receive(command_frame(8, codec.QUERY_ALONE), 0.0) == []
    assert bench.drive.receive(command_frame(7, codec.QUERY_ALONE)._replace(is_fd=False), 0.0) == []


def test_late_answers_come_in_order_and_repeat_old_values_where_they_shall() -> None:
    bench = Bench(message_delay_s=0.01)
    assert bench.send(codec.QUERY_ALONE) == []
    assert list(bench.drive.cyclic_frames(0.0)) == []
    assert len(list(bench.drive.cyclic_frames(0.01))) == 1
    repeating = Bench(repeated_fraction=0.5)
    turns = []
    for number in range(400):
        repeating.drive.measure(0.01 * number, 0.0)
        turns.append(repeating.ask().position_turn)
    assert 0.35 < sum(a == b for a, b in zip(turns, turns[1:], strict=False)) / 400 < 0.65
    assert not any(map(isnan, turns))
