"""Lists what may pass the transmit gate for one ODrive with firmware 0.5.

The ids by which firmware 0.6 reads parameters and its serial number do nothing in 0.5, or set a new node id.
"""

from drivers.odrive.codec import GET_VERSION
from drivers.odrive.gate_table import cansimple_table
from drivers.odrive05 import codec
from drivers.odrive05.parameters import Odrive05Parameters
from drivers.transmit_gate import GateTable


def gate_table(drive: Odrive05Parameters) -> GateTable:
    clearing = {codec.CLEAR_ERRORS: codec.CLEAR_ERRORS.encode()}
    return cansimple_table(drive, clearing, (GET_VERSION, codec.GET_ENCODER_COUNT))
