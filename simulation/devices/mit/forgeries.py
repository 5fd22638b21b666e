"""Forges frames that a bus carries in the name of a drive in MIT mode, or to it."""

from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.settings import SERIAL, SOFTWARE, TIMEOUT, TMAX
from simulation.devices.drive import Forgery
from simulation.devices.mit.registers import encode_value, write_frame

FORGED_COMMANDS = {Forgery.EMERGENCY_STOP: codec.LEAVE, Forgery.CLOSE_LOOP: codec.ENTER}
FORGED_WRITES = {Forgery.OTHER_SETTING: (TMAX, 3.0)}
FORGED_ANSWERS = {  # a drive that starts has no firmware version yet
    Forgery.OLD_FIRMWARE: (SOFTWARE, 0.0),
    Forgery.STARTING: (SOFTWARE, 0.0),
    Forgery.WATCHDOG_OFF: (TIMEOUT, 0.0),
    Forgery.OTHER_DRIVE: (SERIAL, float(0xABCDEF)),
}


def forged_frame(node_id: int, feedback_id: int, forgery: Forgery) -> Frame:
    if forgery in FORGED_COMMANDS:
        return Frame(node_id, FORGED_COMMANDS[forgery])
    if forgery in FORGED_WRITES:
        return write_frame(node_id, *FORGED_WRITES[forgery])
    register, value = FORGED_ANSWERS[forgery]
    return Frame(feedback_id, codec.encode_register(node_id, codec.READ, register, encode_value(register, value)))
