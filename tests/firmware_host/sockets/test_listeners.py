"""Accounts that flood the public socket delay a stop only briefly, and operators not at all."""

import errno
import os
import resource
import socket
import stat
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgpack
import pytest

from control.rate import PERIOD_S
from firmware_host.configuration.socket_paths import operators_path, rows_path
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_file import SocketFile
from firmware_host.sockets.status_socket import ACCEPTING_S, MOST_ACCEPTS, MOST_CLIENTS, MOST_OPERATORS
from operator_client.status_client import StatusClient
from tests.firmware_host.sockets.served_socket import OPERATOR, OTHER_USER, Served, connect, is_open, serve, stops_of

CONNECTORS = 3000
STOP = msgpack.packb([0, 2, "stop", {}])
BYSTANDER = Peer(9, 1009, frozenset())  # another account that may only stop


@pytest.fixture
def crowd(served: Served) -> Iterator[list[socket.socket]]:
    """Open 3,000 connections of one account, which wait to be accepted."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard < CONNECTORS + 200 or int(Path("/proc/sys/net/core/somaxconn").read_text()) < CONNECTORS + 200:
        pytest.skip("this computer permits fewer connections")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, CONNECTORS + 200), hard))
    with ExitStack() as stack:
        yield [stack.enter_context(connect(served, OTHER_USER)) for _ in range(CONNECTORS)]
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def ticks_until_stopped(served: Served, client: socket.socket, stopped: list[Caller]) -> int:
    client.sendall(STOP)
    for ticks in range(1, 2 * CONNECTORS):
        served.tick()
        if stopped:
            return ticks
    raise AssertionError("never stopped")


def connect_as_operator(served: Served) -> socket.socket:
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.connect(str(operators_path(served.path)))
    return client


def test_a_stop_of_any_account_passes_3000_waiting_connections(served: Served, crowd: list[socket.socket]) -> None:
    stopped = stops_of(served)
    ticks = ticks_until_stopped(served, connect(served, BYSTANDER), stopped)
    assert ticks * PERIOD_S < 0.5
    assert stopped[0].peer == BYSTANDER


def test_daemons_whose_sockets_differ_in_their_endings_share_no_socket() -> None:
    paths = [Path(name) for name in ("m.sock", "m.socket", "m")]
    assert len({each for path in paths for each in (path, operators_path(path), rows_path(path))}) == 9


def test_an_operator_stops_at_once_next_to_3000_waiting_connections(served: Served, crowd: list[socket.socket]) -> None:
    stopped = stops_of(served)
    assert ticks_until_stopped(served, connect_as_operator(served), stopped) <= 3
    assert stopped[0].peer == OPERATOR


def test_accepting_ends_when_its_time_in_a_tick_is_over(served: Served) -> None:
    now_s = 0.0

    def slow_clock() -> float:
        nonlocal now_s
        now_s += ACCEPTING_S / 3.0
        return now_s

    served.clock = slow_clock
    clients = [connect(served, OTHER_USER) for _ in range(9)]
    served.tick()
    assert served.counters["accepted_clients"] in (3, 4)
    served.clock = lambda: 0.0
    clients += [connect(served, OTHER_USER) for _ in range(2 * MOST_ACCEPTS)]
    served.tick()
    served.tick()
    assert MOST_ACCEPTS < served.counters["accepted_clients"] <= 4 + 2 * MOST_ACCEPTS


def test_users_with_one_connection_each_are_not_dropped_faster_than_they_are_answered(served: Served) -> None:
    """Otherwise many accounts that connect at the same time would exclude each other."""
    stopped = stops_of(served)
    clients = [connect(served, Peer(9, 2000 + index, frozenset())) for index in range(10 * MOST_CLIENTS)]
    for client in clients:
        client.sendall(STOP)
    serve(served, 11 * MOST_CLIENTS)
    assert len(stopped) >= 8 * MOST_CLIENTS


def test_operators_have_places_of_their_own(served: Served) -> None:
    operators = [connect_as_operator(served) for _ in range(MOST_OPERATORS)]
    serve(served, 4)
    others = []
    for _ in range(4 * MOST_CLIENTS):
        others.append(connect(served, OPERATOR))  # even the same user
        served.tick()
    assert all(map(is_open, operators))
    assert served.counters["clients"] == MOST_CLIENTS + MOST_OPERATORS


def test_both_sockets_take_turns(served: Served) -> None:
    asked: list[Caller] = []
    served.methods = {"whoami": lambda params, caller: asked.append(caller)}
    operator, other = connect_as_operator(served), connect(served, Peer(9, 0, frozenset()))
    serve(served, 4)
    for client in (operator, other):
        client.sendall(msgpack.packb([0, 1, "whoami", {}]) * 10)
    serve(served, 12)
    assert [caller.peer.uid for caller in asked[:6]] in ([1000, 0] * 3, [0, 1000] * 3)


def test_the_operators_file_admits_their_group_alone(served: Served) -> None:
    found = operators_path(served.path).stat()
    assert stat.S_IMODE(found.st_mode) == 0o660
    if os.geteuid() == 0:
        assert found.st_gid == 71 and served.warnings == []


@pytest.fixture
def no_chown(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr("os.chown", refuse)


@pytest.mark.usefixtures("no_chown")
def test_a_group_that_the_daemon_may_not_use_is_a_warning(short_folder: Path) -> None:
    made = Served(short_folder / "run")
    assert len(made.warnings) == 1 and "pilots" in made.warnings[0]
    made.close()


@pytest.mark.usefixtures("no_chown")
def test_the_daemon_s_own_group_needs_no_system_call_that_the_unit_forbids(short_folder: Path) -> None:
    (short_folder / "run").mkdir()
    group = (short_folder / "run").stat().st_gid
    file = SocketFile(short_folder / "run" / "operators.sock", 1, group)
    assert file.has_group
    file.close()


def test_a_client_prefers_the_operators_socket_and_finds_the_other_one(served: Served) -> None:
    first = StatusClient(served.path)
    serve(served, 2)
    assert len(served._for_operators.clients) == 1
    operators_path(served.path).unlink()
    served.coming.append(OTHER_USER)
    second = StatusClient(served.path)
    serve(served, 2)
    assert len(served._for_everyone.clients) == 1
    first.close()
    second.close()
