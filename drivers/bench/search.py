"""Searches one bus for drives of every protocol, and compares what answers with what the configuration expects.

The order matters. First it listens. ODrives are then asked by remote frames, which disturb no drive. The questions
of the other protocols are commands to other drives, or frames that they take for errors, so they are sent only where no
drive of an earlier protocol has answered, or where a user asks for them by name.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import DriveBench
from drivers.bench.drive_setup import FoundDrive
from drivers.drive import DriveParameters

LISTENING_S = 1.1  # heartbeats may be a second apart


class SearchResult(NamedTuple):
    """The drives of one bus."""

    found: tuple[FoundDrive, ...]
    not_asked: Mapping[str, str]  # by protocol: why it was not asked for
    error_frames: int  # on the bus meanwhile
    send_problem: str = ""


def search(
    port: BenchPort,
    benches: Mapping[str, DriveBench],
    carries_fd: bool,
    chosen: Collection[str] = (),
    show: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> SearchResult:
    """Ask in the order of `benches`; protocols that are `chosen` alone, and then also next to others."""
    found: list[FoundDrive] = []
    not_asked: dict[str, str] = {}
    asked = {name: bench for name, bench in benches.items() if name in chosen or not chosen}
    show("steps of the search", 0, 1 + len(asked))
    errors_before, heard = port.error_frames, port.listen(LISTENING_S)
    for step, (name, bench) in enumerate(asked.items(), 1):
        show("steps of the search", step, 1 + len(asked))
        reason = _why_not_asked(bench, carries_fd, [] if chosen else found)
        if reason:
            not_asked[name] = reason
        else:
            found += bench.find(port, bench.ids_heard(heard))
    return SearchResult(tuple(found), not_asked, port.error_frames - errors_before, port.send_problem)


def _why_not_asked(bench: DriveBench, carries_fd: bool, others: Sequence[FoundDrive]) -> str:
    if bench.is_fd and not carries_fd:
        return "the bus is configured without CAN FD"
    if others and bench.disturbs:
        return f"{bench.disturbs}, and a drive of type {others[0].type} answers"
    return ""


def drive_problems(found: Sequence[FoundDrive]) -> Iterator[str]:
    """Yield what the drives say against their use."""
    for each in found:
        if problem := each.problem or each.model_problem:
            yield f"id {each.node_id} ({each.type}): {problem}"


def id_problems(found: Sequence[FoundDrive]) -> Iterator[str]:
    """Yield the ids that answer twice, or in two protocols."""
    for (node_id, name), count in sorted(Counter((each.node_id, each.type) for each in found).items()):
        if count > 1:
            numbers = ", ".join(each.serial_number or "?" for each in found if (node_id, name) == each[1::-1])
            yield f"id {node_id} answers {count} times ({name}, serial numbers {numbers}): give each drive its own id"
    for node_id in sorted({each.node_id for each in found}):
        names = sorted({each.type for each in found if each.node_id == node_id})
        if len(names) > 1:
            yield f"id {node_id} answers as {' and as '.join(names)}: give each drive its own id, or its own bus"


def expectation_problems(found: Sequence[FoundDrive], expected: Mapping[str, DriveParameters]) -> Iterator[str]:
    """Yield the joints on this bus whose drive was not found, or not as configured."""
    for joint, drive in expected.items():
        same_id = [each for each in found if each.node_id == drive.node_id]
        numbers = [each.serial_number for each in same_id if each.type == drive.type]
        key = f"drive.{joint}: type {drive.type}, id {drive.node_id}"
        if not same_id:
            yield f"{key}: nothing answers under this id; check its power, wiring and id"
        elif not numbers:
            yield f"{key}: a drive of type {same_id[0].type} answers; correct type, node_id or bus"
        elif drive.serial_number and drive.serial_number not in numbers:
            yield f"{key}: its serial number is {numbers[0] or 'not known'}, not {drive.serial_number}"
