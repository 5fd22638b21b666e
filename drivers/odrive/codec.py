"""ODrive CANSimple, firmware 0.6: the bytes of each message, in both directions. drivers/odrive05 has those of 0.5.

An 11-bit arbitration id is (node id << 5) | command; payloads are little-endian, floats IEEE-754 binary32, positions
in turns. A remote frame with the id of a value asks for that value. Source: ODrive's CANSimple documentation and its
published DBC for 0.6.10, with which the tests compare this table. Some commands meant other things in 0.5, so this
program reads a drive's version before it arms it.
"""

from collections.abc import Mapping
from enum import IntEnum
from struct import Struct
from typing import Any

from drivers.can.frames import DATA_MAX_BYTES, MalformedMessageError


class Message:
    """One command with its payload's layout: the only scale and order table, for encoding and decoding."""

    def __init__(self, command: int, layout: str) -> None:
        self.command = command
        self._struct = Struct(layout)
        self.encode = self._struct.pack
        self.decode = self._struct.unpack  # raises MalformedMessageError for a shorter or longer payload

    def decode_padded(self, data: bytes) -> tuple[Any, ...]:
        """Return the values of a payload with any bytes after them, as a drive reads commands: the makers' DBC pads."""
        return self.decode(data[: self._struct.size])


GET_VERSION = Message(0x00, "<8B")  # protocol, product line, hw version, hw variant, major, minor, revision, unreleased
HEARTBEAT = Message(0x01, "<IBBB1x")  # axis error, axis state, procedure result, bit 0 trajectory done
ESTOP = Message(0x02, "<")
GET_ERROR = Message(0x03, "<II")  # active errors, disarm reason
RX_SDO = Message(0x04, "<BHB")  # opcode, endpoint, reserved; a written value follows
TX_SDO = Message(0x05, "<BHB")  # the same, and the value in as many bytes as its type has: see `decode_sdo`
ADDRESS = Message(0x06, "<BIH")  # node id and serial number; 0.6.11 appends a byte
SET_AXIS_STATE = Message(0x07, "<I")
GET_ENCODER_ESTIMATES = Message(0x09, "<ff")  # turns, turns/s
SET_CONTROLLER_MODE = Message(0x0B, "<II")  # control mode, input mode
SET_INPUT_TORQUE = Message(0x0E, "<f")  # N·m
SET_LIMITS = Message(0x0F, "<ff")  # turns/s, A
GET_IQ = Message(0x14, "<ff")  # set-point A, measured A
GET_TEMPERATURE = Message(0x15, "<ff")  # FET °C, motor °C
REBOOT = Message(0x16, "<B")  # action: 0 restart, 1 store the settings and restart
GET_BUS_VOLTAGE_CURRENT = Message(0x17, "<ff")  # V, A
SET_VEL_GAINS = Message(0x1B, "<ff")  # N·m per turn/s, and its integrator's
CLEAR_ERRORS = Message(0x18, "<B")  # identify flag


class AxisState(IntEnum):
    UNDEFINED = 0
    IDLE = 1
    CLOSED_LOOP = 8


LAST_STATE = 16  # of an axis, in firmware 0.6.11
LAST_COMMAND = 0x1F
BROADCAST_NODE = 0x3F  # firmware from 0.6.9 on: all drives, and one that has no id yet
FIRST_WITH_ADDRESS = (0, 6, 9)  # older firmware may take a request for the Address message for a new node id
SERIAL_NUMBER_LOW_BITS = 32
# Everything that a drive obeys: besides the above, positions and velocities, their limits and gains, reboot, a new
# angle, and a new firmware. RX_SDO also reads.
COMMANDS = frozenset((0x02, 0x07, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x11, 0x12, 0x13, 0x16, 0x18, 0x19, 0x1A, 0x1B, 0x1F))
TORQUE_CONTROL = 1  # control mode
PASSTHROUGH = 1  # input mode
SDO_READ = 0  # opcode; 1 would write
SDO_FLOAT = Struct("<f")
SDO_HEAD_BYTES = 4

# Flags of active errors and disarm reasons (odrive.enums.ODriveError).
ERROR_INITIALIZING = 0x1
ERROR_UNDER_VOLTAGE = 0x200
ERROR_WATCHDOG = 0x1000000
ERROR_ESTOP = 0x2000000
POWER_CUT = ERROR_ESTOP | ERROR_UNDER_VOLTAGE

ERROR_NAMES = {
    ERROR_INITIALIZING: "initializing",
    0x2: "system level",
    0x4: "timing error",
    0x8: "missing estimate",
    0x10: "bad configuration",
    0x20: "gate driver fault",
    0x40: "missing input",
    0x100: "bus over-voltage",
    ERROR_UNDER_VOLTAGE: "bus under-voltage",
    0x400: "bus over-current",
    0x800: "bus over-regeneration",
    0x1000: "current limit violation",
    0x2000: "motor over-temperature",
    0x4000: "inverter over-temperature",
    0x8000: "velocity limit violation",
    0x10000: "position limit violation",
    0x20000: "requested current too high",
    ERROR_WATCHDOG: "watchdog expired",
    ERROR_ESTOP: "emergency stop requested",
    0x4000000: "spin-out",
    0x8000000: "brake resistor disarmed",
    0x10000000: "thermistor disconnected",
    0x40000000: "calibration error",
}


def error_text(flags: int, known: Mapping[int, str] = ERROR_NAMES) -> str:
    """Name the active errors; unknown bits appear as a number."""
    names = [name for bit, name in known.items() if flags & bit]
    unknown = flags & ~sum(known)
    return ", ".join(names + ([f"unknown flag 0x{unknown:x}"] if unknown else []))


def arbitration_id(node_id: int, message: Message) -> int:
    return node_id << 5 | message.command


def encode_address(node_id: int, serial_number: int) -> bytes:
    """Encode what firmware 0.6.11 reports: the last byte numbers the connection."""
    low = serial_number & (1 << SERIAL_NUMBER_LOW_BITS) - 1
    return ADDRESS.encode(node_id, low, serial_number >> SERIAL_NUMBER_LOW_BITS) + bytes(1)


def decode_serial_number(data: bytes) -> str:
    """Return the serial number of an Address message as ODrive's tools print it: 12 hexadecimal digits."""
    _, low, high = ADDRESS.decode(data[:7] if len(data) == DATA_MAX_BYTES else data)
    return f"{high << SERIAL_NUMBER_LOW_BITS | low:012x}"


def decode_sdo(data: bytes) -> tuple[int, bytes]:
    """Return the endpoint that a drive was asked for and the bytes of its value. Frames may be padded to eight."""
    if not SDO_HEAD_BYTES < len(data) <= 2 * SDO_HEAD_BYTES:
        raise MalformedMessageError(f"command 0x{TX_SDO.command:02x} with {len(data)} bytes")
    _, endpoint, _ = TX_SDO.decode(data[:SDO_HEAD_BYTES])
    return endpoint, data[SDO_HEAD_BYTES:]


def decode_sdo_flag(value: bytes) -> bool:
    if value[0] > 1:
        raise MalformedMessageError(f"a flag of {value[0]}")
    return value[0] == 1


def decode_sdo_float(value: bytes) -> float:
    if len(value) < SDO_FLOAT.size:
        raise MalformedMessageError(f"a number of {len(value)} bytes")
    (number,) = SDO_FLOAT.unpack_from(value)
    return float(number)
