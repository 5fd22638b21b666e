"""The registers by which a moteus says what it is."""

from contextlib import suppress

from drivers.bench.found_drive import FoundDrive
from drivers.can.frames import Frame, MalformedMessageError
from drivers.moteus import codec, registers
from drivers.moteus.parameters import LARGEST_ID, SMALLEST_ID, MoteusParameters
from drivers.moteus.registers import Register
from drivers.moteus.settings import REGISTER_MAP, MoteusSettings

NAME = "moteus"


def request(node_id: int, data: bytes) -> Frame:
    return Frame(codec.command_id(node_id), data, is_extended=True, is_fd=True, bit_rate_switch=True)


def is_reply(frame: Frame) -> bool:
    source, destination = frame.arbitration_id >> 8, frame.arbitration_id & 0xFF
    return frame.is_fd and not frame.is_error and destination == codec.HOST and SMALLEST_ID <= source <= LARGEST_ID


def found_drive(frame: Frame) -> FoundDrive | None:
    """Returns the drive that answers; None for an answer to another question."""
    node_id = frame.arbitration_id >> 8
    with suppress(MalformedMessageError):
        values = registers.replied_values(registers.decode_frame(frame.data))
        settings = MoteusSettings(MoteusParameters("", node_id))
        settings.on_registers(values)
        if settings.firmware:
            known = settings.supported
            problem = "" if known else f"register map {values[Register.REGISTER_MAP]:.0f}: needs {REGISTER_MAP}"
            model = f"model {values.get(Register.MODEL, 0.0):.0f}"
            return FoundDrive(NAME, node_id, model, settings.firmware, settings.serial_number, problem)
    return None
