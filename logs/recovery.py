"""Rewrites a log whose writer was cut off: every row that can still be read, with index and statistics.

An unfinished MCAP file lacks the summary at its end, without which most readers refuse it. A pass that salvages
(file_pass.py) reads its records one after the other. A chunk whose checksum does not fit is skipped by its length, and
its rows are lost; where a length itself is damaged, the reading ends. The rows keep the layout that the file describes;
where the description is lost, they are taken to have that of this version. An event in the rewritten log says how many
rows were lost, and so does the metadata at its beginning, so the file is read once to count, and once to write.

The damaged file is renamed to NAME.broken; the new one is written, synchronised and renamed; only then is the damaged
one removed. A recovery that is interrupted at any point is repeated by the next one, from the damaged file; what it had
written, NAME.part, is recovered only where that file is gone.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice
from math import isfinite
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from firmware_host.log.log_file import LogFile, lock_file
from firmware_host.log.log_folder import BROKEN, ENDING, PART, finished_path, move_file, unfinished_files
from firmware_host.log.rows import EVENT_KIND, ROW_KINDS
from firmware_host.log.schema import LayoutError
from logs.files.file_pass import OTHER_VERSION, FilePass
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.log_summary import wall_offset_ns
from logs.files.scanned_log import scan_log

WATCHED_ROWS = 1000  # between two reports of progress


class Recovered(NamedTuple):
    """The result for one file."""

    path: Path  # where the log is now
    rows: int  # in it
    lost: int  # rows in damaged chunks, by their sequence numbers, and of other programs
    note: str  # a message for people


class Salvage:
    """One pass over a damaged file, which counts the rows that it yields and those that are lost."""

    def __init__(self, file: BinaryIO) -> None:
        self.found = FilePass(Path(file.name), salvages=True)
        self.rows = self.foreign = 0  # yielded; of unknown topics
        self.wall_offset_ns = 0  # by the first row with a time
        self.last_stamp_s = 0.0  # of the last one
        self._file = file
        self._expected = [0] * len(ROW_KINDS)  # sequence number after the largest one found
        self._found = [0] * len(ROW_KINDS)

    @property
    def lost(self) -> int:
        """Rows whose numbers are missing before the last one found."""
        return sum(max(0, expected - found) for expected, found in zip(self._expected, self._found, strict=True))

    @property
    def note(self) -> str:
        parts = [f"recovered: {self.rows} rows"]
        parts += [f", {self.lost} lost in damaged places"] * bool(self.lost)
        parts += [f", {self.foreign} of other programs left out"] * bool(self.foreign)
        parts += ["; the rows after the last of them are missing"] * (not self.found.complete)
        return "".join(parts)

    def found_rows(self, watch: Watch = unwatched) -> Iterator[tuple[int, bytes]]:
        """Make the pass: yield the number of its kind and the bytes of every row. Raises LayoutError, OSError."""
        for number, messages in self.found.rows(self._file, watch):
            if number is None:
                self.foreign += len(messages)
                continue
            kind = self.found.kinds[number]
            for message in messages:
                row = message["row"].tobytes()
                if kind.fits(row):
                    self._count(number, message, kind.stamp_s(row))
                    yield number, row

    def _count(self, number: int, message: np.void, stamp_s: float) -> None:
        if isfinite(stamp_s):
            self.wall_offset_ns = self.wall_offset_ns or int(message["log_time_ns"]) - round(stamp_s * 1e9)
            self.last_stamp_s = stamp_s
        self._expected[number] = max(self._expected[number], int(message["sequence"]) + 1)
        self._found[number] += 1
        self.rows += 1


def salvage_rows(path: Path, file: BinaryIO, watch: Watch = unwatched) -> Salvage:
    """Find every row of a file, and count them; `found_rows` of a new Salvage yields them again.

    Raises OSError, and LogError for a file that never was one of our logs, or that this version cannot decode.
    """
    salvage = Salvage(file)
    try:
        for _ in salvage.found_rows(watch):
            pass
    except LayoutError as error:
        raise LogError(f"{path}: left as it is: {error}; {OTHER_VERSION}") from None
    if not salvage.rows and not salvage.found.metadata:
        raise LogError(f"{path}: left as it is: nothing of a log can be found in it")
    return salvage


def recover_all(folder: Path, complain: Callable[[str], None]) -> list[Recovered]:
    """Recover every unfinished log of a log folder, except those of living writers; complain of each failure."""
    recovered = []
    for path in unfinished_files(folder):
        try:
            recovered.append(recover_log(path))
        except (BlockingIOError, FileNotFoundError):
            continue  # being written, or finished meanwhile
        except LogError as problem:
            complain(str(problem))
        except OSError as problem:
            complain(f"{path}: cannot be recovered: {problem.strerror or problem}")
    return recovered


def recover_log(path: Path, watch: Watch = unwatched) -> Recovered:
    """Recover one file. Raises LogError, and OSError; BlockingIOError where the log's writer lives."""
    with path.open("rb") as file:
        lock_file(file.fileno(), path)
        if ENDING in path.name and not path.stat().st_size:
            path.unlink()
            return Recovered(path, 0, 0, "empty, removed")
        is_part = path.name.endswith(f"{ENDING}{PART}")
        target = finished_path(path.with_name(path.name.removesuffix(PART if is_part else BROKEN)))
        if is_part and (source := path.with_name(target.name + BROKEN)).exists():
            raise LogError(f"{path}: left as it is: an interrupted recovery of {source}; recover that one")
        present_rows = _rows_of_whole(target) if target != path else None
        if (own_rows := _rows_of_whole(path, watch)) is not None and present_rows is None:
            if target != path:  # its writer ended between its last byte and the renaming
                _require_free(path, target)
                move_file(path, target)
            return Recovered(target, 0, 0, "is whole")
        salvage = salvage_rows(path, file, watch)
        if present_rows is not None:
            if present_rows < max(salvage.rows, own_rows or 0):
                raise LogError(f"{path}: left as it is: {target} has its name and fewer rows; rename one of them")
            path.unlink()
            return Recovered(target, 0, 0, "was recovered before")
        return _rewrite(path, target, file, salvage, watch)


def _rows_of_whole(path: Path, watch: Watch = unwatched) -> int | None:
    """Return the number of rows of a finished log that can be read; None for any other file."""
    with suppress(LogError):
        log = scan_log(path, watch)
        return log.rows + len(log.strides) + len(log.events) if log.complete else None
    return None


def _require_free(path: Path, *names: Path) -> None:
    """Raise LogError where a recovery would overwrite another log, which may have more rows."""
    for name in names:
        if name != path and name.exists():
            raise LogError(f"{path}: left as it is: {name} is another log; rename one of them")


def _rewrite(path: Path, target: Path, file: BinaryIO, salvage: Salvage, watch: Watch) -> Recovered:
    """Raises OSError, and LogError for a file that was changed meanwhile, which stays as NAME.broken."""
    broken = path.with_name(target.name + BROKEN)
    _require_free(path, broken, target)
    path.rename(broken)
    part = broken.with_name(target.name + PART)
    part.unlink(missing_ok=True)
    lost = salvage.lost + salvage.foreign
    found, kinds = salvage.found, [salvage.found.kinds[number] for number in range(len(ROW_KINDS))]
    opening = {
        "configuration_text": found.configuration_text,
        "metadata": found.metadata | {"recovered": "true", "rows_lost": str(lost)},
        "wall_minus_monotonic_ns": wall_offset_ns(found.metadata) or salvage.wall_offset_ns,
    }
    event = kinds[EVENT_KIND].encode_named(stamp_s=salvage.last_stamp_s, text=salvage.note)
    log = LogFile(part, opening, kinds)
    try:
        again = Salvage(file)
        rows = again.found_rows()
        while piece := list(islice(rows, WATCHED_ROWS)):
            log.write(piece)
            watch("rows written", again.rows, salvage.rows)
        if again.rows != salvage.rows:
            raise LogError(f"{broken}: was changed while it was read: nothing was recovered and it stays as it is")
        log.write([(EVENT_KIND, event)])
        log.finish()
    except (OSError, LogError):
        log.abandon()
        part.unlink(missing_ok=True)
        raise
    move_file(part, target)
    broken.unlink()
    return Recovered(target, salvage.rows, lost, salvage.note)


def main() -> None:
    """Recover the unfinished logs of one folder, at low priority; the log's writer starts this as a process.

    The writer ignores the end of the service, and this inherits it; but a recovery may end in the middle.
    """
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    with suppress(PermissionError):
        os.nice(5)

    def complain(message: str) -> None:
        print(message, file=sys.stderr, flush=True)

    for recovered in recover_all(Path(sys.argv[1]), complain):
        complain(f"{recovered.path}: {recovered.note}")


if __name__ == "__main__":
    main()
