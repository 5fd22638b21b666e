"""Lists what may pass the transmit gate for one ODrive: the messages that this program uses, with their payloads only.

Idle, torque mode, the configured limits and the clearing of errors may always leave, and so may the reading of any
parameter. Closed loop may be asked for only while the gate is open.
"""

from math import nan

from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, MalformedMessageError, Message, arbitration_id
from drivers.odrive.parameters import OdriveParameters
from drivers.transmit_gate import GateTable

READ_BYTES = 4  # of a request to read a parameter


def gate_table(drive: OdriveParameters) -> GateTable:
    always: dict[Message, bytes] = {
        codec.SET_LIMITS: codec.SET_LIMITS.encode(drive.velocity_limit_turn_s, drive.current_limit_a),
        codec.SET_VEL_GAINS: codec.SET_VEL_GAINS.encode(drive.velocity_gain_nm_s_turn, 0.0),
        codec.SET_AXIS_STATE: codec.SET_AXIS_STATE.encode(AxisState.IDLE),
        codec.SET_CONTROLLER_MODE: codec.SET_CONTROLLER_MODE.encode(codec.TORQUE_CONTROL, codec.PASSTHROUGH),
        codec.CLEAR_ERRORS: codec.CLEAR_ERRORS.encode(0),  # without blinking
    }
    closed_loop = codec.SET_AXIS_STATE.encode(AxisState.CLOSED_LOOP)
    return GateTable(
        node_id=drive.node_id,
        torque_id=arbitration_id(drive.node_id, codec.SET_INPUT_TORQUE),
        zero_torque=codec.SET_INPUT_TORQUE.encode(0.0),
        decode_torque=_decode_torque,
        always={arbitration_id(drive.node_id, message): frozenset({data}) for message, data in always.items()},
        while_open={arbitration_id(drive.node_id, codec.SET_AXIS_STATE): frozenset({closed_loop})},
        checks={arbitration_id(drive.node_id, codec.RX_SDO): _reads_parameter},
        requests=frozenset(
            Frame(arbitration_id(drive.node_id, message), is_remote=True)
            for message in (codec.GET_VERSION, codec.ADDRESS)
        ),
    )


def _decode_torque(data: bytes) -> float:
    try:
        (torque_nm,) = codec.SET_INPUT_TORQUE.decode(data)
    except MalformedMessageError:
        return nan
    return float(torque_nm)


def _reads_parameter(data: bytes) -> bool:
    """Returns whether a payload reads a parameter: opcode and reserved byte are zero, and no value follows to write."""
    return len(data) == READ_BYTES and data[0] == codec.SDO_READ and data[3] == 0
