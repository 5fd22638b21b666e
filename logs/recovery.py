"""Rewrites a log whose writer was cut off: every row that can still be read, with index and statistics.

An unfinished MCAP file lacks the summary at its end, without which most readers refuse it. The rows that salvage.py
finds are written again in their own layout, and an event in the rewritten log says how many rows were lost. That
number stands at the beginning of the new log too, so the file is read twice: once to count, once to write.

The damaged file is renamed to NAME.broken; the new one is written, synchronised and renamed; only then is the damaged
one removed. A recovery that is interrupted at any point is continued by the next one.

A file is left as it is where recovery would cost rows that can be read in it, for example after another program has
compressed it again.
"""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from firmware_host.log.log_file import LogFile, lock_file
from firmware_host.log.log_folder import BROKEN, PART, finished_path, move_file, unfinished_files
from firmware_host.log.rows import EVENT_KIND
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.scanned_log import scan_log
from logs.salvage import FileBytes, Salvage, count_readable_rows, salvage_rows

WATCHED_ROWS = 1000  # between two reports of progress


class Recovered(NamedTuple):
    """The result for one file."""

    path: Path  # where the log is now
    rows: int  # in it
    lost: int  # rows in damaged places, by their sequence numbers, and of other programs
    note: str  # a message for people


def recover_all(folder: Path, complain: Callable[[str], None]) -> list[Recovered]:
    """Recovers every unfinished log of a log folder, except those of living writers; complains of each failure."""
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
    """Raises LogError, and OSError; BlockingIOError where the log's writer lives."""
    with path.open("rb") as file:
        lock_file(file.fileno(), path)
        if path.name.endswith(PART):
            path.unlink()
            return Recovered(path, 0, 0, "an interrupted recovery, removed")
        target = finished_path(path.with_name(path.name.removesuffix(BROKEN)))
        contents = FileBytes(file)
        if not contents.size:
            path.unlink()
            return Recovered(path, 0, 0, "empty, removed")
        if target != path and _is_whole(target):
            if _count_rows(target) < count_readable_rows(contents):
                raise LogError(f"{path}: left as it is: {target} has its name and fewer rows; rename one of them")
            path.unlink()
            return Recovered(target, 0, 0, "was recovered before")
        if contents.ends_as_mcap and _is_whole(path, watch):
            if target != path:  # its writer ended between its last byte and the renaming
                move_file(path, target)
            return Recovered(target, 0, 0, "is whole")
        salvage = salvage_rows(path, contents, watch)
        _require_gain(path, salvage, contents)
        return _rewrite(path, target, contents, salvage, watch)


def _count_rows(path: Path) -> int:
    with path.open("rb") as file:
        return count_readable_rows(FileBytes(file))


def _is_whole(path: Path, watch: Watch = unwatched) -> bool:
    with suppress(LogError):
        return scan_log(path, watch).complete
    return False


def _require_gain(path: Path, salvage: Salvage, contents: FileBytes) -> None:
    """Raises LogError where a plain reading of the file finds more rows than the recovery."""
    readable = count_readable_rows(contents)
    if salvage.rows < readable:
        reason = f"only {salvage.rows} of the {readable} rows that can be read in it would be recovered"
        raise LogError(f"{path}: left as it is: {reason}; another program has changed it")


def _rewrite(path: Path, target: Path, contents: FileBytes, salvage: Salvage, watch: Watch) -> Recovered:
    """Raises OSError, and LogError for a file that was changed meanwhile, which stays as NAME.broken."""
    broken = path if path.name.endswith(BROKEN) else path.with_name(path.name + BROKEN)
    path.rename(broken)
    part = broken.with_name(target.name + PART)
    part.unlink(missing_ok=True)
    lost, note = salvage.lost + salvage.foreign, _note_of(salvage)
    opening = {
        "configuration_text": salvage.configuration_text,
        "metadata": salvage.metadata | {"recovered": "true", "rows_lost": str(lost)},
        "wall_minus_monotonic_ns": salvage.wall_offset_ns,
    }
    event = salvage.kinds[EVENT_KIND].encode_named(stamp_s=salvage.last_stamp_s, text=note)
    log = LogFile(part, opening, salvage.kinds)
    try:
        if _write_rows(log, Salvage(contents), salvage.rows, watch) != salvage.rows:
            raise LogError(f"{broken}: was changed while it was read: nothing was recovered and it stays as it is")
        log.write([(EVENT_KIND, event)])
        log.finish()
    except (OSError, LogError):
        log.abandon()
        part.unlink(missing_ok=True)
        raise
    move_file(part, target)
    broken.unlink()
    return Recovered(target, salvage.rows, lost, note)


def _write_rows(log: LogFile, salvage: Salvage, total: int, watch: Watch) -> int:
    """Returns the number of rows written. Raises OSError."""
    rows = salvage.found_rows()
    while part := list(islice(rows, WATCHED_ROWS)):
        log.write(part)
        watch("rows written", salvage.rows, total)
    return salvage.rows


def _note_of(salvage: Salvage) -> str:
    parts = [f"recovered: {salvage.rows} rows"]
    parts += [f", {salvage.lost} lost in damaged places"] * bool(salvage.lost)
    parts += [f", {salvage.foreign} of other programs left out"] * bool(salvage.foreign)
    parts += ["; the rows after the last of them are missing"] * (not salvage.ended)
    return "".join(parts)


def main() -> None:
    """Recovers the unfinished logs of one folder, at low priority; the log's writer starts this as a process."""
    with suppress(PermissionError):
        os.nice(5)
    folder = Path(sys.argv[1])

    def complain(message: str) -> None:
        print(message, file=sys.stderr, flush=True)

    for recovered in recover_all(folder, complain):
        complain(f"{recovered.path}: {recovered.note}")


if __name__ == "__main__":
    main()
