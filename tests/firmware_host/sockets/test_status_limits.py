"""No client excludes others from the status socket by speed, slowness, or number."""

import contextlib
import socket
from pathlib import Path

import msgpack
import pytest

from firmware_host.lease import Lease
from firmware_host.sockets.connection import BURST, LONGEST_SENDING_S, REQUESTS_PER_S, Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import NOT_PERMITTED
from firmware_host.sockets.socket_methods import METHODS as SOCKET_METHODS
from firmware_host.sockets.status_socket import MOST_CLIENTS
from tests.firmware_host.sockets.served_socket import (
    METHODS,
    OPERATOR,
    OTHER_USER,
    READER,
    RIGHTS,
    Served,
    ask,
    connect,
    is_open,
    serve,
    stops_of,
    unpacked,
)

ECHO = msgpack.packb([0, 1, "echo", {}])
STOP = msgpack.packb([0, 2, "stop", {}])


def allow_every_user(served: Served, monkeypatch: pytest.MonkeyPatch) -> list[Caller]:
    """Permit `echo` to every user; returns the list of callers that stopped the robot."""
    monkeypatch.setitem(SOCKET_METHODS, "echo", SOCKET_METHODS["stop"])
    return stops_of(served)


def flood(clients: list[socket.socket], data: bytes) -> None:
    """Send as much as each client can; the answers are discarded."""
    for client in clients:
        client.setblocking(False)
        with contextlib.suppress(OSError):
            while client.recv(65536):
                pass
        with contextlib.suppress(OSError):
            while True:
                client.send(data)


@pytest.mark.parametrize("data", [ECHO * 20, ECHO * 20 + ECHO[:3], ECHO[:3], STOP * 20], ids=str)
def test_a_stop_among_flooding_clients_is_served_within_one_turn(
    served: Served, monkeypatch: pytest.MonkeyPatch, data: bytes
) -> None:
    stopped = allow_every_user(served, monkeypatch)
    flooding = [connect(served, OTHER_USER) for _ in range(MOST_CLIENTS - 1)]
    serve(served, MOST_CLIENTS)
    longest = 0
    for _ in range(20):
        flood(flooding, data)
        served.tick()
        operator = connect(served, OPERATOR)
        operator.sendall(STOP)
        ticks = 0
        while not any(caller.peer == OPERATOR for caller in stopped):
            flood(flooding, data)
            served.tick()
            ticks += 1
            assert ticks < 100
        longest = max(longest, ticks)
        stopped.clear()
        operator.close()
        serve(served, 3)
    assert longest <= 1 + MOST_CLIENTS  # a tick until it is accepted, then one turn


def test_requests_beyond_the_rate_wait_and_none_is_lost(served: Served) -> None:
    fast, other = connect(served), connect(served, READER)
    serve(served, 4)
    fast.sendall(ECHO * 400)
    fast.setblocking(False)
    begin_s, answers = served.now_s, msgpack.Unpacker(raw=False)
    times_s = []
    for _ in range(1500):
        served.tick()
        with contextlib.suppress(BlockingIOError):
            answers.feed(fast.recv(65536))
        times_s += [served.now_s - begin_s for _ in answers]
    assert len(times_s) == 400
    assert all(number < BURST + REQUESTS_PER_S * t_s + 1.0 for number, t_s in enumerate(times_s))
    assert ask(served, other, msgpack.packb([0, 1, "status", {}]))


def test_a_client_that_does_not_complete_a_request_is_dropped(served: Served) -> None:
    slow, idle = connect(served), connect(served)
    serve(served, 4)
    slow.sendall(ECHO + ECHO[:4])
    serve(served, 6)
    served.now_s += 0.9 * LONGEST_SENDING_S
    slow.sendall(ECHO[4:5])  # a further byte does not extend the time
    serve(served, 6)
    assert served.counters["dropped_slow_clients"] == 0
    served.now_s += 0.2 * LONGEST_SENDING_S
    serve(served, 1)
    assert served.counters["dropped_slow_clients"] == 1
    assert len(list(unpacked(slow.recv(4096)))) == 1 and slow.recv(1) == b""
    served.now_s += 1e6
    serve(served, 2)
    assert ask(served, idle, ECHO)  # a client without a request may stay


def test_a_request_in_two_parts_is_answered_if_the_second_is_in_time(served: Served) -> None:
    client = connect(served)
    for _ in range(3):  # each request has its own time
        assert ask(served, client, ECHO[:4]) == []
        served.now_s += 0.8 * LONGEST_SENDING_S
        assert ask(served, client, ECHO[4:]) == [[1, 1, None, {}]]


@pytest.mark.parametrize(
    ("peer", "allowed"),
    [
        (OTHER_USER, {"hello", "stop", "disarm"}),
        (READER, {"hello", "stop", "disarm", "status", "strides", "map", "check"}),
        (OPERATOR, None),
        (Peer(1, 0, frozenset({0})), None),
        (Peer(1, 1, frozenset()), None),  # the daemon's own user
    ],
)
def test_each_level_permits_its_methods(served: Served, peer: Peer, allowed: set[str] | None) -> None:
    methods = ["hello", "stop", "disarm", "status", "strides", "map", "check"]
    methods += ["arm", "walk", "clear", "lease", "release", "reset_timing", "fail"]
    served.methods = {method: METHODS["echo"] for method in methods}
    client = connect(served, peer)
    done = {method for method in methods if ask(served, client, msgpack.packb([0, 1, method, {}]))[0][2] is None}
    assert done == (set(methods) if allowed is None else allowed)
    assert served.counters["not_permitted"] == len(methods) - len(done)


def test_one_user_s_connections_do_not_exclude_other_users(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = allow_every_user(served, monkeypatch)
    operator, reader = connect(served, OPERATOR), connect(served, READER)
    others = []
    for _ in range(4 * MOST_CLIENTS):
        others.append(connect(served, OTHER_USER))
        served.tick()
    assert is_open(operator) and is_open(reader)  # although they were silent the longest
    late = connect(served, Peer(9, 1009, frozenset()))
    late.sendall(STOP)
    serve(served, 6)
    assert [caller.peer.uid for caller in stopped] == [1009]
    assert served.counters["clients"] == MOST_CLIENTS


def test_among_users_with_equal_connections_the_newcomer_s_user_loses_one(served: Served) -> None:
    gone: list[Caller] = []
    served.on_hang_up = gone.append
    others = [connect(served, READER) for _ in range(MOST_CLIENTS // 2)]  # silent the longest
    own = [connect(served, OPERATOR) for _ in range(MOST_CLIENTS // 2)]
    serve(served, MOST_CLIENTS)
    late = connect(served, OPERATOR)
    serve(served, 2)
    assert all(map(is_open, others)) and [is_open(client) for client in own] == [False] + [True] * (len(own) - 1)
    assert is_open(late) and [caller.connection for caller in gone] == [1 + len(others)]  # the end is reported


def test_a_newcomer_is_not_dropped_for_an_event_of_the_client_whose_descriptor_it_got(served: Served) -> None:
    others = [connect(served, OTHER_USER) for _ in range(MOST_CLIENTS)]
    serve(served, MOST_CLIENTS)
    newcomers = [connect(served, READER) for _ in range(2)]  # both are accepted in the tick that also hears others[0]
    others[0].sendall(ECHO)
    served.tick()
    assert served.counters["dropped_for_others"] == 2 and not is_open(others[0])
    assert all(map(is_open, newcomers)) and served.counters["clients"] == MOST_CLIENTS


def test_among_single_connections_the_least_privileged_is_dropped(served: Served) -> None:
    for _ in range(3):
        connect(served, OPERATOR).close()  # earlier connections do not count
        serve(served, 3)
    operator = connect(served, OPERATOR)
    others = [connect(served, Peer(9, 2000 + index, frozenset())) for index in range(MOST_CLIENTS - 1)]
    serve(served, MOST_CLIENTS)
    connect(served, Peer(9, 3000, frozenset()))
    serve(served, 2)
    assert is_open(operator) and not is_open(others[0]) and is_open(others[1])
    assert served.counters["dropped_for_others"] == 1


def test_a_user_without_rights_is_refused_with_a_message(short_folder: Path) -> None:
    strict = Served(short_folder / "strict", RIGHTS._replace(anyone_may_stop=False))
    other_user, reader, operator = (connect(strict, peer) for peer in (OTHER_USER, READER, OPERATOR))
    serve(strict)
    ((_, number, refused, result),) = unpacked(other_user.recv(65536))
    assert (number, result) == (None, None) and not is_open(other_user)
    assert refused.startswith(f"{NOT_PERMITTED}this robot is for members of the group viewers. Have root run")
    assert is_open(reader) and is_open(operator)
    assert (strict.counters["clients"], strict.counters["not_permitted"]) == (2, 1)
    strict.close()


def test_the_holder_of_the_lease_is_never_dropped_for_a_newcomer(served: Served) -> None:
    served.is_protected = lambda caller: caller.connection == 1
    clients = [connect(served, OPERATOR) for _ in range(MOST_CLIENTS)]  # the first one is silent the longest
    serve(served, MOST_CLIENTS)
    connect(served, OPERATOR)
    serve(served, 2)
    assert [is_open(client) for client in clients[:3]] == [True, False, True]


def test_a_disconnection_is_reported_with_its_caller(served: Served) -> None:
    gone: list[Caller] = []
    served.on_hang_up = gone.append
    served.methods = {"whoami": lambda params, caller: str(caller)}
    first, second = connect(served), connect(served)
    assert ask(served, first, msgpack.packb([0, 1, "whoami", {}])) == [[1, 1, None, "uid 1000 (process 500)"]]
    first.close()
    serve(served, 3)
    third = connect(served)  # gets the file descriptor of the first
    serve(served, 3)
    assert {caller.connection for caller in gone} == {1}
    third.close()
    second.close()
    serve(served, 3)
    assert {caller.connection for caller in gone} == {1, 2, 3}


def test_a_disconnection_is_reported_before_its_requests_are_answered(served: Served) -> None:
    gone: list[Caller] = []
    served.on_hang_up = gone.append
    served.is_protected = lambda caller: True  # it holds the lease
    client = connect(served)
    serve(served, 3)
    client.sendall(ECHO * 1000)
    serve(served, 3)
    client.close()
    serve(served, 1)
    assert gone


def test_the_last_requests_of_an_overruled_program_are_refused_after_its_end(served: Served) -> None:
    lease, refusals = Lease(), []
    served.on_hang_up, served.is_protected = lease.hang_up, lambda caller: caller == lease.holder
    served.methods = {
        "lease": lambda params, caller: lease.renew(caller, served.now_s, 5.0),
        "move": lambda params, caller: refusals.append(lease.refusal(caller, served.now_s)),
    }
    client = connect(served)
    assert ask(served, client, msgpack.packb([0, 1, "lease", {}])) == [[1, 1, None, None]]
    client.sendall(msgpack.packb([0, 2, "move", {}]) * 3)
    lease.oust("another operator")
    client.close()
    serve(served, 6)
    assert len(refusals) == 3 and all(refusals)
