"""systemd receives the daemon's notifications, and a systemd that does not listen never disturbs the loop."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack
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


@pytest.fixture
def notifier(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], SystemdNotifier]]:
    """Yield a function that makes the notifier of a process with this NOTIFY_SOCKET."""
    with ExitStack() as stack:

        def start(address: str) -> SystemdNotifier:
            monkeypatch.setenv("NOTIFY_SOCKET", address)
            notifier = SystemdNotifier()
            stack.callback(notifier.close)
            return notifier

        yield start


Start = Callable[[str], SystemdNotifier]


def test_every_call_arrives_as_one_datagram_of_lines_at_a_path(
    listen: Listen, notifier: Start, short_folder: Path
) -> None:
    address = str(short_folder / "notify")
    systemd = listen(address)
    sender = notifier(address)
    sender.send("READY=1", "STATUS=running")
    sender.send("WATCHDOG=1")
    assert systemd.recv(4096) == b"READY=1\nSTATUS=running"
    assert systemd.recv(4096) == b"WATCHDOG=1"


def test_an_address_with_an_at_sign_is_in_the_abstract_namespace(listen: Listen, notifier: Start) -> None:
    name = f"mudskipper-test-{os.getpid()}"
    systemd = listen(f"\0{name}")
    notifier(f"@{name}").send("READY=1")
    assert systemd.recv(4096) == b"READY=1"


def test_nothing_happens_without_a_notify_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    before = set(os.listdir("/proc/self/fd"))
    notifier = SystemdNotifier()
    notifier.send("READY=1")
    assert set(os.listdir("/proc/self/fd")) == before
    notifier.close()


@pytest.mark.parametrize("address", ["/nonexistent/notify", "@mudskipper-nobody-is-here", "x" * 500])
def test_an_address_without_a_listener_never_raises(notifier: Start, address: str) -> None:
    notifier(address).send("WATCHDOG=1")


def test_a_socket_that_vanishes_and_comes_back_is_found_again(
    listen: Listen, notifier: Start, short_folder: Path
) -> None:
    path = short_folder / "notify"
    first = listen(str(path))
    sender = notifier(str(path))
    sender.send("READY=1")
    first.close()
    sender.send("WATCHDOG=1")  # refused
    path.unlink()
    sender.send("WATCHDOG=1")  # no such file
    second = listen(str(path))  # like a systemd that re-executes itself
    sender.send("WATCHDOG=1")
    assert second.recv(4096) == b"WATCHDOG=1"


def test_a_full_queue_loses_the_notice_instead_of_the_deadline(
    listen: Listen, notifier: Start, short_folder: Path
) -> None:
    address = str(short_folder / "notify")
    systemd = listen(address)
    sender = notifier(address)
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
