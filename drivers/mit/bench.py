"""Finds drives in MIT mode: by the state request and the registers of a Damiao, and by the command to leave the mode.
A RobStride is known by the id under which it answers, unless that is 0.

A Damiao answers a request that is no command, so what another program does with it goes on. Every other drive, and old
firmware of a Damiao, answers commands alone. Leaving the mode, which ends torque, is the only one that cannot exert it.
To an ODrive of id 0 these frames are its commands 1 to 15 (an emergency stop among them), and the id of the registers,
0x7FF, is the command to node 63 to enter the boot loader, and node 63 may mean all ODrives (their tools reboot all by
it): they must not be sent where one listens. 0x7FF also addresses all moteus, to which the state request writes a mode.
Sources: see codec.py; ODrive's CANSimple documentation; fdcan_micro_server.h and moteus_controller.cc of mjbots/moteus.
"""

from collections.abc import Iterable, Iterator, Sequence

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import DriveBench, SetupFacts
from drivers.bench.drive_setup import DriveSetup, FoundDrive, NoSetup
from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.parameters import LARGEST_ID
from drivers.mit.settings import PMAX, SERIAL, SOFTWARE, TMAX, VMAX, number_of
from drivers.mit.setup import NOTHING, DamiaoSetup, is_answer, is_register, models_of, node_of

NAME = "mit"
IDS = range(1, LARGEST_ID + 1)
ASKED = (SOFTWARE, SERIAL, PMAX, VMAX, TMAX)
ROBSTRIDE, UNKNOWN = "a RobStride", "a CubeMars, or firmware without registers"
OTHER_REPORT = 0x29  # in the upper bits of an extended id, above the drive's: a CubeMars that speaks another protocol
OTHER_HARDWARE = "a CubeMars V3, or one in servo mode"
OTHER_PROBLEM = "it reports by extended ids (0x29xx), another protocol, which is not supported: see docs/how-to/mit.md"
OTHER_RANGES = "its ranges PMAX, VMAX and TMAX are those of no model in docs/how-to/mit.md"
Values = dict[int, set[float]]  # of one id by register: two values where two drives answer


class MitBench(DriveBench):
    disturbs = "ODrives of id 0 and moteus take its questions for commands"

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        """Return the ids of CubeMars drives that report in another protocol; one in MIT mode only answers."""
        extended = (frame.arbitration_id for frame in frames if frame.is_extended and not frame.is_fd)
        return {identifier & 0xFF for identifier in extended if identifier >> 8 == OTHER_REPORT}

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        answered = _answers(port.ask_all(codec.state_request(node_id) for node_id in IDS))
        silent = [node_id for node_id in IDS if node_id not in answered]
        answered |= _answers(port.ask_all(Frame(node_id, codec.LEAVE) for node_id in silent))
        registers = _read_registers(port, answered)
        others = sorted(heard - answered.keys())
        return [
            *(
                each
                for node_id, ids in sorted(answered.items())
                for each in _found(node_id, ids, registers.get(node_id, {}))
            ),
            *(FoundDrive(NAME, node_id, OTHER_HARDWARE, problem=OTHER_PROBLEM) for node_id in others),
        ]

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> DriveSetup:
        parameters = facts.parameters
        if parameters.ranges.has_registers:
            return DamiaoSetup(port, parameters, facts.longest_watchdog_s)
        return NoSetup(FoundDrive(NAME, parameters.node_id, parameters.model), NOTHING)


def _answers(frames: Iterable[Frame]) -> dict[int, list[int]]:
    """Return the ids of the answers, by the id of the drive that gave them."""
    answered: dict[int, list[int]] = {}
    for frame in frames:
        node_id = node_of(frame)
        if is_answer(frame, node_id) and not is_register(frame, node_id):
            answered.setdefault(node_id, []).append(frame.arbitration_id)
    return answered


def _read_registers(port: BenchPort, node_ids: Iterable[int]) -> dict[int, Values]:
    questions = (
        Frame(codec.REGISTER_ID, codec.encode_read(node_id, register)) for node_id in node_ids for register in ASKED
    )
    found: dict[int, Values] = {}
    for frame in port.ask_all(questions):
        node_id = node_of(frame)
        if is_answer(frame, node_id) and is_register(frame, node_id):
            _, _, register, value = codec.decode_register(frame.data)
            found.setdefault(node_id, {}).setdefault(register, set()).add(number_of(register, value))
    return found


def _found(node_id: int, ids: Sequence[int], values: Values) -> Iterator[FoundDrive]:
    """Yield one drive for each answer to one question; a Damiao has registers, a CubeMars none."""
    if not values:
        for each in ids:
            yield FoundDrive(NAME, node_id, ROBSTRIDE if each == codec.ROBSTRIDE_MASTER else UNKNOWN)
        return
    models = models_of({register: min(found) for register, found in values.items()})
    firmware = ", ".join(f"{each:.0f}" for each in sorted(values.get(SOFTWARE, ())))
    other = min((each for each in ids if each != node_id + 16), default=None)
    needed = f"set MST_ID (register 7) to {node_id + 16}, as 'mudskipper drives setup --write' does"
    numbers = [f"{int(each):08x}" for each in sorted(values.get(SERIAL, ()))] or [""]
    for number in numbers if len(numbers) > 1 else numbers * len(ids):
        yield FoundDrive(
            type=NAME,
            node_id=node_id,
            hardware=" or ".join(models),
            firmware=firmware,
            serial_number=number,
            problem="" if other is None else f"it answers under id {other}: {needed}",
            model=next(iter(models), ""),
            model_problem="" if models else OTHER_RANGES,
        )
