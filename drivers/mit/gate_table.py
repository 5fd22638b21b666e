"""Lists what may pass the transmit gate for one drive in MIT mode.

Leaving the mode may always leave, and so may, for a Damiao, clearing errors and reading state and settings, and for a
RobStride, clearing errors and the question for faults; entering only while the gate is open. No other gains than zero,
no new zero position and no register may ever be written. No code is zero torque exactly, so while the gate is closed
not even the nearest one leaves: leaving the mode takes its place.
"""

from drivers.mit import codec
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import REGISTERS, SUPPLY_V
from drivers.transmit_gate import GateTable


def gate_table(drive: MitParameters) -> GateTable:
    ranges, node_id = drive.ranges, drive.node_id
    always, questions = {node_id: frozenset({codec.LEAVE})}, frozenset[bytes]()
    if ranges.reports_faults_apart:
        questions = frozenset({codec.FAULT_QUESTION})
        always = {node_id: questions | {codec.LEAVE, codec.CLEAR}}
    if ranges.has_registers:
        always = {
            node_id: frozenset({codec.LEAVE, codec.CLEAR}),
            codec.REGISTER_ID: frozenset(
                (
                    codec.state_request(node_id).data,
                    *(codec.encode_read(node_id, register) for register in (*REGISTERS, SUPPLY_V)),
                )
            ),
        }
    return GateTable(
        node_id=node_id,
        torque_id=node_id,
        zero_torque=codec.encode_torque(0.0, ranges.torque_nm),
        decode_torque=lambda data: codec.decode_torque(data, ranges.torque_nm),
        always=always,
        while_open={node_id: frozenset({codec.ENTER})},
        questions=questions,
        idle=codec.LEAVE,
        torque_step_nm=drive.torque_step_nm,
    )
