"""Finds ODrives: by remote frames that ask every id for its version and serial number, and by their heartbeats.

A remote frame carries no data, so no drive takes it for a command. Firmware 0.5 has no version message and ignores the
request; it would take the request for a serial number for a new id, so only drives that report firmware 0.6.9 or newer
get that one. Id 63 is that of a board without an id yet (firmware 0.6.9). Source: ODrive's CANSimple documentation, and
examples/can_enumerate.py of odriverobotics/ODriveResources.

Firmware 0.5 alone reports counts of its encoder. Only ids with a heartbeat are asked for them: with node id 0 that
request has the id of a drive in MIT mode.
"""

from collections.abc import Iterable, Sequence
from typing import cast

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import SetupFacts
from drivers.bench.drive_setup import NoSetup
from drivers.bench.found_drive import FoundDrive
from drivers.can.frames import DATA_MAX_BYTES, Frame, MalformedMessageError
from drivers.odrive import codec
from drivers.odrive.codec import Message, arbitration_id
from drivers.odrive.codec05 import GET_ENCODER_COUNT
from drivers.odrive.drive_settings import SUPPORTED
from drivers.odrive.parameters import OdriveParameters
from drivers.odrive.setup import OdriveSetup, build_of_file, build_of_watchdog

NAME, NAME_05 = "odrive", "odrive05"
NO_SETTINGS = "firmware 0.5 has no messages for its settings: use odrivetool over USB, and see docs/how-to/odrive.md"
IDS = range(64)
NO_ID = 63


class OdriveBench:
    """Implements DriveBench."""

    is_fd = False
    disturbs = ""

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        return _ids_with_heartbeat(frames)

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        answers = port.ask_all(_request(node_id, codec.GET_VERSION) for node_id in IDS)
        versions = {each.arbitration_id >> 5: each.data for each in answers if _has_version(each)}
        numbers = self._serial_numbers(
            port, [each for each in versions if _version(versions[each])[4:7] >= codec.FIRST_WITH_ADDRESS]
        )
        return [
            _found(node_id, versions[node_id], number)
            for node_id in sorted(versions)
            for number in sorted(numbers.get(node_id, {""}))
        ]

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> OdriveSetup:
        builds = [*map(build_of_watchdog, facts.endpoints), *map(build_of_file, facts.documents)]
        return OdriveSetup(port, cast(OdriveParameters, facts.parameters), facts.longest_watchdog_s, builds)

    def _serial_numbers(self, port: BenchPort, node_ids: Sequence[int]) -> dict[int, set[str]]:
        numbers: dict[int, set[str]] = {}
        for frame in port.ask_all(_request(node_id, codec.ADDRESS) for node_id in node_ids):
            if _is_message(frame, codec.ADDRESS) and len(frame.data) in (7, 8):
                numbers.setdefault(frame.arbitration_id >> 5, set()).add(codec.decode_serial_number(frame.data))
        return numbers


class Odrive05Bench:
    """Implements DriveBench for firmware 0.5."""

    is_fd = False
    disturbs = ""

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        return _ids_with_heartbeat(frames)

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        versions = port.ask_all(_request(node_id, codec.GET_VERSION) for node_id in sorted(heard))
        old = heard - {each.arbitration_id >> 5 for each in versions if _has_version(each)}
        answers = port.ask_all(_request(node_id, GET_ENCODER_COUNT) for node_id in sorted(old)) if old else []
        known = {each.arbitration_id >> 5 for each in answers if _is_message(each, GET_ENCODER_COUNT)}
        unknown = "it sends a heartbeat, and reports neither a version nor the counts of its encoder"
        return [
            FoundDrive(NAME_05, node_id, firmware="0.5", problem="" if node_id in known else unknown)
            for node_id in sorted(old)
        ]

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> NoSetup:
        return NoSetup(FoundDrive(NAME_05, facts.parameters.node_id, firmware="0.5"), NO_SETTINGS)


def _ids_with_heartbeat(frames: Iterable[Frame]) -> set[int]:
    return {
        frame.arbitration_id >> 5
        for frame in frames
        if _is_message(frame, codec.HEARTBEAT) and len(frame.data) == DATA_MAX_BYTES
    }


def _found(node_id: int, version: bytes, number: str) -> FoundDrive:
    fields = _version(version)
    firmware, hardware = (".".join(map(str, fields[part])) for part in (slice(4, 7), slice(1, 4)))
    problem = "" if fields[4:6] == SUPPORTED else f"firmware {firmware} is not supported: needs 0.6"
    problem = "it has no id yet: set axis0.config.can.node_id" if node_id == NO_ID else problem
    return FoundDrive(NAME, node_id, hardware, firmware, number, problem)


def _request(node_id: int, message: Message) -> Frame:
    return Frame(arbitration_id(node_id, message), is_remote=True)


def _is_message(frame: Frame, message: Message) -> bool:
    return frame.is_plain and frame.arbitration_id & codec.LAST_COMMAND == message.command


def _has_version(frame: Frame) -> bool:
    try:
        return _is_message(frame, codec.GET_VERSION) and bool(_version(frame.data))
    except MalformedMessageError:
        return False


def _version(data: bytes) -> tuple[int, ...]:
    return codec.GET_VERSION.decode(data)
