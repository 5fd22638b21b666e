"""moteus over CAN FD: the frames of every tick, in both directions. registers.py has the protocol in general.

The arbitration id is source << 8 | destination; this program is source 0. Bit 15 asks for a reply, without which a
drive sends nothing. So a tick is one frame each way per drive: a command whose last subframes ask for all signals, and
the reply, both of 32 bytes at 5 Mbit/s after an arbitration at 1 Mbit/s.

A torque is commanded in position mode with no feedback: kp, kd and the integrator's limit are scaled to zero and the
position is NaN, the present one. Both, because NaN alone would still leave kd, and the zero scales alone would state a
position that a drive holds as soon as a scale is anything else. Current mode would bypass the drive's own limits of
position. All registers that a torque command does not write are at their defaults: the watchdog is the configured one.
"""

from enum import IntEnum
from math import nan
from struct import Struct
from typing import NamedTuple

from drivers.can.frames import Frame, MalformedMessageError
from drivers.moteus.registers import padded

REPLY_WANTED = 0x8000
HOST = 0  # the id of this program


class Mode(IntEnum):
    STOPPED = 0
    FAULT = 1
    CURRENT = 9
    POSITION = 10
    TIMEOUT = 11
    ZERO_VELOCITY = 12
    STAY_WITHIN = 13
    BRAKE = 15


STOP = bytes.fromhex("010000")
# mode as int8; position and velocity as float; q current as float; motor temperature as int8; voltage, board
# temperature and fault as int8; torque of the drive's controller as int16
QUERY = bytes.fromhex("1100 1e01 1d04 110a 130d 153a")
QUERY_ALONE, STOP_AND_QUERY = padded(QUERY), padded(STOP + QUERY)
POWER_QUERY = bytes.fromhex("1d07")  # the motor's electrical power as float, which no answer of a tick has
_POWER_REPLY = bytes.fromhex("2d07")
_FLOAT = Struct("<f")
_TORQUE_HEAD = bytes.fromhex("01000a 02208000 0d22")  # position mode; position NaN, velocity 0; torque as float
_TORQUE_TAIL = bytes.fromhex("02230000 012b00") + QUERY  # scales of kp, kd and the integrator's limit 0
TORQUE_BYTES = len(_TORQUE_HEAD) + _FLOAT.size + len(_TORQUE_TAIL)
# The headers of the reply's subframes stand between the values, and one NOP after them.
_REPLY = Struct("<2s b 2s 2f 2s f 2s b 2s 3b 2s h s")
_REPLY_HEADS = tuple(bytes.fromhex(head) for head in ("2100", "2e01", "2d04", "210a", "230d", "253a", "50"))
REPLY_BYTES, FIRST_REPLY_BYTE = _REPLY.size, 0x21
ABSENT = -128  # an int8 that the drive does not know
VOLTAGE_V, TORQUE_NM = 0.5, 0.01  # of the smallest step
UNKNOWN_FAULT = 0xFF  # a drive that reports the mode FAULT without a code
TIMEOUT_FLAG = 0x100  # this program's own number for the mode TIMEOUT, next to the drive's fault codes
UNDER_VOLTAGE = 40

FAULT_NAMES = {
    32: "calibration fault",
    33: "motor driver fault",
    34: "over-voltage",
    35: "encoder fault",
    36: "motor not configured",
    37: "PWM cycle overrun",
    38: "over-temperature",
    39: "started outside of servopos.position_min and position_max",
    UNDER_VOLTAGE: "under-voltage",
    41: "configuration changed",
    42: "commutation angle invalid",
    43: "position invalid",
    44: "gate driver cannot be enabled",
    45: "deprecated stop position",
    46: "timing violation",
    47: "back-EMF feed-forward without acceleration limit",
    48: "invalid limits of position",
    49: "position error too large",
    50: "velocity error too large",
    TIMEOUT_FLAG: "watchdog expired",
}


class Reply(NamedTuple):
    """The answer to QUERY. A value that the drive does not know is NaN."""

    mode: int
    position_turn: float
    velocity_turn_s: float
    q_current_a: float
    motor_temperature_c: float
    voltage_v: float
    fault: int
    control_torque_nm: float
    board_temperature_c: float = 0.0


AT_REST = Reply(
    mode=Mode.STOPPED,
    position_turn=0.0,
    velocity_turn_s=0.0,
    q_current_a=0.0,
    motor_temperature_c=0.0,
    voltage_v=24.0,
    fault=0,
    control_torque_nm=0.0,
)


def command_id(node_id: int) -> int:
    return REPLY_WANTED | node_id


def command_frame(node_id: int, data: bytes) -> Frame:
    return Frame(command_id(node_id), data, is_extended=True, is_fd=True, bit_rate_switch=True)


def reply_id(node_id: int) -> int:
    return node_id << 8


def error_flags(mode: int, fault: int) -> int:
    """Return the drive's fault, or TIMEOUT_FLAG; 0 for the limits that the same register names in other modes."""
    if mode == Mode.TIMEOUT:
        return TIMEOUT_FLAG
    return (fault or UNKNOWN_FAULT) if mode == Mode.FAULT else 0


def error_text(flags: int) -> str:
    """Name a drive's fault; empty for none."""
    return FAULT_NAMES.get(flags, f"fault {flags}") if flags else ""


def encode_torque(torque_nm: float) -> bytes:
    return _TORQUE_HEAD + _FLOAT.pack(torque_nm) + _TORQUE_TAIL


def decode_torque(data: bytes) -> float:
    """Return the torque of exactly one such command; NaN for any other payload."""
    end = len(_TORQUE_HEAD)
    if len(data) != TORQUE_BYTES or data[:end] != _TORQUE_HEAD or data[end + _FLOAT.size :] != _TORQUE_TAIL:
        return nan
    return float(_FLOAT.unpack_from(data, end)[0])


def decode_power(data: bytes) -> float | None:
    """Return the motor's power in W from the answer to POWER_QUERY; None for any other payload."""
    end = len(_POWER_REPLY) + _FLOAT.size
    if len(data) < end or data[: len(_POWER_REPLY)] != _POWER_REPLY:
        return None
    return float(_FLOAT.unpack_from(data, len(_POWER_REPLY))[0])


def encode_reply(reply: Reply) -> bytes:
    a, b, c, d, e, f, nop = _REPLY_HEADS
    return _REPLY.pack(
        a,
        reply.mode,
        b,
        reply.position_turn,
        reply.velocity_turn_s,
        c,
        reply.q_current_a,
        d,
        _code(reply.motor_temperature_c, 127),
        e,
        _code(reply.voltage_v / VOLTAGE_V, 127),
        _code(reply.board_temperature_c, 127),
        reply.fault,
        f,
        _code(reply.control_torque_nm / TORQUE_NM, 32767),
        nop,
    )


def _code(number: float, largest: int) -> int:
    """Truncate and end at the largest code, as a drive does; NaN is the most negative one."""
    return int(min(max(number, -largest), largest)) if number == number else -largest - 1


def decode_reply(data: bytes) -> Reply:
    """Decode a reply; raises MalformedMessageError for a payload that does not answer QUERY."""
    a, mode, b, position, velocity, c, current, d, motor, e, voltage, board, fault, f, torque, g = _REPLY.unpack(data)
    if (a, b, c, d, e, f, g) != _REPLY_HEADS:
        raise MalformedMessageError("a reply of other registers")
    return Reply(  # by position: it is built for every drive in every tick
        mode,
        position,
        velocity,
        current,
        nan if motor == ABSENT else float(motor),
        nan if voltage == ABSENT else VOLTAGE_V * voltage,
        fault,
        nan if torque == -32768 else TORQUE_NM * torque,
        board,
    )
