"""Rights follow from the credentials that the kernel gives, and from groups looked up at the start."""

import grp
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware_host.configuration.configuration import StatusParameters
from firmware_host.sockets.rights import Peer, read_peer
from firmware_host.sockets.socket_methods import Level
from firmware_host.sockets.user_groups import load_rights
from tests.waiting import LONGEST_S

ANY_GROUP = grp.getgrall()[-1]
NOBODY = 65534


@pytest.fixture
def listener(short_folder: Path) -> Iterator[socket.socket]:
    short_folder.chmod(0o755)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.settimeout(LONGEST_S)
        listener.bind(str(short_folder / "s"))
        (short_folder / "s").chmod(0o666)
        listener.listen()
        yield listener


def peer_in_groups(listener: socket.socket, groups: list[int]) -> tuple[int, Peer]:
    """Connect from a process of another user in these groups; return its id and the credentials that were read."""
    child = os.fork()
    if child == 0:
        try:
            os.setgroups(groups)
            os.setresgid(NOBODY, NOBODY, NOBODY)
            os.setresuid(NOBODY, NOBODY, NOBODY)
            with socket.socket(socket.AF_UNIX) as client:
                client.connect(listener.getsockname())
        finally:
            os._exit(0)
    connection, _ = listener.accept()
    with connection:
        peer = read_peer(connection)
    os.waitpid(child, 0)
    return child, peer


def test_the_kernel_identifies_the_peer(listener: socket.socket) -> None:
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(listener.getsockname())
        connection, _ = listener.accept()
        with connection:
            assert read_peer(connection) == Peer(os.getpid(), os.geteuid(), frozenset((os.getegid(), *os.getgroups())))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can start a process of another user")
def test_supplementary_groups_of_another_user_s_process_count(listener: socket.socket) -> None:
    child, peer = peer_in_groups(listener, [4321, 4322])
    assert peer == Peer(child, NOBODY, frozenset({NOBODY, 4321, 4322}))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a process as many groups")
@pytest.mark.parametrize("count", [256, 257, 2000])
def test_a_user_of_too_many_groups_has_only_the_primary_one(listener: socket.socket, count: int) -> None:
    groups = list(range(5000, 5000 + count))
    _, peer = peer_in_groups(listener, groups)
    assert peer.groups == {NOBODY, *(groups if count <= 256 else [])}


def test_without_names_the_daemon_s_own_group_may_do_everything() -> None:
    own = load_rights(StatusParameters())
    member = Peer(1, 77777, frozenset({os.getegid()}))
    assert own.level(member) is Level.DRIVE
    assert own.level(Peer(1, 77777, frozenset({77777}))) is Level.ANYONE


def test_no_group_name_is_looked_up_after_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    own = load_rights(StatusParameters(read_group=ANY_GROUP.gr_name))

    def slow(*arguments: object) -> None:
        raise AssertionError("a name service may take seconds")

    for name in ("getgrnam", "getgrgid", "getgrall"):
        monkeypatch.setattr(grp, name, slow)
    monkeypatch.setattr(os, "getgrouplist", slow)
    one, other = socket.socketpair()
    with one, other:
        assert own.level(read_peer(one)) is Level.DRIVE
    assert own.refusal("arm", Level.READ) is not None
