"""Lists what may pass the transmit gate for one ODrive with firmware 0.6: the messages that this program uses.

Idle, torque mode, the configured limits and the clearing of errors may always leave, and so may requests to read.
Closed loop may be asked for only while the gate is open. Firmware 0.5 differs in how errors are cleared and settings
are read (drivers/odrive05/gate_table.py).
"""

from collections.abc import Callable, Mapping
from math import nan

from drivers.can.frames import Frame, MalformedMessageError
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from drivers.odrive.parameters import OdriveParameters
from drivers.transmit_gate import GateTable

READ_BYTES = 4  # of a request to read a parameter


def gate_table(drive: OdriveParameters) -> GateTable:
    clearing = {codec.CLEAR_ERRORS: codec.CLEAR_ERRORS.encode(0)}  # without blinking
    return cansimple_table(drive, clearing, (codec.GET_VERSION, codec.ADDRESS), {codec.RX_SDO: _reads_parameter})


def cansimple_table(
    drive: OdriveParameters,
    clearing: Mapping[Message, bytes],
    requests: tuple[Message, ...],
    checks: Mapping[Message, Callable[[bytes], bool]] = {},
) -> GateTable:
    """List what the firmwares have in common, and what one of them adds."""
    always: dict[Message, bytes] = {
        codec.SET_LIMITS: codec.SET_LIMITS.encode(drive.velocity_limit_turn_s, drive.current_limit_a),
        codec.SET_VEL_GAINS: codec.SET_VEL_GAINS.encode(drive.velocity_gain_nm_s_turn, 0.0),
        codec.SET_AXIS_STATE: codec.SET_AXIS_STATE.encode(AxisState.IDLE),
        codec.SET_CONTROLLER_MODE: codec.SET_CONTROLLER_MODE.encode(codec.TORQUE_CONTROL, codec.PASSTHROUGH),
        **clearing,
    }
    closed_loop = codec.SET_AXIS_STATE.encode(AxisState.CLOSED_LOOP)
    return GateTable(
        node_id=drive.node_id,
        torque_id=arbitration_id(drive.node_id, codec.SET_INPUT_TORQUE),
        zero_torque=codec.SET_INPUT_TORQUE.encode(0.0),
        decode_torque=_decode_torque,
        always={arbitration_id(drive.node_id, message): frozenset({data}) for message, data in always.items()},
        while_open={arbitration_id(drive.node_id, codec.SET_AXIS_STATE): frozenset({closed_loop})},
        checks={arbitration_id(drive.node_id, message): check for message, check in checks.items()},
        requests=frozenset(
            Frame(arbitration_id(drive.node_id, message), is_remote=True)
            for message in (*requests, codec.GET_BUS_VOLTAGE_CURRENT)
        ),
    )


def _decode_torque(data: bytes) -> float:
    try:
        (torque_nm,) = codec.SET_INPUT_TORQUE.decode(data)
    except MalformedMessageError:
        return nan
    return float(torque_nm)


def _reads_parameter(data: bytes) -> bool:
    """Return whether a payload reads a parameter: opcode and reserved byte are zero, and no value follows to write."""
    return len(data) == READ_BYTES and data[0] == codec.SDO_READ and data[3] == 0
