"""Lists what may pass the transmit gate for one moteus: the payloads that this program uses, and no others.

All go to one arbitration id. A stop, the questions for signals and settings and the polls of the console may always
leave; nothing else is ever written to the console. A torque command also lets the drive follow torque, so none may
leave while the gate is closed, zero neither: the question for signals takes its place.
"""

from drivers.moteus import codec
from drivers.moteus.parameters import MoteusParameters
from drivers.moteus.settings import IDENTITY, POLL, QUESTIONS
from drivers.transmit_gate import FrameKind, GateTable

QUERIES = (codec.QUERY_ALONE, codec.STOP_AND_QUERY, codec.POWER_QUERY, IDENTITY, POLL, *QUESTIONS)
KIND = FrameKind(is_extended=True, is_fd=True, bit_rate_switch=True)


def gate_table(drive: MoteusParameters) -> GateTable:
    identifier = codec.command_id(drive.node_id)
    return GateTable(
        node_id=drive.node_id,
        torque_id=identifier,
        zero_torque=codec.encode_torque(0.0),
        decode_torque=codec.decode_torque,
        always={identifier: frozenset(QUERIES)},
        questions=frozenset({codec.POWER_QUERY}),
        kind=KIND,
        idle=codec.QUERY_ALONE,
    )
