"""The folder of the logs: active/ for logs being written, done/ for finished ones, kept/ for preserved ones.

A file moves from active/ to done/ in one rename after it is synchronised, so every file in done/ is whole. A preserved
log is moved to kept/: unlike an extended attribute or a list of names, a folder survives every copy to another disk and
is visible with `ls`, and the quota cannot reach it, since it never looks there. A log in the folder itself, where older
versions left them, counts as one of done/.
"""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import NamedTuple

ACTIVE, DONE, PRESERVED = "active", "done", "kept"
COPIED = "copied"  # has an empty file for each log that was copied to another computer
TOP = "."  # the folder itself
ENDING = ".mcap"
BROKEN = ".broken"  # after the name of a log that is being rewritten
PART = ".part"  # after the name of one that is not whole yet
FIRST = "-0000"
SEGMENT = re.compile(r"(?P<run>.*)-(?P<number>\d{4,})(?P<trial>_[^-]*)?")  # of a file's name without its ending
LAST_BYTES = b"\x89MCAP0\r\n"  # of every whole MCAP file


class FreeSpace(NamedTuple):
    free_fraction: float
    free_bytes: int


def new_run_id(robot: str) -> str:
    """Return an id that sorts by time and is a valid file name for any name of the robot."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    return f"{stamp}-{re.sub(r'[^A-Za-z0-9_.]+', '_', robot)[:60]}"


def first_path(folder: Path, run_id: str) -> Path:
    return folder / ACTIVE / f"{run_id}{FIRST}{ENDING}"


def segment_path(first: Path, segment: int, trial: str = "") -> Path:
    """Return the path of a segment; `trial` is what its name has of the trial, such as _A_3."""
    if segment == 0 and not trial:
        return first
    return first.with_name(f"{first.stem.removesuffix(FIRST)}-{segment:04d}{trial}{ENDING}")


def finished_path(path: Path) -> Path:
    """Return the path of the finished log; a log outside of active/ does not move."""
    moves = path.parent.name == ACTIVE and path.suffix == ENDING
    return path.parent.parent / DONE / path.name if moves else path


def present_path(path: Path) -> Path:
    """Return where a log is now that was in active/ before."""
    folder = path.parent.parent
    paths = (path, folder / DONE / path.name, folder / PRESERVED / path.name)
    return next((possible for possible in paths if possible.exists()), path)


def log_files(folder: Path, *subfolders: str) -> list[Path]:
    """Return the logs in these subfolders, the oldest first; a missing subfolder is empty."""
    found = [path for subfolder in subfolders for path in (folder / subfolder).glob(f"*{ENDING}")]
    return sorted(found, key=age_of)


def age_of(path: Path) -> tuple[str, int, str]:
    """Return what sorts logs by time: after segment 9999 the names alone do not."""
    own = SEGMENT.fullmatch(path.stem)
    return (own["run"], int(own["number"]), path.name) if own else (path.stem, 0, path.name)


def unfinished_files(folder: Path) -> list[Path]:
    """Return the files that recovery has to examine, including those of living writers."""
    found = [path for ending in (ENDING, BROKEN, PART) for path in (folder / ACTIVE).glob(f"*{ending}")]
    found += [path for ending in (BROKEN, PART) for path in folder.glob(f"*{ENDING}{ending}")]
    return sorted([*found, *(path for path in folder.glob(f"*{ENDING}") if not _has_an_end(path))])


def _has_an_end(path: Path) -> bool:
    """Return true also for a file that was removed or cannot be opened: there is nothing to recover."""
    try:
        with path.open("rb") as file:
            file.seek(-min(len(LAST_BYTES), path.stat().st_size), os.SEEK_END)
            return file.read() == LAST_BYTES
    except OSError:
        return True


def stored_files(folder: Path) -> list[Path]:
    """Return all files that count towards the quota: everything in active/ does, a preserved log does not."""
    active = {path for path in (folder / ACTIVE).glob("*") if path.is_file()}
    found = active.union(unfinished_files(folder), log_files(folder, TOP, DONE))
    return sorted(found, key=lambda path: path.name)


def free_space(folder: Path) -> FreeSpace:
    """Return the disk's free space for users without special rights. Raises OSError."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    disk = os.statvfs(folder)
    return FreeSpace(disk.f_bavail / max(1, disk.f_blocks), disk.f_bavail * disk.f_frsize)


def delete_by_quota(folder: Path, quota_bytes: int, min_free_fraction: float, most: int = 4) -> Iterator[str]:
    """Delete the oldest finished logs until quota and free space are respected; yield the messages. Raises OSError."""
    deletions = delete_oldest(folder)
    for _ in range(most):
        too_much = 0 < quota_bytes < sum(map(_size, stored_files(folder)))
        if not too_much and free_space(folder).free_fraction >= min_free_fraction:
            return
        yield from islice(deletions, 1)


def delete_oldest(folder: Path) -> Iterator[str]:
    """Delete one log after another, and yield the messages; skip those that cannot be deleted (chattr +i)."""
    for oldest in deletable_logs(folder):
        with suppress(OSError):
            yield delete_log(oldest)


def deletable_logs(folder: Path) -> list[Path]:
    """Return the finished logs, copied ones before others, the oldest first; without the newest of all."""
    unfinished = unfinished_files(folder)
    finished = [path for path in log_files(folder, TOP, DONE) if path not in unfinished]
    return sorted(finished[:-1], key=lambda path: not is_copied(path, folder))


def mark_of(log: Path, folder: Path) -> Path:
    """Return the file that says in a folder of logs that a log was copied; it is no log by its name."""
    return folder / COPIED / log.stem


def is_copied(log: Path, folder: Path) -> bool:
    """Return whether a log was copied and has not been annotated since: its mark has the time of what was copied."""
    with suppress(OSError):
        return int(mark_of(log, folder).stat().st_mtime) >= int(log.stat().st_mtime)
    return False


def copies_text(folder: Path) -> str:
    """Return how many logs of a folder were not copied yet."""
    logs = log_files(folder, TOP, DONE)
    return f"{sum(not is_copied(path, folder) for path in logs)} of {len(logs)} not copied"


def delete_log(path: Path) -> str:
    """Delete a log, and return the message about it."""
    folder = path.parent.parent if path.parent.name == DONE else path.parent
    copied = "copied before" if is_copied(path, folder) else "not copied"
    message = f"room for logs: {path.name} was deleted, {_size(path)} bytes, {copied}"
    path.unlink()
    mark_of(path, folder).unlink(missing_ok=True)
    return message


def _size(path: Path) -> int:
    """Return zero for a file that was removed meanwhile."""
    with suppress(OSError):
        return path.stat().st_size
    return 0


def move_file(path: Path, target: Path) -> None:
    """Rename a file and synchronise both folders."""
    make_folder(target.parent)
    path.rename(target)
    for folder in {target.parent, path.parent}:
        synchronise_folder(folder)


def make_folder(folder: Path) -> None:
    """Make a folder and its missing parents durably, each with the owner of the folder it is in. Raises OSError."""
    if not folder.exists():
        make_folder(folder.parent)
        folder.mkdir(exist_ok=True)
        synchronise_folder(folder.parent)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            copy_owner(descriptor, folder.parent)
        finally:
            os.close(descriptor)


def copy_owner(descriptor: int, folder: Path) -> None:
    """Give an open file the owner of its folder: what a command makes as root must not lock the daemon out.

    The file is open and not named by its path, which the folder's owner may have replaced by a link meanwhile.
    """
    owner = folder.stat()
    for user, group in ((-1, owner.st_gid), (owner.st_uid, -1)):
        with suppress(OSError):  # only root may change the owner, and not on every disk
            os.fchown(descriptor, user, group)


def synchronise_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
