"""The status socket answers what it understands, tells others off, and never holds the loop."""

from __future__ import annotations

import contextlib
import os
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_host.status_socket import (
    LONGEST_REQUEST,
    MOST_CLIENTS,
    AlreadyServedError,
    RefusedError,
    StatusSocket,
)


def refuse(params: dict[str, Any]) -> Any:
    raise RefusedError("not now")


METHODS: dict[str, Callable[[dict[str, Any]], Any]] = {
    "echo": lambda params: params,
    "refuse": refuse,
    "long": lambda params: "x" * 300_000,
}


@pytest.fixture
def served(short_folder: Path) -> Iterator[StatusSocket]:
    status = StatusSocket(short_folder / "s", METHODS)
    yield status
    status.close()


def connect(served: StatusSocket) -> socket.socket:
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.settimeout(2.0)
    client.connect(str(served.path))
    return client


def serve(served: StatusSocket, ticks: int = 6) -> None:
    for _ in range(ticks):
        served.serve()


def ask(served: StatusSocket, client: socket.socket, data: bytes) -> list[Any]:
    """Everything that comes back within a few ticks."""
    client.sendall(data)
    serve(served)
    client.setblocking(False)
    unpacker = msgpack.Unpacker(raw=False)
    while True:
        try:
            answer = client.recv(1 << 20)
        except BlockingIOError:
            break
        if not answer:
            break
        unpacker.feed(answer)
        serve(served)
    client.settimeout(2.0)
    return list(unpacker)


def test_a_request_is_answered_by_its_number(served: StatusSocket) -> None:
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 7, "echo", {"a": 1}])) == [[1, 7, None, {"a": 1}]]


def test_params_may_stand_in_the_list_of_the_specification(served: StatusSocket) -> None:
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 7, "echo", [{"a": 1}]])) == [[1, 7, None, {"a": 1}]]
    assert ask(served, client, msgpack.packb([0, 8, "echo", []])) == [[1, 8, None, {}]]


def test_a_refusal_and_an_unknown_method_are_answers(served: StatusSocket) -> None:
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 1, "refuse", {}])) == [[1, 1, "not now", None]]
    ((_, _, error, _),) = ask(served, client, msgpack.packb([0, 2, "dance", {}]))
    assert "no method 'dance'" in error and "echo" in error


def test_requests_sent_together_are_answered_one_a_tick_in_order(served: StatusSocket) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, n, "echo", {}]) for n in range(5)))
    answered = []
    for _ in range(8):
        served.serve()
        client.setblocking(False)
        try:
            answered.append(len(list(_unpacked(client.recv(65536)))))
        except BlockingIOError:
            answered.append(0)
    assert sum(answered) == 5 and max(answered) == 1


def _unpacked(data: bytes) -> Iterator[Any]:
    unpacker = msgpack.Unpacker(raw=False)
    unpacker.feed(data)
    yield from unpacker


@pytest.mark.parametrize(
    "message",
    [b"\xc1", b"GET / HTTP/1.1\r\n\r\n", msgpack.packb({"a": 1}), msgpack.packb([1, 2, 3]), msgpack.packb([2, "m", []]),
     msgpack.packb([0, "x", "echo", {}]), msgpack.packb([0, 1, 5, {}]), msgpack.packb([0, 1, "echo", 5])],
)  # fmt: skip
def test_a_garbled_request_gets_an_error_and_the_door(served: StatusSocket, message: bytes) -> None:
    client = connect(served)
    answers = ask(served, client, message)
    assert answers and answers[0][2]
    serve(served)
    assert client.recv(10) == b""
    assert served.garbled_requests == 1


def test_an_endless_request_gets_an_error_and_the_door(served: StatusSocket) -> None:
    client = connect(served)
    client.setblocking(False)
    header = b"\xdb" + (2 * LONGEST_REQUEST).to_bytes(4, "big")
    client.send(header)
    for _ in range(50):
        try:
            client.send(b"x" * 8192)
        except (BlockingIOError, BrokenPipeError, ConnectionResetError):
            break
        served.serve()
    serve(served)
    assert served.garbled_requests == 1


def test_a_client_that_does_not_fetch_its_answers_is_dropped(served: StatusSocket) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, n, "long", {}]) for n in range(20)))
    serve(served, 60)
    with pytest.raises((BrokenPipeError, ConnectionResetError)):
        for _ in range(100):
            client.sendall(b"\xc0")
            served.serve()


def test_a_slow_client_still_gets_a_long_answer_whole(served: StatusSocket) -> None:
    client = connect(served)
    ((_, _, _, result),) = ask(served, client, msgpack.packb([0, 1, "long", {}]))
    assert len(result) == 300_000


def test_a_newcomer_takes_the_place_of_the_client_that_was_still_for_longest(served: StatusSocket) -> None:
    clients = [connect(served) for _ in range(MOST_CLIENTS)]
    serve(served, MOST_CLIENTS + 2)
    assert ask(served, clients[0], msgpack.packb([0, 1, "echo", {}]))
    late = connect(served)
    assert ask(served, late, msgpack.packb([0, 2, "echo", {}])) == [[1, 2, None, {}]]
    assert clients[1].recv(1) == b""
    assert ask(served, clients[0], msgpack.packb([0, 3, "echo", {}]))


def test_a_busy_client_does_not_delay_the_others(served: StatusSocket) -> None:
    busy, other = connect(served), connect(served)
    serve(served)
    for number in range(200):
        busy.sendall(msgpack.packb([0, number, "echo", {}]))
        serve(served, 2)
        busy.recv(4096)
    busy.sendall(b"".join(msgpack.packb([0, number, "echo", {}]) for number in range(50)))
    other.sendall(msgpack.packb([0, 1, "echo", {}]))
    serve(served, 3)
    other.setblocking(False)
    assert list(_unpacked(other.recv(4096))) == [[1, 1, None, {}]]


def test_a_wish_counts_although_its_client_has_hung_up(served: StatusSocket) -> None:
    done: list[str] = []
    served.methods = METHODS | {"disarm": lambda params: done.append("disarm")}
    busy, gone = connect(served), connect(served)
    serve(served, 3)
    busy.sendall(b"".join(msgpack.packb([0, number, "echo", {}]) for number in range(5)))
    gone.sendall(msgpack.packb([0, 1, "long", {}]) + msgpack.packb([0, 2, "disarm", {}]))
    gone.close()
    serve(served, 30)
    assert done == ["disarm"]
    assert len(served._clients) == 1


def test_a_client_that_has_no_more_to_ask_still_gets_a_long_answer_whole(served: StatusSocket) -> None:
    client = connect(served)
    client.sendall(msgpack.packb([0, 1, "long", {}]))
    client.shutdown(socket.SHUT_WR)
    serve(served, 10)  # before it fetches anything
    client.setblocking(False)
    received = bytearray()
    for _ in range(50):
        served.serve()
        with contextlib.suppress(BlockingIOError):
            received += client.recv(65536)
    ((_, _, _, result),) = _unpacked(bytes(received))
    assert len(result) == 300_000
    assert served._clients == {}


def test_many_short_requests_at_once_are_all_answered(served: StatusSocket) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, number, "echo", {}]) for number in range(600)))
    client.setblocking(False)
    received = bytearray()
    for _ in range(1300):
        served.serve()
        with contextlib.suppress(BlockingIOError):
            received += client.recv(65536)
    assert [number for _, number, _, _ in _unpacked(bytes(received))] == list(range(600))


def test_a_method_with_a_bug_answers_so_and_is_reported(served: StatusSocket) -> None:
    said: list[str] = []
    served.report_bug = said.append
    served.methods = {"broken": lambda params: params["missing"]}
    ((_, _, error, _),) = ask(served, connect(served), msgpack.packb([0, 1, "broken", {}]))
    assert "bug" in error and said == ["broken failed: KeyError: 'missing'"]


def test_a_file_that_is_no_socket_is_left_alone(short_folder: Path) -> None:
    path = short_folder / "notes"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(FileExistsError):
        StatusSocket(path, METHODS)
    assert path.read_text(encoding="utf-8") == "mine"


def test_a_client_that_vanishes_with_a_request_under_way_does_no_harm(served: StatusSocket) -> None:
    client = connect(served)
    client.sendall(msgpack.packb([0, 1, "long", {}]))
    client.close()
    serve(served)
    assert ask(served, connect(served), msgpack.packb([0, 2, "echo", {}]))


def test_the_socket_is_for_owner_and_group(served: StatusSocket) -> None:
    assert stat.S_IMODE(os.stat(served.path).st_mode) == 0o660


def test_a_second_daemon_is_refused_and_a_dead_ones_socket_replaced(short_folder: Path) -> None:
    path = short_folder / "s"
    first = StatusSocket(path, METHODS)
    with pytest.raises(AlreadyServedError, match="already running"):
        StatusSocket(path, METHODS)
    first.close()
    left_behind = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    left_behind.bind(str(path))
    left_behind.close()
    second = StatusSocket(path, METHODS)
    second.close()
    assert not path.exists()


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200))
def test_no_bytes_make_it_raise(served: StatusSocket, garbage: bytes) -> None:
    client = connect(served)
    client.sendall(garbage)
    serve(served, 4)
    client.close()
    serve(served, 3)
