"""Puts a log in order whose writer was cut off: every row that is still there, with index and statistics.

An unfinished MCAP file lacks the summary at its end, without which most readers refuse it. What `log_salvage` finds in
it is written anew, and an event in the rewritten log says how many rows were lost.

The damaged file is set aside as NAME.broken; the new one is written beside the finished ones, brought down to the disk
and renamed; only then does the old one go. Whatever moment this is cut off in, the next run continues.

A file stays untouched where that would cost rows that can be read as it is: chunks that another program compressed
anew, rows in the layout of another version.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from mcap.writer import MCAP0_MAGIC

from firmware_host.log.log_file import LogFile, lock_file
from firmware_host.log.log_folder import BROKEN, PART, finished_path, make_folder, synchronise_folder, unfinished_files
from firmware_host.log.recorder import STAMP
from firmware_host.log.rows import EVENT, EVENT_KIND
from firmware_host.log_reading.log_reader import LogError, Watch, read_log, unwatched
from firmware_host.log_reading.salvage import Salvage, readable_rows, salvage_rows

WATCHED_ROWS = 1000  # between two words on how far it is


class Recovered(NamedTuple):
    """What became of one file."""

    path: Path  # where the log is now
    rows: int  # kept
    lost: int  # rows in damaged places, as far as their numbers tell, or of other programs
    note: str  # in words


def recover_all(folder: Path, say: Callable[[str], None]) -> list[Recovered]:
    """Every unfinished log of a log folder, except those of living writers. `say` hears of those that resist."""
    recovered = []
    for path in unfinished_files(folder):
        try:
            recovered.append(recover_log(path))
        except (BlockingIOError, FileNotFoundError):
            continue  # being written, or finished meanwhile
        except LogError as problem:
            say(str(problem))
        except OSError as problem:
            say(f"{path}: cannot be recovered: {problem.strerror or problem}")
    return recovered


def recover_log(path: Path, watch: Watch = unwatched) -> Recovered:
    """Raises LogError, and OSError; BlockingIOError where its writer lives."""
    with path.open("rb") as file:
        lock_file(file.fileno(), path)
        if path.name.endswith(PART):
            path.unlink()
            return Recovered(path, 0, 0, "a rewriting that was cut off, removed")
        target = finished_path(path.with_name(path.name.removesuffix(BROKEN)))
        contents = file.read()
        if not contents:
            path.unlink()
            return Recovered(path, 0, 0, "empty, removed")
        if target != path and _is_whole(target):
            if readable_rows(target.read_bytes()) < readable_rows(contents):
                raise LogError(f"{path}: left as it is: {target} has its name and fewer rows; rename one of them")
            path.unlink()
            return Recovered(target, 0, 0, "was recovered before")
        if contents.endswith(MCAP0_MAGIC) and _is_whole(path, watch):
            return _finish_move(path, target)
        salvage = salvage_rows(path, contents, watch)
        _require_gain(path, salvage, contents)
        return _rewrite(path, target, salvage, watch)


def _require_gain(path: Path, salvage: Salvage, contents: bytes) -> None:
    """Raises LogError where a plain reading of the file finds more than would be kept."""
    readable = readable_rows(contents)
    if len(salvage.rows) < readable:
        reason = f"only {len(salvage.rows)} of the {readable} rows that can be read in it would be kept"
        raise LogError(f"{path}: left as it is: {reason}; another program has changed it")


def _is_whole(path: Path, watch: Watch = unwatched) -> bool:
    with suppress(LogError):
        return read_log(path, watch).complete
    return False


def _finish_move(path: Path, target: Path) -> Recovered:
    """A whole file whose writer ended between its last byte and the renaming."""
    if target != path:
        make_folder(target.parent)
        path.rename(target)
        synchronise_folder(target.parent)
        synchronise_folder(path.parent)
    return Recovered(target, 0, 0, "is whole")


def _rewrite(path: Path, target: Path, salvage: Salvage, watch: Watch) -> Recovered:
    broken = path if path.name.endswith(BROKEN) else path.with_name(path.name + BROKEN)
    path.rename(broken)
    part = broken.with_name(target.name + PART)
    part.unlink(missing_ok=True)
    lost, note = salvage.lost + salvage.foreign, _note_of(salvage)
    _write_part(part, salvage, lost, note, watch)
    make_folder(target.parent)
    part.rename(target)
    for folder in {target.parent, part.parent}:
        synchronise_folder(folder)
    broken.unlink()
    return Recovered(target, len(salvage.rows), lost, note)


def _write_part(part: Path, salvage: Salvage, lost: int, note: str, watch: Watch) -> None:
    """All or nothing. Raises OSError."""
    opening = {
        "configuration_text": salvage.configuration_text,
        "metadata": salvage.metadata | {"recovered": "true", "rows_lost": str(lost)},
        "wall_minus_monotonic_ns": salvage.wall_offset_ns,
    }
    log = LogFile(part, opening)
    try:
        for place in range(0, len(salvage.rows), WATCHED_ROWS):
            watch("rows written", place, len(salvage.rows))
            log.write(salvage.rows[place : place + WATCHED_ROWS])
        log.write([(EVENT_KIND, EVENT.encode(_last_stamp_s(salvage), note))])
        log.finish()
    except OSError:
        log.abandon()
        part.unlink(missing_ok=True)
        raise


def _note_of(salvage: Salvage) -> str:
    parts = [f"recovered: {len(salvage.rows)} rows kept"]
    parts += [f", {salvage.lost} lost in damaged places"] * bool(salvage.lost)
    parts += [f", {salvage.foreign} of other programs left out"] * bool(salvage.foreign)
    parts += ["; what came after the last of them is missing"] * (not salvage.ended)
    return "".join(parts)


def _last_stamp_s(salvage: Salvage) -> float:
    return float(STAMP.unpack_from(salvage.rows[-1][1])[0]) if salvage.rows else 0.0


def main() -> None:
    """For the log's writer: everything unfinished in one folder, after whatever is urgent."""
    with suppress(PermissionError):
        os.nice(5)
    folder = Path(sys.argv[1])

    def say(message: str) -> None:
        print(message, file=sys.stderr, flush=True)

    for recovered in recover_all(folder, say):
        say(f"{recovered.path}: {recovered.note}")


if __name__ == "__main__":
    main()
