"""Makes the frames of a simulated moteus, and forges those that a bus carries in its name, or to it, besides them."""

from control.records import NEVER_S
from drivers.can.frames import STANDARD_MASK, Frame
from drivers.moteus import codec, registers
from drivers.moteus.registers import Register
from drivers.moteus.settings import MAX_CURRENT, WATCHDOG
from simulation.devices.drive import Forgery


def _console_input(text: str) -> bytes:
    return registers.padded(registers.encode_console(registers.CONSOLE_INPUT, text.encode()))


FORGED_COMMANDS = {
    Forgery.EMERGENCY_STOP: codec.STOP_AND_QUERY,
    Forgery.CLOSE_LOOP: codec.encode_torque(0.0),
    Forgery.WATCHDOG_OFF: _console_input(f"conf set {WATCHDOG} nan\n"),
    Forgery.OTHER_SETTING: _console_input(f"conf set {MAX_CURRENT} 3\n"),
}
FORGED_REGISTERS = {
    Forgery.OLD_FIRMWARE: (Register.REGISTER_MAP, [4.0]),
    Forgery.OTHER_DRIVE: (Register.SERIAL_NUMBER, [0.0, 0.0, float(0xABCDEF)]),
    Forgery.STARTING: (Register.REGISTER_MAP, [0.0]),
}


def command_frame(node_id: int, data: bytes) -> Frame:
    return Frame(codec.command_id(node_id), data, is_extended=True, is_fd=True, bit_rate_switch=True)


def answer_frame(node_id: int, data: bytes, stamp_s: float = NEVER_S) -> Frame:
    identifier = codec.reply_id(node_id)
    return Frame(identifier, data, False, False, identifier > STANDARD_MASK, stamp_s, True, True)


def forged_frame(node_id: int, forgery: Forgery) -> Frame:
    if forgery in FORGED_COMMANDS:
        return command_frame(node_id, FORGED_COMMANDS[forgery])
    register, values = FORGED_REGISTERS[forgery]
    data = registers.encode_values(registers.REPLY, registers.Resolution.INT32, register, values)
    return answer_frame(node_id, registers.padded(data))
