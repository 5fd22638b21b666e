"""This user's private folder for the sockets and files of robots that are simulated on this computer.

It is the same folder for every process of the user, so that a second terminal finds a robot that the first one
simulates:

1. `mudskipper-local` in $XDG_RUNTIME_DIR, or in /run/user/UID; for root in /run;
2. where none of these exists, a new folder with a random name among the temporary files; ~/.local/state/mudskipper/run
   is a link to it.

Another user may have prepared a folder, a file or a link under a name that can be guessed. Therefore each level of the
path must belong to this user or root, and no other user may replace it; new levels are open to this user alone, and
files are written without following a link.
"""

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path

NAME = "mudskipper-local"
LINK = Path(".local/state/mudskipper/run")  # in the home folder
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def run_folder() -> Path:
    """Return the folder, which is made if it is missing; raises OSError."""
    for parent in _runtime_parents():
        if parent.is_dir() and not _untrusted_level(parent):
            return _private(make_own_folder(parent / NAME))
    if home := _home():
        return _linked_folder(home / LINK)
    raise OSError(errno.ENOENT, "this user has neither a home folder nor a folder in /run/user: set XDG_RUNTIME_DIR")


def find_run_folder() -> Path | None:
    """Return the folder if it exists and is private, without making anything."""
    home = _home()
    for folder in (*(parent / NAME for parent in _runtime_parents()), *([home / LINK] if home else [])):
        with suppress(OSError):
            return _private(folder.resolve(strict=True))
    return None


def make_own_folder(folder: Path) -> Path:
    """Make a folder for this user alone, or accept one that this user owns; raises OSError for any other."""
    folder.mkdir(mode=0o700, exist_ok=True)
    return _own(folder)


def write_private_file(path: Path, text: str) -> None:
    """Write a file for this user alone; raises OSError, also where a link lies at its path."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    with open(descriptor, "w", encoding="utf-8") as file:
        file.write(text)


def _runtime_parents() -> list[Path]:
    user = os.geteuid()
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    parents = [Path(given)] if os.path.isabs(given) else []
    return [*parents, Path(f"/run/user/{user}"), *([Path("/run")] if user == 0 else [])]


def _home() -> Path | None:
    """Return the home folder; None for a user without one, as a service of systemd may have."""
    try:
        return Path.home()
    except RuntimeError:
        return None


def _untrusted_level(folder: Path) -> Path | None:
    """Return the first level of a path that another user owns, or whose entries another user may replace."""
    folder = folder.resolve(strict=True)
    for level in (folder, *folder.parents):
        status = level.lstat()
        replaceable = status.st_mode & OTHERS_WRITE and (level == folder or not status.st_mode & stat.S_ISVTX)
        if status.st_uid not in (0, os.geteuid()) or replaceable:
            return level
    return None


def _own(folder: Path) -> Path:
    """Return the folder; raises PermissionError for one, or a link, of another user, and NotADirectoryError."""
    status = folder.lstat()
    if status.st_uid != os.geteuid():
        reason = f"belongs to user {status.st_uid}, not to user {os.geteuid()} who runs this"
        raise PermissionError(errno.EPERM, reason, str(folder))
    if not stat.S_ISDIR(status.st_mode):
        raise NotADirectoryError(errno.ENOTDIR, "is no folder: remove it", str(folder))
    return folder


def _private(folder: Path) -> Path:
    """Return the folder; raises PermissionError with a level that another user could use, or NotADirectoryError."""
    if level := _untrusted_level(_own(folder)):
        raise PermissionError(errno.EPERM, f"other users may write to it: run 'chmod go-w {level}'", str(level))
    return folder


def _linked_folder(link: Path) -> Path:
    """Return the folder that this user's link names, or make a new one and the link to it."""
    with suppress(OSError):
        return _private(Path(os.readlink(link)))
    link.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    import tempfile  # slow to import, and every command looks for the folder

    folder = Path(tempfile.mkdtemp(prefix="mudskipper-"))
    link.unlink(missing_ok=True)
    link.symlink_to(folder)
    return folder
