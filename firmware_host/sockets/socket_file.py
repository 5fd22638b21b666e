"""The file of a listening Unix socket: open to every user or to one group, and replaced if a dead daemon left it.

Connecting requires the right to write to the file and to enter its folder. The credentials of a connection decide what
it may do (rights.py), not the file: an existing folder keeps its permissions, and a new one is open to every user. The
operators' own file admits their group alone.

Symbolic links are not followed, and only a dead socket is removed: never a file, a link, or the socket of a daemon that
lives or hangs. The rows' socket is removed also where it answers: this daemon owns the status socket by then, so the
writer of one that has ended has it. A folder in which any user could replace the socket is refused: one that all may
write to, not sticky.
"""

import errno
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROBE_S = 1.0  # the longest wait for a daemon to accept a connection
OPEN_FILE, GROUP_FILE, OPEN_FOLDER = 0o666, 0o660, 0o755


class AlreadyServedError(Exception):
    """Another daemon answers on this socket."""


class SocketFile:
    """Owns the listening socket and its file."""

    def __init__(self, path: Path, backlog: int, group: int | None = None, kind: int = socket.SOCK_STREAM) -> None:
        """Bind and listen, for one group where it is given.

        Raises AlreadyServedError, or OSError if the path cannot be bound.
        """
        with _umask(0o777 & ~OPEN_FOLDER):
            path.parent.mkdir(parents=True, exist_ok=True)
        _refuse_open_folder(path.parent)
        _remove_stale(path, kind)
        self.path = path
        self.listener = socket.socket(socket.AF_UNIX, kind)
        self.listener.setblocking(False)
        _bind(self.listener, path, OPEN_FILE if group is None else GROUP_FILE)
        self.has_group = group is None or _give_to(path, group)
        self._identity = _identity(path)
        self.listener.listen(backlog)

    def close(self) -> None:
        """Close the socket and remove its file, unless another daemon has replaced it."""
        self.listener.close()
        if _identity(self.path) == self._identity:
            self.path.unlink(missing_ok=True)


def _give_to(path: Path, group: int) -> bool:
    """Give the file to a group; return whether this was permitted: of its own files, to a group of its own.

    A new file has the group of the process. The unit's filter of system calls forbids any other one.
    """
    if path.lstat().st_gid == group:
        return True
    try:
        os.chown(path, -1, group, follow_symlinks=False)  # fchown would change the socket instead of its file
    except PermissionError:
        return False
    return True


def _bind(listener: socket.socket, path: Path, mode: int) -> None:
    try:
        with _umask(0o777 & ~mode):
            listener.bind(str(path))
    except OSError as problem:
        listener.close()
        raise OSError(problem.errno, problem.strerror, str(path)) from None


@contextmanager
def _umask(mask: int) -> Iterator[None]:
    """Set the permissions of new files from their creation on."""
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.lstat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino


def _refuse_open_folder(folder: Path) -> None:
    mode = folder.stat().st_mode
    if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
        raise PermissionError(errno.EPERM, "everybody may write to it: run 'chmod o-w' on it", str(folder))


def _remove_stale(path: Path, kind: int) -> None:
    """Remove the socket of a daemon that died; raises OSError or AlreadyServedError for anything else."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(mode):
        raise FileExistsError(errno.EEXIST, "is there already and is no socket: remove it", str(path))
    if kind == socket.SOCK_STREAM and _answers(path):
        raise AlreadyServedError(f"another daemon is already running on {path}")
    path.unlink(missing_ok=True)


def _answers(path: Path) -> bool:
    """Return whether a daemon listens; one that accepts no connection in time hangs, but is not dead."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(PROBE_S)
        try:
            probe.connect(str(path))
        except (ConnectionRefusedError, FileNotFoundError):
            return False
        except (TimeoutError, BlockingIOError):
            return True
        except OSError as problem:
            raise OSError(problem.errno, problem.strerror, str(path)) from None
    return True
