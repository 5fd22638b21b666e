"""The simulated moteus follows its makers' documentation: modes, watchdog, answers, console."""

from math import nan, pi
from typing import Any

import pytest

from drivers.can.frames import Frame
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode, Reply
from drivers.moteus.registers import Register, Resolution
from drivers.moteus.settings import IDENTITY, POLL, encode_question
from simulation.devices.drive import DriveError
from simulation.devices.moteus.device import SimulatedMoteus
from simulation.devices.moteus.forgeries import command_frame
from tests.drivers.bench.simulated_bus import simulated


class Bench:
    def __init__(self, **changes: Any) -> None:
        drive = simulated("moteus", 7, **({"torque_constant_nm_a": 0.0719, "current_noise_a": 0.0} | changes))
        assert isinstance(drive, SimulatedMoteus)
        self.drive, self.now_s = drive, 0.0

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


def test_it_answers_questions_on_can_fd_alone_with_the_values_of_before_the_command(bench: Bench) -> None:
    question = command_frame(7, codec.QUERY_ALONE)
    unwanted = question._replace(arbitration_id=7, is_extended=False)
    for other in (unwanted, command_frame(8, codec.QUERY_ALONE), question._replace(is_fd=False)):
        assert bench.drive.receive(other, 0.1) == [] == list(bench.drive.cyclic_frames(0.1))
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
        for each in (bench, other):
            each.drive.measure(0.3, -1.0)
        data = codec.encode_torque(torque_nm)
        slow = registers.padded(data + bytes([registers.NOP]))  # one byte more
        assert bench.send(data)[0].data == other.send(slow)[0].data
        assert bench.torque_after(0.001) == other.torque_after(0.001)


@pytest.mark.parametrize("mode", [Mode.TIMEOUT, Mode.FAULT])
def test_an_expired_watchdog_and_a_fault_are_latched_until_a_stop(bench: Bench, mode: Mode) -> None:
    bench.send(codec.encode_torque(0.5))
    if mode is Mode.FAULT:
        bench.drive.trip(DriveError.OVERCURRENT)
    else:
        bench.torque_after(0.099)
        assert bench.ask().mode == Mode.POSITION  # a question does not feed the watchdog
    assert bench.torque_after(0.002) == 0.0
    bench.send(codec.encode_torque(0.5))
    assert bench.torque_after(0.001) == 0.0 and bench.drive.failed
    assert (bench.ask().mode, bench.ask().fault) == (mode, 33 if mode is Mode.FAULT else 0)
    bench.send(codec.STOP_AND_QUERY)
    assert (bench.ask().mode, bench.ask().fault) == (Mode.STOPPED, 0) and not bench.drive.failed


@pytest.mark.parametrize(("register_s", "trips"), [(0.0, True), (0.5, False), (nan, False)])
def test_a_command_may_state_its_own_watchdog(bench: Bench, register_s: float, trips: bool) -> None:
    bench.write(command_torque=0.2, kp_scale=0.0, kd_scale=0.0, watchdog=register_s)
    bench.torque_after(0.2)
    assert (bench.ask().mode == Mode.TIMEOUT) is trips


@pytest.mark.parametrize(
    ("timeout_mode", "kd_scale", "damps"),
    [(12, 1.0, True), (12, 0.5, True), (12, 0.0, False), (0, 1.0, False), (15, 0.0, True), (10, 0.0, True)],
)
def test_after_the_time_out_its_mode_decides_and_damps_with_the_last_command_s_scale(
    timeout_mode: int, kd_scale: float, damps: bool
) -> None:
    """Mode 12 uses the kd scale of the last command, like ISR_DoZeroVelocity of the firmware."""
    bench = Bench(timeout_mode=timeout_mode)
    bench.write(command_position=nan, command_torque=0.2, kp_scale=0.0, kd_scale=kd_scale)
    bench.drive.measure(0.0, 3.0)
    torque_nm = bench.torque_after(0.2)
    assert bench.ask().mode == Mode.TIMEOUT
    assert torque_nm < 0.0 if damps else torque_nm == 0.0


def test_a_position_command_with_its_defaults_holds_a_position(bench: Bench) -> None:
    bench.write(command_position=0.1)
    assert bench.torque_after(0.001) > 0.0
    bench.drive.measure(0.4 * pi, 0.0)
    assert bench.torque_after(0.001) < 0.0
    bench.write(command_position=nan, max_torque=0.01)
    bench.drive.measure(pi, 0.0)
    assert bench.torque_after(0.001) == pytest.approx(-0.01)


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
    (frame,) = Bench(serial="0123456789abcdef00112233").send(IDENTITY)
    values = registers.replied_values(registers.decode_frame(frame.data))
    assert values[Register.REGISTER_MAP] == 5 and values[Register.FIRMWARE] == 0x010100
    words = [int(values[Register.SERIAL_NUMBER + index]) & 0xFFFFFFFF for index in range(3)]
    assert words == [0x01234567, 0x89ABCDEF, 0x00112233]
