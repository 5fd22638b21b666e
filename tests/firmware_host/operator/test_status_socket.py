"""The status socket answers what it understands, tells others off, and never holds the loop."""

from __future__ import annotations

import contextlib
import socket

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_host.operator.rpc import LONGEST_REQUEST
from firmware_host.operator.status_socket import MOST_CLIENTS
from tests.firmware_host.served_socket import METHODS, Served, ask, connect, serve, unpacked


def test_a_request_is_answered_by_its_number(served: Served) -> None:
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 7, "echo", {"a": 1}])) == [[1, 7, None, {"a": 1}]]


def test_params_may_stand_in_the_list_of_the_specification(served: Served) -> None:
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 7, "echo", [{"a": 1}]])) == [[1, 7, None, {"a": 1}]]
    assert ask(served, client, msgpack.packb([0, 8, "echo", []])) == [[1, 8, None, {}]]


def test_a_refusal_and_an_unknown_method_are_answers(served: Served) -> None:
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 1, "refuse", {}])) == [[1, 1, "not now", None]]
    ((_, _, error, _),) = ask(served, client, msgpack.packb([0, 2, "dance", {}]))
    assert "no method 'dance'" in error and "echo" in error


def test_requests_sent_together_are_answered_one_a_tick_in_order(served: Served) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, n, "echo", {}]) for n in range(5)))
    answered = []
    for _ in range(8):
        served.tick()
        client.setblocking(False)
        try:
            answered.append(len(list(unpacked(client.recv(65536)))))
        except BlockingIOError:
            answered.append(0)
    assert sum(answered) == 5 and max(answered) == 1


@pytest.mark.parametrize(
    "message",
    [b"\xc1", b"GET / HTTP/1.1\r\n\r\n", msgpack.packb({"a": 1}), msgpack.packb([1, 2, 3]), msgpack.packb([2, "m", []]),
     msgpack.packb([0, "x", "echo", {}]), msgpack.packb([0, 1, 5, {}]), msgpack.packb([0, 1, "echo", 5])],
)  # fmt: skip
def test_a_garbled_request_gets_an_error_and_the_door(served: Served, message: bytes) -> None:
    client = connect(served)
    answers = ask(served, client, message)
    assert answers and answers[0][2]
    serve(served)
    assert client.recv(10) == b""
    assert served.counters["malformed_requests"] == 1


def test_an_endless_request_gets_an_error_and_the_door(served: Served) -> None:
    client = connect(served)
    client.setblocking(False)
    header = b"\xdb" + (2 * LONGEST_REQUEST).to_bytes(4, "big")
    client.send(header)
    for _ in range(50):
        try:
            client.send(b"x" * 8192)
        except (BlockingIOError, BrokenPipeError, ConnectionResetError):
            break
        served.tick()
    serve(served)
    assert served.counters["malformed_requests"] == 1


def test_a_client_that_does_not_fetch_its_answers_is_dropped(served: Served) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, n, "long", {}]) for n in range(20)))
    serve(served, 60)
    with pytest.raises((BrokenPipeError, ConnectionResetError)):
        for _ in range(100):
            client.sendall(b"\xc0")
            served.tick()
    assert served.counters["dropped_slow_clients"] == 1


def test_a_slow_client_still_gets_a_long_answer_whole(served: Served) -> None:
    client = connect(served)
    ((_, _, _, result),) = ask(served, client, msgpack.packb([0, 1, "long", {}]))
    assert len(result) == 300_000


def test_a_newcomer_takes_the_place_of_the_client_that_was_still_for_longest(served: Served) -> None:
    clients = [connect(served) for _ in range(MOST_CLIENTS)]
    serve(served, MOST_CLIENTS + 2)
    assert ask(served, clients[0], msgpack.packb([0, 1, "echo", {}]))
    late = connect(served)
    assert ask(served, late, msgpack.packb([0, 2, "echo", {}])) == [[1, 2, None, {}]]
    assert clients[1].recv(1) == b""
    assert ask(served, clients[0], msgpack.packb([0, 3, "echo", {}]))


def test_a_busy_client_does_not_delay_the_others(served: Served) -> None:
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
    assert list(unpacked(other.recv(4096))) == [[1, 1, None, {}]]


def test_a_wish_counts_although_its_client_has_hung_up(served: Served) -> None:
    done: list[str] = []
    served.methods = METHODS | {"disarm": lambda params, caller: done.append("disarm")}
    busy, gone = connect(served), connect(served)
    serve(served, 3)
    busy.sendall(b"".join(msgpack.packb([0, number, "echo", {}]) for number in range(5)))
    gone.sendall(msgpack.packb([0, 1, "long", {}]) + msgpack.packb([0, 2, "disarm", {}]))
    gone.close()
    serve(served, 30)
    assert done == ["disarm"]
    assert len(served._clients) == 1


def test_a_client_that_has_no_more_to_ask_still_gets_a_long_answer_whole(served: Served) -> None:
    client = connect(served)
    client.sendall(msgpack.packb([0, 1, "long", {}]))
    client.shutdown(socket.SHUT_WR)
    serve(served, 10)  # before it fetches anything
    client.setblocking(False)
    received = bytearray()
    for _ in range(50):
        served.tick()
        with contextlib.suppress(BlockingIOError):
            received += client.recv(65536)
    ((_, _, _, result),) = unpacked(bytes(received))
    assert len(result) == 300_000
    assert served._clients == {}


def test_many_short_requests_at_once_are_all_answered(served: Served) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, number, "echo", {}]) for number in range(600)))
    client.setblocking(False)
    received = bytearray()
    for _ in range(2000):
        served.tick()
        with contextlib.suppress(BlockingIOError):
            received += client.recv(65536)
    assert [number for _, number, _, _ in unpacked(bytes(received))] == list(range(600))


def test_a_method_with_a_bug_answers_so_and_is_reported(served: Served) -> None:
    said: list[str] = []
    served.report_bug = said.append
    served.methods = {"broken": lambda params, caller: params["missing"]}
    ((_, _, error, _),) = ask(served, connect(served), msgpack.packb([0, 1, "broken", {}]))
    assert "bug" in error and said == ["broken failed: KeyError: 'missing'"]


def test_a_client_that_vanishes_with_a_request_under_way_does_no_harm(served: Served) -> None:
    client = connect(served)
    client.sendall(msgpack.packb([0, 1, "long", {}]))
    client.close()
    serve(served)
    assert ask(served, connect(served), msgpack.packb([0, 2, "echo", {}]))


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200))
def test_no_bytes_make_it_raise(served: Served, garbage: bytes) -> None:
    client = connect(served)
    client.sendall(garbage)
    serve(served, 4)
    client.close()
    serve(served, 3)


VALID = [msgpack.packb([0, number, "echo", {"a": number}]) for number in range(4)]
ODD = st.one_of(
    st.binary(max_size=60),
    st.builds(lambda data, place: data[: place % len(data)], st.sampled_from(VALID), st.integers(0, 99)),
    st.builds(
        lambda data, place, byte: data[: place % len(data)] + bytes([byte]) + data[place % len(data) + 1 :],
        st.sampled_from(VALID),
        st.integers(0, 99),
        st.integers(0, 255),
    ),
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(ODD, max_size=4), st.integers(0, 4), st.integers(0, 200))
def test_valid_requests_are_answered_whatever_comes_after(
    served: Served, odd: list[bytes], valid: int, cut: int
) -> None:
    client, reference = connect(served), connect(served)
    data = b"".join(VALID[:valid] + odd)
    answers = ask(served, client, data[:cut]) if cut else []
    with contextlib.suppress(BrokenPipeError):
        answers += ask(served, client, data[cut:])
    assert [[1, n, None, {"a": n}] for n in range(valid)] == answers[:valid]
    assert ask(served, reference, VALID[1]) == [[1, 1, None, {"a": 1}]]
    client.close()
    reference.close()
    serve(served, 6)
