"""A socket's file has its permissions from the start, is removed by its daemon, and replaces no live socket."""

import os
import socket
import stat
from pathlib import Path

import pytest

from firmware_host.sockets.socket_file import AlreadyServedError, SocketFile


def leave_stale_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(path))


@pytest.mark.parametrize("umask", [0o000, 0o027, 0o777])
def test_every_user_may_connect_under_every_umask(short_folder: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        made = SocketFile(short_folder / "run" / "s", 4)
        assert os.umask(umask) == umask
    finally:
        os.umask(before)
    assert stat.S_IMODE(made.path.stat().st_mode) == 0o666
    assert stat.S_IMODE(made.path.parent.stat().st_mode) == 0o755
    assert not made.listener.getblocking()
    made.close()
    assert not made.path.exists()


@pytest.mark.parametrize("backlog", [4, 0])
def test_a_daemon_is_not_replaced_even_if_it_hangs_with_a_full_queue(short_folder: Path, backlog: int) -> None:
    first = SocketFile(short_folder / "s", backlog)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as waiting:
        waiting.connect(str(first.path))
        with pytest.raises(AlreadyServedError, match="already running"):
            SocketFile(short_folder / "s", 4)
    first.close()


def test_a_dead_daemon_s_socket_is_replaced(short_folder: Path) -> None:
    leave_stale_socket(short_folder / "s")
    SocketFile(short_folder / "s", 4).close()
    assert not (short_folder / "s").exists()


def test_a_file_that_is_no_socket_is_left_alone(short_folder: Path) -> None:
    path = short_folder / "notes"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(FileExistsError):
        SocketFile(path, 4)
    assert path.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("target", ["dead", "file", "nothing"])
def test_a_symbolic_link_is_not_followed(short_folder: Path, target: str) -> None:
    leave_stale_socket(short_folder / "dead")
    (short_folder / "file").write_text("mine", encoding="utf-8")
    link = short_folder / "s"
    link.symlink_to(short_folder / target)
    with pytest.raises(FileExistsError) as caught:
        SocketFile(link, 4)
    assert caught.value.filename == str(link)
    assert link.is_symlink() and (short_folder / "dead").is_socket() and (short_folder / "file").is_file()


def test_a_folder_that_every_user_may_write_to_is_refused(short_folder: Path) -> None:
    folder = short_folder / "open"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(PermissionError, match="everybody may write"):
        SocketFile(folder / "s", 4)
    folder.chmod(0o1777)  # as /tmp is
    SocketFile(folder / "s", 4).close()


def test_the_file_of_a_later_daemon_is_not_removed(short_folder: Path) -> None:
    first = SocketFile(short_folder / "s", 4)
    first.path.unlink()
    second = SocketFile(short_folder / "s", 4)
    first.close()
    assert second.path.is_socket()
    second.close()
