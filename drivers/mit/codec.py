"""MIT mode of the mini cheetah's motors, CubeMars, Damiao and RobStride: commands and answers of eight bytes.

A command goes to the drive's own id and packs position (16 bits), velocity, kp, kd and torque (12 bits each) as codes
of a model's ranges, big-endian. Four payloads of FF and one last byte are other commands: FC enters the mode, FD leaves
it, FE makes the present position zero, FB clears the errors of a Damiao and of a RobStride. A drive only sends one
answer to each command. A RobStride's answer ends in a temperature of 16 bits in place of one and a fault: its faults
are reported in an answer of another form, to a question of their own.

A code is (x + range) · (2ⁿ - 1) / (2 · range), so zero lies in the middle of two codes and no command has zero torque.
Its code here is the nearest one, of the two the upper: the drive follows half a step, range / 4095. A drive is without
torque only outside of the mode. Torque is rounded to the nearest code here; the published encoders truncate.

Drives truncate too (float_to_uint), so a code of an answer stands for the step above it, and is decoded as its middle:
a joint at rest reads exactly zero, and the mean of many answers is right. The published decoders return the lower end.

Sources: Core/Src/can.c of bgkatz/motorcontrol; damiao-motor 1.0.6; TMotorCANControl 1.2.6; RobStride User Manuals of
2026-04-28, section 6; see docs/how-to/mit.md.
"""

from math import nan
from struct import Struct
from typing import NamedTuple

from drivers.can.frames import Frame, MalformedMessageError
from drivers.mit.models import TORQUE_CODES, Model

ANSWER_BYTES = 8
_SPECIAL = b"\xff" * 7
ENTER, LEAVE, SET_ZERO, CLEAR = (_SPECIAL + bytes([last]) for last in (0xFC, 0xFD, 0xFE, 0xFB))
FAULT_QUESTION = b"\xff" * 6 + b"\x00\xfb"  # to a RobStride; to other makers' drives a command with full gains
ROBSTRIDE_MASTER = 0xFD  # the id under which a RobStride answers, where it is not 0
_PURE_TORQUE = bytes.fromhex("8000 8000 0000")  # codes of zero position and velocity; kp and kd exactly 0
ZERO_CODE = (TORQUE_CODES + 1) // 2
_ANSWER = Struct(">BHBBBBB")
POSITION_CODES = 65535

REGISTER_ID = 0x7FF
READ, WRITE, STORE = 0x33, 0x55, 0xAA
STATE = 0xCC  # asks for an answer without a command
_REGISTER_FRAME = Struct("<HBB4s")

DISABLED, ENABLED, LOST_COMMANDS = 0x0, 0x1, 0xD  # a Damiao's status
UNDER_VOLTAGES = (0x4, 0x9)  # of a CubeMars and of a Damiao
FAULT_NAMES = {
    1: "over-temperature",
    2: "over-current",
    3: "over-voltage",
    4: "under-voltage",
    5: "encoder fault",
    6: "phase currents unbalanced",
    0x8: "over-voltage",
    0x9: "under-voltage",
    0xA: "over-current",
    0xB: "transistors too hot",
    0xC: "rotor too hot",
    LOST_COMMANDS: "watchdog expired",
    0xE: "overload",
    0x10: "driver chip",
    0x11: "another fault, see the makers' manual",
}
_FAULTS_OF_BITS = ((2, 4), (3, 3), (4, 2), (5, 2), (16, 2), (0, 1), (1, 0x10), (7, 5), (14, 0xE))  # of a RobStride


class Answer(NamedTuple):
    """The answer to a command; `status` is a Damiao's, `fault` a CubeMars's. A RobStride has neither of them here."""

    node_id: int
    status: int
    position_rad: float
    velocity_rad_s: float
    torque_nm: float
    temperature_c: float  # of the drive
    last: int  # Damiao: temperature of the rotor; CubeMars: the fault

    @property
    def fault(self) -> int:
        return self.last


def feedback_id(node_id: int, model: Model) -> int:
    """Return the id under which a drive answers: a CubeMars its own; Damiao and RobStride as the set-up page says."""
    if model.reports_faults_apart:
        return ROBSTRIDE_MASTER
    return node_id + 16 if model.has_registers else node_id


def encode_torque(torque_nm: float, range_nm: float) -> bytes:
    """Encode torque alone, kp = kd = 0. What lies beyond the range gets its ends; NaN is no payload that may leave."""
    if torque_nm != torque_nm:
        return b""
    torque_nm = -range_nm if torque_nm < -range_nm else range_nm if torque_nm > range_nm else torque_nm
    code = round((torque_nm + range_nm) * (TORQUE_CODES / (2.0 * range_nm))) if torque_nm else ZERO_CODE
    return _PURE_TORQUE + code.to_bytes(2, "big")


def decode_torque(data: bytes, range_nm: float) -> float:
    """Return the torque of exactly one such command, zero for ZERO_CODE; NaN for any other payload."""
    if len(data) != ANSWER_BYTES or data[:6] != _PURE_TORQUE or data[6] > 0xF:
        return nan
    code = data[6] << 8 | data[7]
    return 0.0 if code == ZERO_CODE else _decode(code, range_nm, TORQUE_CODES)


def _decode(code: float, limit: float, codes: int) -> float:
    return code * (2.0 * limit) / codes - limit


def _encode(value: float, limit: float, codes: int) -> int:
    """Truncate, as a drive does, and end at the range."""
    return int((min(max(value, -limit), limit) + limit) * codes / (2.0 * limit))


def decode_answer(data: bytes, model: Model) -> Answer:
    """Decode an answer; raises MalformedMessageError for another length."""
    if len(data) != ANSWER_BYTES:
        raise MalformedMessageError(f"an answer of {len(data)} bytes")
    head, position, velocity, middle, torque, temperature, last = _ANSWER.unpack(data)
    if model.reports_faults_apart:
        temperature, last = (((temperature << 8 | last) ^ 0x8000) - 0x8000) / 10.0, 0  # signed: mud may freeze
    return Answer(  # by position: it is built for every drive in every tick
        head & 0xF,
        head >> 4,
        _decode(position + 0.5, model.position_rad, POSITION_CODES),
        _decode((velocity << 4 | middle >> 4) + 0.5, model.velocity_rad_s, TORQUE_CODES),
        _decode(((middle & 0xF) << 8 | torque) + 0.5, model.torque_nm, TORQUE_CODES),
        float(temperature),
        last,
    )


def encode_answer(answer: Answer, model: Model) -> bytes:
    position = _encode(answer.position_rad, model.position_rad, POSITION_CODES)
    velocity = _encode(answer.velocity_rad_s, model.velocity_rad_s, TORQUE_CODES)
    torque = _encode(answer.torque_nm, model.torque_nm, TORQUE_CODES)
    middle = (velocity & 0xF) << 4 | torque >> 8
    head = answer.status << 4 | answer.node_id
    temperature, last = round(min(max(answer.temperature_c, 0.0), 255.0)), answer.last
    if model.reports_faults_apart:
        temperature, last = divmod(round(answer.temperature_c * 10.0) & 0xFFFF, 256)
    return _ANSWER.pack(head, position, velocity >> 4, middle, torque & 0xFF, temperature, last)


def encode_faults(node_id: int, faults: int) -> bytes:
    return bytes([node_id]) + faults.to_bytes(4, "little") + bytes(3)


def is_faults(data: bytes) -> bool:
    """Return whether an answer of a RobStride reports its faults. No state has the lowest torque at 0 °C."""
    return len(data) == ANSWER_BYTES and data[4:] == bytes(4)


def decode_faults(data: bytes) -> int:
    """Return the first of these faults as a number of FAULT_NAMES; zero for none."""
    faults = int.from_bytes(data[1:5], "little")
    return next((fault for bit, fault in _FAULTS_OF_BITS if faults >> bit & 1), 0x11) if faults else 0


def encode_read(node_id: int, register: int) -> bytes:
    return encode_register(node_id, READ, register, bytes(4))


def state_request(node_id: int) -> Frame:
    """Ask a Damiao for an answer without a command; firmware that does not know the request is silent."""
    return Frame(REGISTER_ID, encode_register(node_id, STATE, 0, bytes(4)))


def encode_register(node_id: int, kind: int, register: int, value: bytes) -> bytes:
    return _REGISTER_FRAME.pack(node_id, kind, register, value)


def decode_register(data: bytes) -> tuple[int, int, int, bytes]:
    """Return node, kind, register and value; raises MalformedMessageError for another length."""
    if len(data) != ANSWER_BYTES:
        raise MalformedMessageError(f"a register frame of {len(data)} bytes")
    node_id, kind, register, value = _REGISTER_FRAME.unpack(data)
    return node_id, kind, register, value


def is_register_answer(data: bytes, node_id: int) -> bool:
    """Return whether an answer of a Damiao carries a register. So may that of one at its range's end."""
    return len(data) == ANSWER_BYTES and data[0] == node_id and data[1] == 0 and data[2] in (READ, WRITE)


def error_text(flags: int) -> str:
    """Name a drive's fault; empty for none."""
    return FAULT_NAMES.get(flags, f"fault {flags}") if flags else ""
