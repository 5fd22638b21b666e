"""Finds moteus drives: by reading the registers of their identity at every id, which no drive takes for a command.

On a bus with drives of classic CAN, frames of CAN FD are errors. Source: docs/protocol/can.md and registers.md of
mjbots/moteus.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import FoundDrive
from drivers.can.frames import Frame, MalformedMessageError
from drivers.moteus import codec, registers
from drivers.moteus.parameters import LARGEST_ID, SMALLEST_ID, MoteusParameters
from drivers.moteus.registers import Register
from drivers.moteus.settings import IDENTITY, REGISTER_MAP, MoteusSettings

NAME = "moteus"


class MoteusBench:
    """Implements DriveBench."""

    is_fd = True
    disturbs = "drives of classic CAN take its CAN FD frames for errors"

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        """A moteus sends nothing by itself."""
        return set()

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        answers = port.ask_all(request(node_id, IDENTITY) for node_id in range(SMALLEST_ID, LARGEST_ID + 1))
        found = (_found(frame) for frame in answers if _is_reply(frame))
        return sorted({each for each in found if each is not None}, key=lambda each: (each.node_id, each.serial_number))


def request(node_id: int, data: bytes) -> Frame:
    return Frame(codec.command_id(node_id), data, is_extended=True, is_fd=True, bit_rate_switch=True)


def _is_reply(frame: Frame) -> bool:
    source, destination = frame.arbitration_id >> 8, frame.arbitration_id & 0xFF
    return frame.is_fd and not frame.is_error and destination == codec.HOST and SMALLEST_ID <= source <= LARGEST_ID


def _found(frame: Frame) -> FoundDrive | None:
    """Returns None for an answer to another question."""
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
