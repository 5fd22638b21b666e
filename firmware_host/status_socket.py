"""MessagePack-RPC over a Unix stream socket, served between two ticks.

A request is [0, id, method, params], its answer [1, id, error, result] (the MessagePack-RPC specification). The loop
calls `serve` once a tick: it never waits, answers at most one request, clients in turn, and gives every client bounded
buffers. Whoever sends something else is told so and disconnected; when there is no room, the client that has been
still for longest makes some. A method that fails answers so and is reported: no report stops a robot.
"""

from __future__ import annotations

import errno
import os
import select
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgpack

REQUEST, RESPONSE = 0, 1
MOST_CLIENTS = 16
LONGEST_REQUEST = 4 * 1024  # bytes
LONGEST_BACKLOG = 1024 * 1024  # bytes of answers that a client has not fetched
READ_BYTES = LONGEST_REQUEST
WRITE_BYTES = 64 * 1024
SOCKET_MODE = 0o660

NOTHING = object()

Methods = Mapping[str, Callable[[dict[str, Any]], Any]]


class RefusedError(Exception):
    """A request that was understood and will not be done; the text says why."""


class AlreadyServedError(Exception):
    """Another daemon answers on this socket."""


class Client:
    """Owns what one connection has sent and not yet fetched."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.unpacker = msgpack.Unpacker(max_buffer_size=LONGEST_REQUEST + READ_BYTES, raw=False)
        self.outgoing = bytearray()
        self.closing = False  # told off: no more is read or answered
        self.ended = False  # it has hung up: what it asked before still counts

    def send(self, message: list[Any]) -> None:
        self.outgoing += msgpack.packb(message)

    def flush(self) -> None:
        """Raises OSError where the client is gone."""
        while self.outgoing:
            try:
                sent = self.connection.send(self.outgoing[:WRITE_BYTES])
            except BlockingIOError:
                return
            del self.outgoing[:sent]


class StatusSocket:
    """Bound and listening from the start on; `methods`, once set, take the params of a request as a dict."""

    def __init__(self, path: Path, methods: Methods, report_bug: Callable[[str], None] = lambda sentence: None) -> None:
        self.path = path
        self.methods = methods
        self.report_bug = report_bug
        self._listener = _listen(path)
        self._poll = select.epoll()
        self._poll.register(self._listener.fileno(), select.EPOLLIN)
        self._clients: dict[int, Client] = {}  # the one that has been still for longest comes first
        self._waiting: dict[int, None] = {}  # in turn: clients that may have a request not yet answered
        self.garbled_requests = 0

    def serve(self) -> None:
        for descriptor, events in self._poll.poll(0.0):
            if descriptor == self._listener.fileno():
                self._accept()
            elif descriptor in self._clients:
                self._attend(descriptor, events)
        if self._waiting:
            descriptor = next(iter(self._waiting))
            del self._waiting[descriptor]
            self._answer_one(descriptor)

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:  # the client left again before it was let in
            return
        if len(self._clients) >= MOST_CLIENTS:
            still = (descriptor for descriptor in self._clients if descriptor not in self._waiting)
            self._drop(next(still, next(iter(self._clients))))
        connection.setblocking(False)
        self._clients[connection.fileno()] = Client(connection)
        self._poll.register(connection.fileno(), select.EPOLLIN)

    def _attend(self, descriptor: int, events: int) -> None:
        """Read, unless something of this client still waits for its turn: the kernel keeps the rest."""
        client = self._clients[descriptor] = self._clients.pop(descriptor)  # to the end of the order
        if events & (select.EPOLLIN | select.EPOLLHUP) and descriptor not in self._waiting and not client.ended:
            try:
                data = client.connection.recv(READ_BYTES)
                client.ended = not data
                client.unpacker.feed(data)
                self._waiting[descriptor] = None
            except msgpack.BufferFull:
                self._reject(client, None, f"a request must be shorter than {LONGEST_REQUEST} bytes")
            except OSError:
                return self._drop(descriptor)
        return self._settle(descriptor)

    def _answer_one(self, descriptor: int) -> None:
        client = self._clients.get(descriptor)
        if client is None or client.closing:
            return
        try:
            message = next(client.unpacker, NOTHING)
        except (ValueError, msgpack.UnpackException, RecursionError):  # bytes that are not MessagePack
            self._reject(client, None, "not a MessagePack message")
        else:
            if message is not NOTHING:
                self._waiting[descriptor] = None  # there may be another one behind it
                self._answer(client, message)
        self._settle(descriptor)

    def _answer(self, client: Client, message: Any) -> None:
        if not _is_request(message):
            return self._reject(client, None, "a request is [0, id, method, params]")
        _, number, method, params = message
        if method not in self.methods:
            known = ", ".join(sorted(self.methods))
            return client.send([RESPONSE, number, f"no method {method!r}; there are {known}", None])
        try:
            return client.send([RESPONSE, number, None, self.methods[method](_as_dict(params))])
        except RefusedError as refusal:
            return client.send([RESPONSE, number, str(refusal), None])
        except Exception as problem:  # noqa: BLE001 - the robot walks on while a report fails
            self.report_bug(f"{method} failed: {type(problem).__name__}: {problem}")
            return client.send([RESPONSE, number, f"{method} failed: this is a bug, the log says more", None])

    def _reject(self, client: Client, number: int | None, sentence: str) -> None:
        self.garbled_requests += 1
        client.send([RESPONSE, number, sentence, None])
        client.closing = True

    def _settle(self, descriptor: int) -> None:
        """Send what can be sent; drop a client that is told off, does not fetch its answers, or is done with."""
        client = self._clients[descriptor]
        try:
            client.flush()
        except OSError:  # nobody fetches the answers any more; what was asked before still counts
            client.ended = True
            client.outgoing.clear()
            self._waiting.setdefault(descriptor)
        done = client.ended and descriptor not in self._waiting and not client.outgoing
        if done or client.closing or len(client.outgoing) > LONGEST_BACKLOG:
            return self._drop(descriptor)
        wanted = 0 if client.ended else select.EPOLLIN
        return self._poll.modify(descriptor, wanted | (select.EPOLLOUT if client.outgoing else 0))

    def _drop(self, descriptor: int) -> None:
        client = self._clients.pop(descriptor)
        self._poll.unregister(descriptor)
        client.connection.close()
        self._waiting.pop(descriptor, None)

    def close(self) -> None:
        for descriptor in list(self._clients):
            self._drop(descriptor)
        self._poll.close()
        self._listener.close()
        self.path.unlink(missing_ok=True)


def _is_request(message: Any) -> bool:
    return (
        isinstance(message, list)
        and len(message) == 4
        and message[0] == REQUEST
        and isinstance(message[1], int)
        and isinstance(message[2], str)
        and isinstance(message[3], list | dict)
    )


def _as_dict(params: list[Any] | dict[Any, Any]) -> dict[str, Any]:
    """Params come as a dict, or as the specification's list holding one."""
    if isinstance(params, list):
        params = params[0] if params else {}
    if not isinstance(params, dict) or not all(isinstance(key, str) for key in params):
        raise RefusedError("params must be a map from names to values")
    return params


def _listen(path: Path) -> socket.socket:
    """Raises AlreadyServedError, or OSError where the path cannot be bound."""
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_stale(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listener.setblocking(False)
    listener.bind(str(path))
    os.chmod(path, SOCKET_MODE)
    listener.listen(MOST_CLIENTS)
    return listener


def _remove_stale(path: Path) -> None:
    """A socket that nobody answers was left behind by a daemon that died."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except FileNotFoundError:
            return
        except ConnectionRefusedError:
            if not path.is_socket():
                raise FileExistsError(errno.EEXIST, "is a file and no socket", str(path)) from None
            path.unlink()
            return
    raise AlreadyServedError(f"another daemon is already running on {path}")
