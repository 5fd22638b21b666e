"""The folder of the logs: active/ holds what is being written, done/ what is whole, kept/ what nobody may free.

A file goes from active/ to done/ in one rename once it is down on the disk, so whatever lies in done/ is whole.
Preserving a log moves it to kept/: unlike an extended attribute or a list of names that survives every copy to another
disk, it is seen with `ls`, and freeing cannot reach it, since it never looks there. A log that lies in the folder
itself, as older versions left them, counts as one of done/.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

ACTIVE, DONE, KEPT = "active", "done", "kept"
TOP = "."  # the folder itself
ENDING = ".mcap"
BROKEN = ".broken"  # after the name of a log that is being rewritten
PART = ".part"  # after the name of one that is not whole yet
FIRST = "-0000"
LAST_BYTES = b"\x89MCAP0\r\n"  # of every whole MCAP file


class FreeSpace(NamedTuple):
    free_fraction: float
    free_bytes: int


class FreedLog(NamedTuple):
    name: str
    size: int  # bytes


def new_run_id(robot: str) -> str:
    """Sorts by time, and is a file name whatever the robot is called."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    return f"{stamp}-{re.sub(r'[^A-Za-z0-9_.]+', '_', robot)[:60]}"


def first_path(folder: Path, run_id: str) -> Path:
    return folder / ACTIVE / f"{run_id}{FIRST}{ENDING}"


def segment_path(first: Path, segment: int) -> Path:
    if segment == 0:
        return first
    return first.with_name(f"{first.stem.removesuffix(FIRST)}-{segment:04d}{ENDING}")


def finished_path(path: Path) -> Path:
    """Where a log goes once it is whole; one outside of active/ stays where it is."""
    moves = path.parent.name == ACTIVE and path.suffix == ENDING
    return path.parent.parent / DONE / path.name if moves else path


def present_path(path: Path) -> Path:
    """Of a log that was last seen in active/ and may have gone on since."""
    folder = path.parent.parent
    places = (path, folder / DONE / path.name, folder / KEPT / path.name)
    return next((place for place in places if place.exists()), path)


def log_files(folder: Path, *places: str) -> list[Path]:
    """The oldest first. A place that is not there holds none."""
    found = [path for place in places for path in (folder / place).glob(f"*{ENDING}")]
    return sorted(found, key=lambda path: path.name)


def run_files(path: Path) -> list[Path]:
    """All segments of the run that this one is of, wherever they lie now, in their order."""
    folder = path.parent.parent if path.parent.name in (ACTIVE, DONE, KEPT) else path.parent
    run = re.sub(r"-\d{4,}$", "", path.stem)
    segments = re.compile(re.escape(run) + r"-(\d{4,})")
    found = {file.name: file for file in log_files(folder, TOP, ACTIVE, DONE, KEPT) if segments.fullmatch(file.stem)}
    return [found[name] for name in sorted(found, key=lambda name: int(name.removesuffix(ENDING).rpartition("-")[2]))]


def unfinished_files(folder: Path) -> list[Path]:
    """What recovery has to look at, the files of living writers included."""
    found = [path for ending in (ENDING, BROKEN, PART) for path in (folder / ACTIVE).glob(f"*{ending}")]
    found += [path for ending in (BROKEN, PART) for path in folder.glob(f"*{ENDING}{ending}")]
    return sorted([*found, *(path for path in folder.glob(f"*{ENDING}") if not _has_an_end(path))])


def _has_an_end(path: Path) -> bool:
    """Also of one that went away or cannot be opened: there is nothing to recover."""
    try:
        with path.open("rb") as file:
            file.seek(-min(len(LAST_BYTES), path.stat().st_size), os.SEEK_END)
            return file.read() == LAST_BYTES
    except OSError:
        return True


def stored_files(folder: Path) -> list[Path]:
    """All that takes up the logs' room, whatever lies in active/ included; what a person has preserved does not."""
    junk = {path for path in (folder / ACTIVE).glob("*") if path.is_file()}
    found = junk.union(unfinished_files(folder), log_files(folder, TOP, DONE))
    return sorted(found, key=lambda path: path.name)


def free_space(folder: Path) -> FreeSpace:
    """Of the disk, for whoever has no special rights. Raises OSError."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    disk = os.statvfs(folder)
    return FreeSpace(disk.f_bavail / max(1, disk.f_blocks), disk.f_bavail * disk.f_frsize)


def free_logs(folder: Path, quota_bytes: int, min_free_fraction: float, most: int = 4) -> Iterator[FreedLog]:
    """Remove the oldest finished logs, one by one, while the logs or the disk hold too much. Raises OSError."""
    used = sum(_size(path) for path in stored_files(folder))
    for oldest in removable_logs(folder)[:most]:
        too_much = 0 < quota_bytes < used
        if not too_much and free_space(folder).free_fraction >= min_free_fraction:
            return
        freed = remove_log(oldest)
        used -= freed.size
        yield freed


def removable_logs(folder: Path) -> list[Path]:
    """The oldest first. The newest finished log is never freed: it tells of what happened last."""
    unfinished = unfinished_files(folder)
    return [path for path in log_files(folder, TOP, DONE) if path not in unfinished][:-1]


def remove_log(path: Path) -> FreedLog:
    freed = FreedLog(path.name, _size(path))
    path.unlink()
    return freed


def _size(path: Path) -> int:
    """Zero for one that went away meanwhile."""
    with suppress(OSError):
        return path.stat().st_size
    return 0


def preserve(path: Path, undo: bool = False) -> Path:
    """To kept/, or back to done/; its new place. Raises OSError, and ValueError for a log that is elsewhere."""
    source, target = (KEPT, DONE) if undo else (DONE, KEPT)
    path = path.absolute()
    if path.parent.name == target:
        return path
    at_the_top = not undo and path.suffix == ENDING and (path.parent / DONE).is_dir()
    if path.parent.name != source and not at_the_top:
        raise ValueError(f"{path}: only a log in {source}/ can be moved to {target}/")
    moved = (path.parent if at_the_top else path.parent.parent) / target / path.name
    if not path.exists():
        raise FileNotFoundError(2, "No such file or directory", str(path))
    if moved.exists():
        raise ValueError(f"{moved} exists already")
    make_folder(moved.parent)
    path.rename(moved)
    synchronise_folder(moved.parent)
    synchronise_folder(path.parent)
    return moved


def make_folder(folder: Path) -> None:
    """With all above it that are not there, each with the owner of the folder that it lies in. Raises OSError."""
    if not folder.exists():
        make_folder(folder.parent)
        folder.mkdir(exist_ok=True)
        take_owner(folder)


def take_owner(path: Path) -> None:
    """Of its folder: what a command makes as root must not lock the daemon out."""
    owner = path.parent.stat()
    for user, group in ((-1, owner.st_gid), (owner.st_uid, -1)):
        with suppress(OSError):  # only root may give things away, and not on every disk
            os.chown(path, user, group)


def why_not_read(path: Path, problem: OSError) -> str:
    """With what to do, where it is a matter of rights."""
    if not isinstance(problem, PermissionError):
        return f"{path}: {problem.strerror or problem}"
    shown = next((place for place in (path, *path.absolute().parents) if _can_be_seen(place)), path)
    group = f"the group of {shown}, then log in again"
    return f"{path}: you may not read it: have root add you to {group}, or do this as root"


def why_not_moved(path: Path, problem: OSError) -> str:
    if not isinstance(problem, PermissionError):
        return f"{path}: {problem.strerror or problem}"
    return f"{path}: only the daemon's own user and root may move logs: do this as root"


def _can_be_seen(path: Path) -> bool:
    try:
        path.stat()
    except OSError:
        return False
    return True


def synchronise_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def disk_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).total
