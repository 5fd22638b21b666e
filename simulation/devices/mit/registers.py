"""The registers of a simulated Damiao that this program reads, and the frames that read and write them."""

from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.models import Model
from drivers.mit.settings import (
    CONTROL_MODE,
    DRIVE_C,
    FLOAT,
    FLOATS,
    GEAR_RATIO,
    MAX_CURRENT,
    MIT_MODE,
    PMAX,
    POLE_PAIRS,
    ROTOR_C,
    SERIAL,
    SOFTWARE,
    SUPPLY_V,
    TIMEOUT,
    TIMEOUT_UNIT_S,
    TMAX,
    TORQUE_CONSTANT,
    UNDERVOLTAGE,
    VMAX,
    WORD,
)
from drivers.mit.setup import ESC_ID, MST_ID
from simulation.devices.drive import SimulatedDriveParameters

FIRMWARE = 5013
READ_ONLY = frozenset({SOFTWARE, SERIAL, POLE_PAIRS, GEAR_RATIO, MAX_CURRENT, SUPPLY_V, DRIVE_C, ROTOR_C})


def first_values(parameters: SimulatedDriveParameters, model: Model) -> dict[int, float]:
    """Return the registers after delivery, with the watchdog and the serial number that are asked for."""
    return {
        UNDERVOLTAGE: 15.0,
        TORQUE_CONSTANT: parameters.torque_constant_nm_a,
        POLE_PAIRS: 14,
        GEAR_RATIO: 1.0,
        MAX_CURRENT: parameters.current_limit_a,
        SUPPLY_V: parameters.bus_voltage_v,
        DRIVE_C: parameters.temperature_c,
        ROTOR_C: parameters.temperature_c,
        MST_ID: parameters.node_id + 16,
        ESC_ID: parameters.node_id,
        TIMEOUT: round(parameters.watchdog_s / TIMEOUT_UNIT_S),
        CONTROL_MODE: MIT_MODE,
        SOFTWARE: FIRMWARE,
        SERIAL: int(parameters.serial_number or "0", 16),
        PMAX: model.position_rad,
        VMAX: model.velocity_rad_s,
        TMAX: model.torque_nm,
    }


def encode_value(register: int, value: float) -> bytes:
    return FLOAT.pack(value) if register in FLOATS else WORD.pack(int(value))


def answer_register(values: dict[int, float], stored: dict[int, float], node_id: int, data: bytes) -> bytes:
    """Execute one register frame; return the answer, empty for another drive's and for unknown registers."""
    addressed, kind, register, value = codec.decode_register(data)
    if addressed == node_id and kind == codec.STORE:
        stored.update(values)
        return codec.encode_register(node_id, kind, register, bytes(4))
    if addressed != node_id or register not in values or kind not in (codec.READ, codec.WRITE):
        return b""
    if kind == codec.WRITE and register not in READ_ONLY:
        values[register] = (FLOAT if register in FLOATS else WORD).unpack(value)[0]
    return codec.encode_register(node_id, kind, register, encode_value(register, values[register]))


def write_frame(node_id: int, register: int, value: float) -> Frame:
    return Frame(
        codec.REGISTER_ID, codec.encode_register(node_id, codec.WRITE, register, encode_value(register, value))
    )
