"""The files of stored logs as a user handles them: all segments of a run, preserved logs, and why one cannot be used.

A preserved log is moved to kept/, where the quota does not look (firmware_host/log/log_folder.py).
"""

import os
from fcntl import LOCK_NB, LOCK_SH, flock
from pathlib import Path

from firmware_host.log.log_folder import ACTIVE, DONE, ENDING, PRESERVED, SEGMENT, TOP, log_files, move_file


def is_being_written(path: Path) -> bool:
    """Return whether a living process holds the lock of this log; False where this user cannot open it."""
    try:
        with path.open("rb") as file:
            flock(file.fileno(), LOCK_SH | LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def run_files(path: Path) -> list[Path]:
    """Return all segments of the run that a log belongs to, wherever they are now, in their order."""
    folder = path.parent.parent if path.parent.name in (ACTIVE, DONE, PRESERVED) else path.parent
    own = SEGMENT.fullmatch(path.stem)
    run = own["run"] if own else path.stem
    files = log_files(folder, TOP, ACTIVE, DONE, PRESERVED)
    found = {
        file.name: (int(name["number"]), file)
        for file in files
        if (name := SEGMENT.fullmatch(file.stem)) and name["run"] == run
    }
    return [file for _, file in sorted(found.values())]


def preserve(path: Path, undo: bool = False) -> Path:
    """Move a log to kept/, or back to done/. Raises OSError, and ValueError for a log that is elsewhere."""
    source, target = (PRESERVED, DONE) if undo else (DONE, PRESERVED)
    path = path.absolute()
    if not path.exists():
        raise FileNotFoundError(2, "No such file or directory", str(path))
    if path.parent.name == target:
        return path
    at_the_top = not undo and path.suffix == ENDING and (path.parent / DONE).is_dir()  # as older versions left it
    if path.parent.name != source and not at_the_top:
        raise ValueError(f"{path}: only a log in {source}/ can be moved to {target}/")
    moved = (path.parent if at_the_top else path.parent.parent) / target / path.name
    if moved.exists():
        raise ValueError(f"{moved} exists already")
    move_file(path, moved)
    return moved


def why_not_read(path: Path, problem: OSError) -> str:
    """Say why a file cannot be read and, where permission is missing, what to do."""
    if not isinstance(problem, PermissionError):
        return f"{path}: {problem.strerror or problem}"
    visible = next((parent for parent in (path, *path.absolute().parents) if os.path.exists(parent)), path)
    group = f"the group of {visible}, then log in again"
    return f"{path}: you may not read it: have root add you to {group}, or do this as root"


def why_not_moved(path: Path, problem: OSError) -> str:
    if not isinstance(problem, PermissionError):
        return f"{path}: {problem.strerror or problem}"
    return f"{path}: only the daemon's own user and root may change logs: do this as root"


def size_text(size: float) -> str:
    """Format a number of bytes."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
