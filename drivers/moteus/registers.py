"""moteus's multiplex protocol in general: the subframes of a CAN FD frame, in both directions.

A frame is a sequence of subframes: writes, reads and replies of consecutive registers in one of four resolutions,
errors, and a stream of text to and from the diagnostic console. Integers are scaled by the register's quantity, and the
most negative one means NaN. All numbers are little-endian. Trailing NOP bytes fill the frame up to a length that CAN FD
has. Sources: docs/protocol/can.md and registers.md of mjbots/moteus; the tests compare this module with the package
`moteus` 1.1.
"""

from collections.abc import Iterable, Iterator, Sequence
from enum import IntEnum
from math import isfinite, nan
from struct import Struct
from typing import NamedTuple

from drivers.can.frames import FD_LENGTHS, MalformedMessageError

WRITE, READ, REPLY = 0x00, 0x10, 0x20  # the upper half of a subframe's first byte
WRITE_ERROR, READ_ERROR = 0x30, 0x31
CONSOLE_INPUT, CONSOLE_OUTPUT, CONSOLE_POLL = 0x40, 0x41, 0x42
NOP = 0x50
CONSOLE = 1  # the number of the diagnostic console's stream
VARUINT_BYTES = 5


class Resolution(IntEnum):
    INT8 = 0
    INT16 = 1
    INT32 = 2
    FLOAT = 3


class Register(IntEnum):
    """The registers that this program and its simulated drive know."""

    MODE = 0x000
    POSITION = 0x001
    VELOCITY = 0x002
    TORQUE = 0x003
    Q_CURRENT = 0x004
    D_CURRENT = 0x005
    POWER = 0x007
    MOTOR_TEMPERATURE = 0x00A
    VOLTAGE = 0x00D
    BOARD_TEMPERATURE = 0x00E
    FAULT = 0x00F
    COMMAND_Q_CURRENT = 0x01C
    COMMAND_D_CURRENT = 0x01D
    COMMAND_POSITION = 0x020
    COMMAND_VELOCITY = 0x021
    COMMAND_TORQUE = 0x022
    KP_SCALE = 0x023
    KD_SCALE = 0x024
    MAX_TORQUE = 0x025
    WATCHDOG = 0x027
    ILIMIT_SCALE = 0x02B
    CONTROL_TORQUE = 0x03A
    MODEL = 0x100
    FIRMWARE = 0x101
    REGISTER_MAP = 0x102
    SERIAL_NUMBER = 0x120  # and the two that follow


LAYOUTS = (Struct("<b"), Struct("<h"), Struct("<i"), Struct("<f"))
LARGEST = (127, 32767, 2147483647)
_PLAIN = (1.0, 1.0, 1.0)
_POSITION, _VELOCITY = (0.01, 1e-4, 1e-5), (0.1, 0.00025, 1e-5)
_TORQUE, _CURRENT, _VOLTAGE = (0.5, 0.01, 0.001), (1.0, 0.1, 0.001), (0.5, 0.1, 0.001)
_TEMPERATURE, _TIME, _FRACTION = (1.0, 0.1, 0.001), (0.01, 0.001, 1e-6), (1 / 127, 1 / 32767, 1 / 2147483647)
SCALES = {  # of int8, int16, int32; registers without a line are plain integers
    Register.POSITION: _POSITION,
    Register.VELOCITY: _VELOCITY,
    Register.TORQUE: _TORQUE,
    Register.Q_CURRENT: _CURRENT,
    Register.D_CURRENT: _CURRENT,
    Register.POWER: (10.0, 0.05, 0.0001),
    Register.MOTOR_TEMPERATURE: _TEMPERATURE,
    Register.VOLTAGE: _VOLTAGE,
    Register.BOARD_TEMPERATURE: _TEMPERATURE,
    Register.COMMAND_Q_CURRENT: _CURRENT,
    Register.COMMAND_D_CURRENT: _CURRENT,
    Register.COMMAND_POSITION: _POSITION,
    Register.COMMAND_VELOCITY: _VELOCITY,
    Register.COMMAND_TORQUE: _TORQUE,
    Register.KP_SCALE: _FRACTION,
    Register.KD_SCALE: _FRACTION,
    Register.MAX_TORQUE: _TORQUE,
    Register.WATCHDOG: _TIME,
    Register.ILIMIT_SCALE: _FRACTION,
    Register.CONTROL_TORQUE: _TORQUE,
}


class Subframe(NamedTuple):
    """One subframe. Only the fields of its kind are set."""

    kind: int  # WRITE, READ, REPLY, WRITE_ERROR, READ_ERROR, CONSOLE_INPUT, CONSOLE_OUTPUT or CONSOLE_POLL
    resolution: Resolution = Resolution.INT8
    register: int = 0  # the first one; of an error: the register that was refused
    length: int = 0  # in registers, or bytes that a poll of the console asks for at most
    values: tuple[float, ...] = ()  # of a write or a reply, scaled
    text: bytes = b""  # of the console


def padded(data: bytes) -> bytes:
    """Fill a payload up to the next length that CAN FD has."""
    length = min((each for each in FD_LENGTHS if each >= len(data)), default=-1)
    if length < 0:
        raise ValueError(f"A CAN FD frame has up to {max(FD_LENGTHS)} bytes of data, not {len(data)}.")
    return data.ljust(length, bytes([NOP]))


def encode_read(resolution: Resolution, register: int, count: int = 1) -> bytes:
    return _head(READ, resolution, register, count)


def encode_values(kind: int, resolution: Resolution, register: int, values: Sequence[float]) -> bytes:
    """Encode a write or a reply of consecutive registers."""
    codes = (_encode_value(resolution, register + index, value) for index, value in enumerate(values))
    return _head(kind, resolution, register, len(values)) + b"".join(codes)


def encode_read_error(register: int) -> bytes:
    """Encode the answer to the reading of a register that the drive does not have."""
    return bytes([READ_ERROR]) + _varuint(register) + _varuint(1)


def encode_console(kind: int, text: bytes) -> bytes:
    return bytes([kind, CONSOLE]) + _varuint(len(text)) + text


def encode_console_poll(most_bytes: int) -> bytes:
    return bytes([CONSOLE_POLL, CONSOLE]) + _varuint(most_bytes)


def _head(kind: int, resolution: Resolution, register: int, count: int) -> bytes:
    """A count of up to three stands in the first byte."""
    short = count if count <= 3 else 0
    return bytes([kind | resolution << 2 | short]) + (b"" if short else _varuint(count)) + _varuint(register)


def _encode_value(resolution: Resolution, register: int, value: float) -> bytes:
    """Scale and truncates as moteus does; a number that is not finite becomes the most negative integer."""
    layout = LAYOUTS[resolution]
    if resolution is Resolution.FLOAT:
        return layout.pack(value)
    largest = LARGEST[resolution]
    if not isfinite(value):
        return layout.pack(-largest - 1)
    code = value / SCALES.get(register, _PLAIN)[resolution]  # type: ignore[call-overload]
    return layout.pack(int(min(max(code, -largest), largest)))


def _varuint(number: int) -> bytes:
    """Seven bits a byte, the lowest first; the top bit says that more follow."""
    encoded = bytearray()
    while number > 0x7F:
        encoded.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*encoded, number])


def decode_frame(data: bytes) -> Iterator[Subframe]:
    """Yield the subframes of a payload; raises MalformedMessageError where it reaches one that is none."""
    reader = _Reader(data)
    while reader.position < len(data):
        head = reader.take(1)[0]
        if head == NOP:
            continue
        kind = head & 0xF0
        if kind in (WRITE, READ, REPLY):
            yield _decode_registers(reader, kind, Resolution(head >> 2 & 3), head & 3)
        elif head in (WRITE_ERROR, READ_ERROR):
            yield Subframe(head, register=reader.varuint(), length=reader.varuint())
        elif head in (CONSOLE_INPUT, CONSOLE_OUTPUT):
            _require_console(reader)
            yield Subframe(head, text=reader.take(reader.varuint()))
        elif head == CONSOLE_POLL:
            _require_console(reader)
            yield Subframe(head, length=reader.varuint())
        else:
            raise MalformedMessageError(f"subframe 0x{head:02x}")


def _require_console(reader: "_Reader") -> None:
    channel = reader.varuint()
    if channel != CONSOLE:
        raise MalformedMessageError(f"stream {channel}")


def _decode_registers(reader: "_Reader", kind: int, resolution: Resolution, short: int) -> Subframe:
    count = short or reader.varuint()
    register = reader.varuint() if count else 0
    if kind == READ:
        return Subframe(kind=kind, resolution=resolution, register=register, length=count)
    layout = LAYOUTS[resolution]
    if reader.position + count * layout.size > len(reader.data):
        raise MalformedMessageError(f"{count} registers do not fit")
    values = (layout.unpack(reader.take(layout.size))[0] for _ in range(count))
    scaled = (_scaled(resolution, register + index, value) for index, value in enumerate(values))
    return Subframe(kind=kind, resolution=resolution, register=register, length=count, values=tuple(scaled))


def _scaled(resolution: Resolution, register: int, code: float) -> float:
    if resolution is Resolution.FLOAT:
        return code
    if code == -LARGEST[resolution] - 1:
        return nan
    return code * SCALES.get(register, _PLAIN)[resolution]  # type: ignore[call-overload, no-any-return]


class _Reader:
    """Reads a payload from its begin to its end."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def take(self, count: int) -> bytes:
        begin, self.position = self.position, self.position + count
        if self.position > len(self.data):
            raise MalformedMessageError(f"cut short after {len(self.data)} bytes")
        return self.data[begin : self.position]

    def varuint(self) -> int:
        number = 0
        for index in range(VARUINT_BYTES):
            byte = self.take(1)[0]
            number |= (byte & 0x7F) << 7 * index
            if not byte & 0x80:
                return number
        raise MalformedMessageError("a number of more than five bytes")


def replied_values(subframes: Iterable[Subframe]) -> dict[int, float]:
    """Return the values of all replies by register; one that the drive does not know is left out."""
    return {
        each.register + index: value
        for each in subframes
        if each.kind == REPLY
        for index, value in enumerate(each.values)
        if isfinite(value)
    }
