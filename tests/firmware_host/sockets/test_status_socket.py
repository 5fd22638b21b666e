"""The status socket answers valid requests, rejects others, and never blocks the loop."""

import contextlib
import socket
from typing import Any

import msgpack
import pytest

from tests.firmware_host.sockets.served_socket import METHODS, Served, ask, connect, serve, unpacked


@pytest.mark.parametrize(("params", "echoed"), [({"a": 1}, {"a": 1}), ([{"a": 1}], {"a": 1}), ([], {})])
def test_a_request_is_answered_by_its_number_and_params_may_be_in_a_list(
    served: Served, params: Any, echoed: dict[str, int]
) -> None:
    assert ask(served, connect(served), msgpack.packb([0, 7, "echo", params])) == [[1, 7, None, echoed]]


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


def test_a_client_that_does_not_fetch_its_answers_is_dropped(served: Served) -> None:
    client = connect(served)
    client.sendall(b"".join(msgpack.packb([0, n, "long", {}]) for n in range(20)))
    serve(served, 60)
    with pytest.raises((BrokenPipeError, ConnectionResetError)):
        for _ in range(100):
            client.sendall(b"\xc0")
            served.tick()
    assert served.counters["dropped_slow_clients"] == 1


def test_a_request_counts_although_its_client_has_disconnected(served: Served) -> None:
    done: list[str] = []
    served.methods = METHODS | {"disarm": lambda params, caller: done.append("disarm")}
    busy, gone = connect(served), connect(served)
    serve(served, 3)
    busy.sendall(b"".join(msgpack.packb([0, number, "echo", {}]) for number in range(5)))
    gone.sendall(msgpack.packb([0, 1, "long", {}]) + msgpack.packb([0, 2, "disarm", {}]))
    gone.close()
    serve(served, 30)
    assert done == ["disarm"]
    assert served.counters["clients"] == 1


def test_a_client_that_stopped_sending_still_gets_a_long_answer(served: Served) -> None:
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
    assert served.counters["clients"] == 0


def test_a_method_with_a_bug_answers_so_and_is_reported(served: Served) -> None:
    said: list[str] = []
    served.report_bug = said.append
    served.methods = {"broken": lambda params, caller: params["missing"]}
    ((_, _, error, _),) = ask(served, connect(served), msgpack.packb([0, 1, "broken", {}]))
    assert "bug" in error and said == ["broken failed: KeyError: 'missing'"]
