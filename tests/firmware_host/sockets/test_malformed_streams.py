"""Whatever hostile, broken or hasty clients send, the socket of a real loop answers every valid request.

An example is what several clients send at once, each as an operator, a reader, an unauthorised user or root: valid
requests first, then random, mutated, truncated or nested data, in pieces.
"""

from collections.abc import Iterator
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.rights import Peer
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.firmware_host.sockets.served_socket import OPERATOR, OTHER_USER, READER, Served, ask, connect, unpacked

PEERS = (OPERATOR, READER, OTHER_USER, Peer(503, 0, frozenset({0})))
METHODS = ("hello", "status", "strides", "map", "check", "arm", "walk", "stop", "disarm", "clear", "lease", "release")
HEADERS: tuple[bytes, ...] = (
    *(b"\xdc\x20\x00", b"\xdd\x00\x00\x20\x00", b"\xde\x20\x00", b"\xdf\xff\xff\xff\xff", b"\x81\xa1a", b"\x94"),
    *(b"\xdb\x00\x00\x10\x00", b"\xc9\x00\x00\x10\x00\x05", b"\xc6\xff\xff\xff\xff", b"\x94\x00\x01", b"\xc1"),
)
VALUES = st.recursive(
    st.one_of(
        st.sampled_from([None, True, 0, 5, 0.02, msgpack.ExtType(7, b"abc"), msgpack.Timestamp(1, 2), "x" * 900]),
        st.integers(-(2**63), 2**64 - 1),
        st.floats(),
        st.text(max_size=9),
        st.binary(max_size=9),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=5,
)
PARAMS = st.dictionaries(st.sampled_from(("since", "strides", "depth_m", "for_s", "what")), VALUES)
REQUESTS = st.tuples(st.just(0), st.integers(100, 2**32), st.sampled_from(METHODS), PARAMS).map(msgpack.packb)
MUTATED = st.builds(
    lambda data, at, removed, inserted: data[:at] + inserted + data[at + removed :],
    st.lists(REQUESTS, min_size=1, max_size=8).map(b"".join),
    st.integers(0, 300),
    st.integers(0, 300),
    st.binary(max_size=3),
)
NESTED = st.builds(lambda header, times: (header * times)[:6000], st.sampled_from(HEADERS), st.integers(1, 1500))
STREAMS = st.tuples(
    st.sampled_from(PEERS),
    st.integers(0, 4),  # valid requests at its beginning, numbered from 1
    st.one_of(REQUESTS, VALUES.map(msgpack.packb), MUTATED, NESTED, st.binary(max_size=300)),
    st.integers(1, 400),  # the bytes of a piece
)


@pytest.fixture
def loop_s_socket(served: Served, configuration: Configuration) -> Iterator[tuple[Served, Lockstep]]:
    robot = Lockstep(configuration, Track([(1000.0, MUDS["48.5"])]))
    served.methods = OperatorCalls(robot.loop, [], lambda: robot.now_s).methods
    yield served, robot


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # one socket takes all examples
@given(st.lists(STREAMS, max_size=14))
def test_every_valid_request_is_answered(
    loop_s_socket: tuple[Served, Lockstep], streams: list[tuple[Peer, int, bytes, int]]
) -> None:
    served, robot = loop_s_socket
    bugs: list[str] = []
    served.report_bug = bugs.append
    robot.step()  # so that it executes the requests
    clients = [connect(served, peer) for peer, *_ in streams]
    for client, (_, valid, malformed, piece) in zip(clients, streams, strict=True):
        data = b"".join(msgpack.packb([0, number + 1, "hello", {}]) for number in range(valid)) + malformed
        for start in range(0, len(data), piece):
            send(client, data[start : start + piece])
            served.tick()
    served.tick(15 * 16)  # one request of all clients a tick
    answered = [numbers_of(client) for client in clients]
    assert [set(range(1, valid + 1)) - found for found, (_, valid, *_) in zip(answered, streams, strict=True)] == [
        set() for _ in streams
    ]
    for client in clients:
        client.close()
    served.tick()
    reference = connect(served)
    assert [answer[1] for answer in ask(served, reference, msgpack.packb([0, 7, "hello", {}]))] == [7]
    reference.close()
    assert bugs == []


def send(client: Any, data: bytes) -> None:
    try:
        client.sendall(data)
    except (BrokenPipeError, ConnectionResetError):  # refused after what it has sent before
        return


def numbers_of(client: Any) -> set[Any]:
    """Return the numbers of the requests that are answered."""
    client.setblocking(False)
    try:
        return {number for _, number, *_ in unpacked(client.recv(1 << 20))}
    except (BlockingIOError, ConnectionResetError):
        return set()
