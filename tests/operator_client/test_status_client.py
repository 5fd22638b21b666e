"""The client matches answers to requests, and distinguishes a closed connection from an absent daemon."""

import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgpack
import pytest

from firmware_host.sockets import rpc
from operator_client.status_client import (
    CallRefusedError,
    DroppedError,
    NoDaemonError,
    NotPermittedError,
    StatusClient,
)

Ends = tuple[StatusClient, socket.socket]


@pytest.fixture
def ends(short_folder: Path) -> Iterator[Ends]:
    """Yield a client and the other end of its connection."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(short_folder / "s"))
        listener.listen()
        client = StatusClient(short_folder / "s", timeout_s=0.2)
        connection, _ = listener.accept()
        with connection:
            yield client, connection
        client.close()


def answer(ends: Ends, *messages: Any) -> Any:
    """Return the client's result for these messages, which arrive before its request."""
    client, connection = ends
    connection.sendall(b"".join(msgpack.packb(message) for message in messages))
    return client.call("status")


def test_a_parameter_may_have_any_name(ends: Ends) -> None:
    """The keys of a trial are an operator's own, such as the method that a walk compares."""
    client, connection = ends
    connection.sendall(msgpack.packb([rpc.RESPONSE, 1, None, "set"]))
    params = {"method": "adaptive", "self": "1"}
    assert client.call("trial_set", **params) == "set"
    assert msgpack.unpackb(connection.recv(4096))[2:] == ["trial_set", params]


@pytest.mark.parametrize(
    ("method", "params"),
    [("walk", {"depths_m": [0.02] * 9}), ("trial_set", {f"k{number}": "1" for number in range(17)})],
)
def test_a_request_for_which_the_daemon_closes_the_connection_is_not_sent(
    ends: Ends, method: str, params: dict[str, Any]
) -> None:
    client, connection = ends
    with pytest.raises(CallRefusedError, match=f"^{method}: a request has at most 16 params, arrays of at most 8$"):
        client.call(method, **params)
    connection.sendall(msgpack.packb([rpc.RESPONSE, 1, None, "idle"]))
    assert client.call("disarm") == "idle"
    assert msgpack.unpackb(connection.recv(4096))[2] == "disarm"


def test_an_answer_to_an_earlier_request_is_skipped(ends: Ends) -> None:
    """An answer stays unread if Ctrl-C interrupts its request."""
    assert answer(ends, [rpc.RESPONSE, 0, None, "old"], [rpc.RESPONSE, 1, None, "new"]) == "new"


def test_threads_that_share_a_client_get_their_own_answers(ends: Ends) -> None:
    """As where one thread renews the lease while another one works."""
    client, connection = ends

    def answer_each() -> None:
        unpacker = msgpack.Unpacker()
        while data := connection.recv(4096):
            unpacker.feed(data)
            for _, number, method, _ in unpacker:
                connection.sendall(msgpack.packb([rpc.RESPONSE, number, None, method]))

    methods = ["lease", "status"] * 100
    with ThreadPoolExecutor() as threads:
        threads.submit(answer_each)
        try:
            assert list(threads.map(client.call, methods)) == methods
        finally:
            client.close()


@pytest.mark.parametrize(
    ("number", "refusal", "raised", "message"),
    [
        (1, "arm first", CallRefusedError, "^arm first$"),
        (None, rpc.SHAPE, CallRefusedError, r"a request is \[0"),  # the current request
        (1, f"{rpc.NOT_PERMITTED}join", NotPermittedError, "^join$"),
    ],
)
def test_a_refusal_has_the_daemon_s_message_and_for_missing_rights_its_own_type(
    ends: Ends, number: int | None, refusal: str, raised: type[Exception], message: str
) -> None:
    with pytest.raises(raised, match=message):
        answer(ends, [rpc.RESPONSE, number, refusal, None])


@pytest.mark.parametrize("message", [5, None, [1, 2], "x" * 5000, {"a": 1}])
def test_a_malformed_answer_means_another_program(ends: Ends, message: Any) -> None:
    with pytest.raises(NoDaemonError, match="no mudskipper daemon"):
        answer(ends, message)


def test_a_silent_daemon_is_distinguished_from_an_absent_one(ends: Ends) -> None:
    with pytest.raises(DroppedError, match="does not answer: 'systemctl status"):
        answer(ends)


@pytest.mark.parametrize("before", [0, 1])
def test_a_connection_that_the_daemon_closed_is_reported(ends: Ends, before: int) -> None:
    client, connection = ends
    for _ in range(before):
        answer(ends, [rpc.RESPONSE, 1, None, "new"])
    connection.close()
    with pytest.raises(DroppedError, match="closed the connection: it is ending, or made room"):
        client.call("status")
    client.close()
    with pytest.raises(DroppedError, match="this client is closed"):
        client.call("status")


def test_after_a_restart_of_the_daemon_the_next_call_connects_again_and_no_request_is_repeated(
    ends: Ends, short_folder: Path
) -> None:
    client, connection = ends
    connection.close()
    with pytest.raises(DroppedError):
        client.call("walk")
    (short_folder / "s").unlink()
    with pytest.raises(NoDaemonError, match="no daemon answers"):
        client.call("walk")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(short_folder / "s"))
        listener.listen()
        with ThreadPoolExecutor() as threads:
            answered = threads.submit(client.call, "status")
            again, _ = listener.accept()
            with again:
                _, number, method, _ = msgpack.unpackb(again.recv(4096))
                again.sendall(msgpack.packb([rpc.RESPONSE, number, None, method]))
                assert answered.result() == "status"


def test_a_message_before_the_connection_closes_is_read(ends: Ends) -> None:
    client, connection = ends
    connection.sendall(msgpack.packb([rpc.RESPONSE, None, f"{rpc.NOT_PERMITTED}join", None]))
    connection.close()
    with pytest.raises(NotPermittedError, match="^join$"):
        client.call("status")


def test_a_full_queue_is_waited_for(short_folder: Path) -> None:
    """The queue may be full only for a moment."""
    with socket.socket(socket.AF_UNIX) as listener, socket.socket(socket.AF_UNIX) as before:
        listener.bind(str(short_folder / "s"))
        listener.listen(0)
        before.connect(str(short_folder / "s"))
        begin_s = time.monotonic()
        with pytest.raises(NoDaemonError):
            StatusClient(short_folder / "s", timeout_s=0.1)
        assert time.monotonic() - begin_s >= 0.09
