"""Finds drives in MIT mode: by the command to leave it, which ends torque, and by the registers of a Damiao.

There is no question that is no command. Leaving the mode is the only one that cannot exert torque, and every drive
answers it. To an ODrive of id 0 these frames are its commands 1 to 15 (an emergency stop among them), and the id of
the registers, 0x7FF, is that by which all ODrives enter their boot loader: they must not be sent where one listens.
Sources: see codec.py; ODrive's CANSimple documentation.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from struct import Struct

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import FoundDrive
from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.models import MODELS
from drivers.mit.parameters import LARGEST_ID
from drivers.mit.settings import FLOAT, FLOATS, PMAX, SAME_FRACTION, SERIAL, SOFTWARE, TMAX, VMAX, WORD

NAME = "mit"
IDS = range(1, LARGEST_ID + 1)
ASKED = (SOFTWARE, SERIAL, PMAX, VMAX, TMAX)
Values = dict[int, set[float]]  # of one id by register: two values where two drives answer


class MitBench:
    """Implements DriveBench."""

    is_fd = False
    disturbs = "ODrives of id 0 take its questions for commands"

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        """These drives send nothing by themselves."""
        return set()

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        answered = _answers(port.ask_all(Frame(node_id, codec.LEAVE) for node_id in IDS))
        registers = self._read_registers(port, answered)
        return [
            each
            for node_id, ids in sorted(answered.items())
            for each in _found(node_id, ids, registers.get(node_id, {}))
        ]

    def _read_registers(self, port: BenchPort, node_ids: Iterable[int]) -> dict[int, Values]:
        questions = (
            Frame(codec.REGISTER_ID, codec.encode_read(node_id, register)) for node_id in node_ids for register in ASKED
        )
        found: dict[int, Values] = {}
        for frame in port.ask_all(questions):
            node_id = frame.data[0] & LARGEST_ID if frame.data else 0
            if _may_answer(frame, node_id) and codec.is_register_answer(frame.data, node_id):
                _, _, register, value = codec.decode_register(frame.data)
                found.setdefault(node_id, {}).setdefault(register, set()).add(number_of(register, value))
        return found


def number_of(register: int, value: bytes) -> float:
    layout: Struct = FLOAT if register in FLOATS else WORD
    return float(layout.unpack(value)[0])


def _answers(frames: Iterable[Frame]) -> dict[int, list[int]]:
    """Returns the ids of the answers by the id of the drive that gave them."""
    found: dict[int, list[int]] = {}
    for frame in frames:
        node_id = frame.data[0] & LARGEST_ID if frame.data else 0
        if _may_answer(frame, node_id) and not codec.is_register_answer(frame.data, node_id):
            found.setdefault(node_id, []).append(frame.arbitration_id)
    return found


def _may_answer(frame: Frame, node_id: int) -> bool:
    """Drives answer under their own id, under that plus 16 as the set-up page says, or under 0 as delivered."""
    usual = not (frame.is_fd or frame.is_extended or frame.is_remote or frame.is_error)
    return usual and len(frame.data) == codec.ANSWER_BYTES and frame.arbitration_id in (0, node_id, node_id + 16)


def _found(node_id: int, ids: Sequence[int], values: Values) -> Iterator[FoundDrive]:
    """Yields one drive for each answer to one question; a Damiao has registers, a CubeMars none."""
    if not values:
        for _ in ids:
            yield FoundDrive(NAME, node_id, "a CubeMars, or firmware without registers")
        return
    models = _models({register: min(found) for register, found in values.items()})
    firmware = ", ".join(f"{each:.0f}" for each in sorted(values.get(SOFTWARE, ())))
    problem = "" if models else "its ranges PMAX, VMAX and TMAX are those of no model in docs/how-to/mit.md"
    if any(each != node_id + 16 for each in ids):
        problem = f"it answers under id {min(ids)}: set MST_ID (register 7) to {node_id + 16}"
    numbers = [f"{int(each):08x}" for each in sorted(values.get(SERIAL, ()))] or [""]
    for number in numbers if len(numbers) > 1 else numbers * len(ids):
        yield FoundDrive(NAME, node_id, " or ".join(models), firmware, number, problem)


def _models(values: Mapping[int, float]) -> list[str]:
    """Returns the models with registers that are delivered with these ranges."""
    found = [values.get(register, 0.0) for register in (PMAX, VMAX, TMAX)]
    return [
        name
        for name, model in MODELS.items()
        if model.has_registers
        and all(
            abs(each - expected) <= SAME_FRACTION * expected for each, expected in zip(found, model[:3], strict=True)
        )
    ]
