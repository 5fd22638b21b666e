"""The codec of moteus, byte for byte against the package `moteus` of its makers."""

import struct
from collections.abc import Iterator
from math import isclose, isnan, nan
from random import Random
from typing import Any

import pytest

from drivers.can.frames import FD_LENGTHS, MalformedMessageError
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode, Reply
from drivers.moteus.registers import Register, Resolution, Subframe

moteus = pytest.importorskip("moteus", reason="the package moteus, the oracle of its codec, is not installed")
RANDOM_FRAMES = 1_000
COMMAND_REGISTERS = {
    "position": Register.COMMAND_POSITION,
    "velocity": Register.COMMAND_VELOCITY,
    "feedforward_torque": Register.COMMAND_TORQUE,
    "kp_scale": Register.KP_SCALE,
    "kd_scale": Register.KD_SCALE,
    "maximum_torque": Register.MAX_TORQUE,
    "watchdog_timeout": Register.WATCHDOG,
    "ilimit_scale": Register.ILIMIT_SCALE,
}
TORQUE_RESOLUTION = {name: moteus.INT8 for name in COMMAND_REGISTERS} | {"feedforward_torque": moteus.F32}
OUR_QUERY = {
    "position": moteus.F32,
    "velocity": moteus.F32,
    "torque": moteus.IGNORE,
    "q_current": moteus.F32,
    "motor_temperature": moteus.INT8,
    "_extra": {Register.CONTROL_TORQUE: moteus.INT16},
}


def controller(node_id: int = 1, position: dict[str, Any] | None = None) -> Any:
    """Return the package's own encoder, without a bus."""
    query, resolution = moteus.QueryResolution(), moteus.PositionResolution()
    for name, value in OUR_QUERY.items():
        setattr(query, name, value)
    for name, value in (position or TORQUE_RESOLUTION).items():
        setattr(resolution, name, value)
    return moteus.Controller(node_id, transport=object(), query_resolution=query, position_resolution=resolution)


def same(one: float, other: float) -> bool:
    return one != one and other != other or isclose(one, other, rel_tol=1e-12, abs_tol=1e-12)


def test_random_torques_are_encoded_as_by_the_package() -> None:
    random, package = Random(1), controller()
    for _ in range(RANDOM_FRAMES):
        torque_nm = random.choice([random.uniform(-5.0, 5.0), random.gauss(0.0, 1e-3), 0.0, -0.0])
        command = package.make_position(
            position=nan, velocity=0.0, feedforward_torque=torque_nm, kp_scale=0, kd_scale=0, ilimit_scale=0, query=True
        )
        data = codec.encode_torque(torque_nm)
        assert data == command.data
        assert codec.decode_torque(data) == struct.unpack("<f", struct.pack("<f", torque_nm))[0]


@pytest.mark.parametrize("node_id", [1, 7, 8, 32, 126])
def test_the_arbitration_ids_are_those_of_the_package(node_id: int) -> None:
    command = controller(node_id).make_query()
    assert codec.command_id(node_id) == command.source << 8 | 0x8000 * command.reply_required | command.destination
    reply = moteus.command.Command()
    assert codec.reply_id(node_id) >> 8 & 0x7F == node_id and codec.reply_id(node_id) & 0xFF == reply.source


def test_the_other_frames_are_those_of_the_package() -> None:
    package, text = controller(), b"conf get servo.default_timeout_s\n"
    assert package.make_query().data == codec.QUERY
    assert package.make_stop().data == codec.STOP
    assert package.make_stop(query=True).data == codec.STOP + codec.QUERY
    assert package.make_diagnostic_write(text).data == registers.encode_console(registers.CONSOLE_INPUT, text)
    assert package.make_diagnostic_read(40).data == registers.encode_console_poll(40)
    identity = {Register.MODEL + index: moteus.INT32 for index in range(3)}
    serial = {Register.SERIAL_NUMBER + index: moteus.INT32 for index in range(3)}
    ours = [registers.encode_read(Resolution.INT32, first, 3) for first in (Register.MODEL, Register.SERIAL_NUMBER)]
    assert package.make_custom_query(identity | serial).data == b"".join(ours)


def random_reply(random: Random) -> Reply:
    def reading(largest: float) -> float:
        return struct.unpack("<f", struct.pack("<f", random.uniform(-largest, largest)))[0]  # type: ignore[no-any-return]

    return Reply(
        mode=random.choice(list(Mode)),
        position_turn=random.choice([reading(1000.0), nan]),
        velocity_turn_s=reading(100.0),
        q_current_a=reading(40.0),
        motor_temperature_c=random.choice([float(random.randint(-40, 127)), nan]),
        voltage_v=0.5 * random.randint(0, 127),
        fault=random.choice([0, *range(32, 51), *range(96, 104)]),
        control_torque_nm=0.01 * random.randint(-32767, 32767),
        board_temperature_c=float(random.randint(-40, 127)),
    )


def test_random_replies_are_read_as_by_the_package() -> None:
    random = Random(2)
    for _ in range(RANDOM_FRAMES):
        reply = random_reply(random)
        data = codec.encode_reply(reply)
        decoded, read = codec.decode_reply(data), moteus.parse_registers(data).response
        expected = [read[each] for each in (0x0, 0x1, 0x2, 0x4, 0xA, 0xD, 0xF, 0x3A, 0xE)]
        assert all(map(same, decoded, expected)), (reply, decoded, expected)


def random_commands(random: Random, count: int) -> Iterator[Any]:
    kinds = [moteus.INT8, moteus.INT16, moteus.INT32, moteus.F32]
    for _ in range(count // 50):
        package = controller(position={name: random.choice(kinds) for name in COMMAND_REGISTERS})
        for _ in range(50):
            names = [name for name in COMMAND_REGISTERS if random.random() < 0.6]
            values = {name: random.choice([random.uniform(-3.0, 3.0), nan, 0.0]) for name in names}
            yield package.make_position(query=random.random() < 0.5, **values)


def encoded(subframe: Subframe) -> bytes:
    if subframe.kind == registers.READ:
        return registers.encode_read(subframe.resolution, subframe.register, subframe.length)
    return registers.encode_values(subframe.kind, subframe.resolution, subframe.register, subframe.values)


def test_random_commands_of_the_package_are_read_as_by_itself() -> None:
    for command in random_commands(Random(3), RANDOM_FRAMES // 2):
        subframes = list(registers.decode_frame(command.data))
        written = {
            each.register + index: value
            for each in subframes
            if each.kind == registers.WRITE
            for index, value in enumerate(each.values)
        }
        expected = moteus.parse_registers(command.data).command
        assert written.keys() == {int(each) for each in expected}
        assert all(same(value, expected[register]) for register, value in written.items())
        asked = {
            each.register + index for each in subframes if each.kind == registers.READ for index in range(each.length)
        }
        assert asked == {int(each[0]) for each in moteus.parse_registers(command.data).query}


UNSCALED = (Register.COMMAND_Q_CURRENT, Register.COMMAND_D_CURRENT)  # the package scales them where it writes them only


def test_random_replies_of_any_resolution_are_read_as_by_the_package() -> None:
    random, known = Random(4), [each for each in Register if each in registers.SCALES and each not in UNSCALED]
    for _ in range(RANDOM_FRAMES // 2):
        parts = [
            registers.encode_values(
                registers.REPLY, random.choice(list(Resolution)), register, [random.gauss(0.0, 2.0)]
            )
            for register in random.sample(known, random.randint(1, 5))
        ]
        data = registers.padded(b"".join(parts))
        ours = registers.replied_values(registers.decode_frame(data))
        package = {int(register): value for register, value in moteus.parse_registers(data).response.items()}
        assert ours.keys() == package.keys() and len(data) in FD_LENGTHS
        assert all(same(value, package[register]) for register, value in ours.items())


def test_random_bytes_are_malformed_or_subframes() -> None:
    random = Random(5)
    for _ in range(5_000):
        data = random.randbytes(random.randint(0, 64))
        try:
            assert all(isinstance(each, Subframe) for each in registers.decode_frame(data))
        except MalformedMessageError:
            continue


@pytest.mark.parametrize("end", range(codec.REPLY_BYTES))
def test_a_reply_that_was_cut_short_is_malformed(end: int) -> None:
    data = codec.encode_reply(random_reply(Random(6)))
    with pytest.raises(MalformedMessageError):
        codec.decode_reply(data[:end])


@pytest.mark.parametrize("position", range(codec.TORQUE_BYTES))
def test_every_changed_byte_besides_the_torque_is_no_torque_command(position: int) -> None:
    data = bytearray(codec.encode_torque(0.5))
    data[position] ^= 0x01
    begin = data.index(bytes.fromhex("0d22")) + 2 if position not in (7, 8) else 9
    assert isnan(codec.decode_torque(bytes(data))) is not (begin <= position < begin + 4)
