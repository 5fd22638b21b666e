"""Malformed requests and parameters are refused with a message, within bounded memory."""

import tracemalloc
from math import inf, nan
from typing import Any

import msgpack
import pytest

from firmware_host.sockets.rpc import LONGEST_REQUEST, MOST_PARAMS
from tests.firmware_host.sockets.served_socket import Served, ask, connect, is_open, serve

NESTED: Any = []
for _ in range(900):
    NESTED = [NESTED]


@pytest.mark.parametrize(
    "message",
    [
        [0, 1, "echo", {str(n): n for n in range(MOST_PARAMS + 1)}],
        [0, True, "echo", {}],
        [False, 1, "echo", {}],
        [0, -1, "echo", {}],
        [0, 1, b"echo", {}],
        [0, 1, "e" * 3000, {}],
        [0, 1, "echo", {1: 2}],
        [0, 1, "echo", None],
        [0, 1, "echo", {}, 5],
        [0, 1, "echo", msgpack.ExtType(5, b"abc")],
        [],
        5,
        {"a": 1},
        [0, "x", "echo", {}],
        [0, 1, 5, {}],
    ],
    ids=lambda message: str(message)[:40],
)
def test_a_malformed_request_is_answered_with_the_expected_shape(served: Served, message: Any) -> None:
    client = connect(served)
    ((_, number, error, result),) = ask(served, client, msgpack.packb(message))
    assert (number, result) == (None, None) and error.startswith("a request is [0, id, method, params]")
    assert not is_open(client)


@pytest.mark.parametrize("data", [b"\xc1", b"GET / HTTP/1.1\r\n\r\n"])
def test_bytes_that_are_no_messagepack_end_the_connection(served: Served, data: bytes) -> None:
    client = connect(served)
    assert ask(served, client, data)[0][2]
    assert not is_open(client) and served.counters["malformed_requests"] == 1


@pytest.mark.parametrize(
    "value",
    [nan, inf, -inf, [[1]], [1.0, nan], NESTED, {"b": 1}, b"raw", msgpack.ExtType(5, b"abc"), msgpack.Timestamp(1, 2)],
    ids=lambda value: f"{type(value).__name__} {str(value)[:3]}",
)
def test_a_param_that_is_no_plain_value_is_refused_with_its_name(served: Served, value: Any) -> None:
    reached: list[Any] = []
    served.methods = {"note": lambda params, caller: reached.append(params)}
    client = connect(served)
    ((_, number, error, _),) = ask(served, client, msgpack.packb([0, 1, "note", {"a": value}]))
    assert number == 1 and error.startswith("a") and "must be a" in error
    assert reached == [] and is_open(client)


@pytest.mark.parametrize(
    "value", [2**64 - 1, -(2**63), "x" * 3000, True, None, 1e308, [0.02, 3] * 4], ids=lambda value: str(value)[:9]
)
def test_plain_values_arrive_as_they_are(served: Served, value: Any) -> None:
    ((_, _, error, result),) = ask(served, connect(served), msgpack.packb([0, 2**64 - 1, "echo", {"a": value}]))
    assert error is None and result == {"a": value}


@pytest.mark.parametrize("params", [[5], [NESTED], {b"a": 1}, [None], ["a"]], ids=["5", "nested", "bytes", "None", "a"])
def test_params_that_are_no_map_from_names_are_refused(served: Served, params: Any) -> None:
    client = connect(served)
    answers = ask(served, client, msgpack.packb([0, 1, "echo", params]))
    assert answers == [[1, 1, "params must be a map from names to values", None]]
    assert is_open(client)


@pytest.mark.parametrize(
    "header", [b"\xdc\x20\x00", b"\xdd\x00\x00\x20\x00", b"\xde\x20\x00", b"\x81\xa1a", b"\x94", b"\x98"], ids=bytes.hex
)
def test_headers_that_announce_long_data_take_no_memory(served: Served, header: bytes) -> None:
    """A thousand nested headers, each for 8192 elements, would make an unbounded unpacker take 65 MB."""
    clients = [connect(served) for _ in range(8)]
    serve(served, 10)
    tracemalloc.start()
    try:
        for client in clients:
            client.sendall((header * 1000)[:4000])
        serve(served, 30)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1_000_000


def tree(depth: int) -> Any:
    """Return nested params, each of them short."""
    return {str(index): tree(depth - 1) for index in range(MOST_PARAMS)} if depth else "x" * 20


def test_the_longest_request_is_answered_and_one_byte_more_is_not(served: Served) -> None:
    spare = LONGEST_REQUEST - len(msgpack.packb([0, 1, "echo", {"a": "x" * 1000}])) + 1000
    client = connect(served)
    for _ in range(3):
        assert len(ask(served, client, msgpack.packb([0, 1, "echo", {"a": "x" * spare}]))) == 1
        assert is_open(client)
    ((_, _, error, _),) = ask(served, client, msgpack.packb([0, 1, "echo", {"a": "x" * (spare + 1)}]))
    assert "at most" in error and not is_open(client)
