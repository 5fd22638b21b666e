"""Finds ODrives with firmware 0.6: by remote frames that ask every id for its version and serial number.

A remote frame carries no data, so no drive takes it for a command. Firmware 0.5 has no version message and ignores the
request; it would take the request for a serial number for a new id, so only drives that report firmware 0.6.9 or newer
get that one. Id 63 is that of a board without an id yet (firmware 0.6.9). Source: ODrive's CANSimple documentation, and
examples/can_enumerate.py of odriverobotics/ODriveResources.
"""

from collections.abc import Iterable, Sequence
from operator import itemgetter

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import DriveBench, SetupFacts
from drivers.bench.drive_setup import FoundDrive
from drivers.can.frames import DATA_MAX_BYTES, Frame
from drivers.odrive import codec
from drivers.odrive.codec import Message, arbitration_id
from drivers.odrive.setup import OdriveSetup, build_of_file, build_of_watchdog, found_drive

IDS = range(64)
NO_ID = 63


class CanSimpleBench(DriveBench):
    """Hears the heartbeats that both firmwares send by themselves."""

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        return set(answers(frames, codec.HEARTBEAT, DATA_MAX_BYTES))


class OdriveBench(CanSimpleBench):
    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        versions = {  # the oldest first: where two drives answer, it may take the next request for a new id
            node_id: sorted({codec.GET_VERSION.decode(frame.data) for frame in frames}, key=itemgetter(slice(4, 7)))
            for node_id, frames in ask(port, IDS, codec.GET_VERSION).items()
        }
        with_number = [node_id for node_id, (each, *_) in versions.items() if each[4:7] >= codec.FIRST_WITH_ADDRESS]
        numbered = ask(port, with_number, codec.ADDRESS)
        found: list[FoundDrive] = []
        for node_id, reported in sorted(versions.items()):
            numbers = {codec.decode_serial_number(frame.data) for frame in numbered.get(node_id, ())}
            with_numbers = [found_drive(node_id, reported[0], number) for number in sorted(numbers)]
            found += with_numbers or [found_drive(node_id, version) for version in reported]
        no_id = "it has no id yet: set axis0.config.can.node_id"
        return [each._replace(problem=no_id) if each.node_id == NO_ID else each for each in found]

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> OdriveSetup:
        builds = [*map(build_of_watchdog, facts.endpoints), *map(build_of_file, facts.documents)]
        return OdriveSetup(port, facts.parameters, facts.longest_watchdog_s, builds)


def ask(port: BenchPort, node_ids: Iterable[int], message: Message) -> dict[int, list[Frame]]:
    """Ask these ids for a message by remote frames; return the answers by id."""
    questions = [Frame(arbitration_id(node_id, message), is_remote=True) for node_id in node_ids]
    least_bytes = 7 if message is codec.ADDRESS else DATA_MAX_BYTES
    return answers(port.ask_all(questions), message, least_bytes)


def answers(frames: Iterable[Frame], message: Message, least_bytes: int) -> dict[int, list[Frame]]:
    """Return the frames that carry a message, by the id of their drive."""
    found: dict[int, list[Frame]] = {}
    for frame in frames:
        is_message = frame.is_plain and frame.arbitration_id & codec.LAST_COMMAND == message.command
        if is_message and len(frame.data) >= least_bytes:
            found.setdefault(frame.arbitration_id >> 5, []).append(frame)
    return found
