"""systemd receives the daemon's notifications, and a systemd that does not listen never disturbs the loop."""

import os
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from firmware_host.computer.sd_notify import SystemdNotifier

Listen = Callable[[str], socket.socket]


@pytest.fixture
def listen() -> Iterator[Listen]:
    """Yield a function that listens on an address like systemd."""
    with ExitStack() as stack:

        def listen_on(address: str) -> socket.socket:
            listener = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            listener.bind(address)
            listener.setblocking(False)
            return listener

        yield listen_on


@pytest.mark.parametrize("abstract", [False, True])
def test_every_call_arrives_as_one_datagram_of_lines_at_a_path_or_an_abstract_address(
    listen: Listen, short_folder: Path, abstract: bool
) -> None:
    name = f"mudskipper-test-{os.getpid()}"
    systemd = listen(f"\0{name}" if abstract else str(short_folder / "notify"))
    with closing(SystemdNotifier(f"@{name}" if abstract else str(short_folder / "notify"))) as sender:
        sender.send("READY=1", "STATUS=running")
        sender.send("WATCHDOG=1")
    assert systemd.recv(4096) == b"READY=1\nSTATUS=running"
    assert systemd.recv(4096) == b"WATCHDOG=1"


def test_nothing_happens_without_a_notify_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    before = set(os.listdir("/proc/self/fd"))
    notifier = SystemdNotifier()
    notifier.send("READY=1")
    assert set(os.listdir("/proc/self/fd")) == before
    notifier.close()


@pytest.mark.parametrize("address", ["/nonexistent/notify", "@mudskipper-nobody-is-here", "x" * 500])
def test_an_address_without_a_listener_never_raises(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    with closing(SystemdNotifier()) as sender:
        sender.send("WATCHDOG=1")


def test_a_socket_that_vanishes_and_comes_back_is_found_again(listen: Listen, short_folder: Path) -> None:
    path = short_folder / "notify"
    first = listen(str(path))
    sender = SystemdNotifier(str(path))
    sender.send("READY=1")
    first.close()
    sender.send("WATCHDOG=1")  # refused
    path.unlink()
    sender.send("WATCHDOG=1")  # no such file
    second = listen(str(path))  # like a systemd that re-executes itself
    sender.send("WATCHDOG=1")
    assert second.recv(4096) == b"WATCHDOG=1"
    sender.close()


def test_a_full_queue_loses_the_notice_instead_of_the_deadline(listen: Listen, short_folder: Path) -> None:
    address = str(short_folder / "notify")
    systemd = listen(address)
    sender = SystemdNotifier(address)
    for _ in range(5000):
        sender.send("WATCHDOG=1")  # a blocking socket would wait for ever
    arrived = 0
    while True:
        try:
            systemd.recv(4096)
        except BlockingIOError:
            break
        arrived += 1
    assert 0 < arrived < 5000
    sender.send("STOPPING=1")
    assert systemd.recv(4096) == b"STOPPING=1"
    sender.close()
