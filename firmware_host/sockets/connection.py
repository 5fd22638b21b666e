"""One client of the status socket: its buffers, its request rate and its time limit."""

import socket
from math import inf
from typing import Any, NamedTuple

import msgpack

from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import LONGEST_REQUEST, SHAPE, TOO_LONG, MalformedError, make_unpacker
from firmware_host.sockets.socket_methods import Level

READ_BYTES = LONGEST_REQUEST
WRITE_BYTES = 64 * 1024  # at once
LONGEST_BACKLOG = 1024 * 1024  # bytes of answers that a client has not fetched
REQUESTS_PER_S, BURST = 200.0, 50.0  # of one client
LONGEST_SENDING_S = 5.0  # of one request

NOTHING = object()


class Caller(NamedTuple):
    """The sender of a request. Connections are numbered since the start, since descriptors are reused."""

    connection: int
    peer: Peer
    level: Level

    def __str__(self) -> str:
        return f"uid {self.peer.uid} (process {self.peer.pid})"


class Client:
    """Owns one connection, its buffers and its budget of requests."""

    def __init__(self, connection: socket.socket, caller: Caller) -> None:
        self.connection = connection
        self.caller = caller
        self.budget, self._budget_s = BURST, -inf
        self.outgoing = bytearray()
        self.closing = False  # rejected: nothing more is read or answered
        self.ended = False  # disconnected: its earlier requests still count
        self.watched = 0  # the epoll events that this client is registered for
        self._unpacker = make_unpacker(READ_BYTES)
        self._received = self._read = 0  # bytes in total, and bytes of complete messages
        self._begun_s = inf  # when the first part of an incomplete request arrived

    def may_request(self, now_s: float) -> bool:
        """Fill the token bucket: BURST requests at once, REQUESTS_PER_S in the long run. Each request takes one."""
        self.budget = min(BURST, self.budget + REQUESTS_PER_S * max(0.0, now_s - self._budget_s))
        self._budget_s = now_s
        return self.budget >= 1.0

    def receive(self) -> None:
        """Raise OSError, or MalformedError for a request that is too long."""
        data = self.connection.recv(READ_BYTES)
        self.ended = not data
        self._received += len(data)
        try:
            self._unpacker.feed(data)
        except msgpack.BufferFull:
            raise MalformedError(TOO_LONG) from None

    def next_message(self, now_s: float) -> Any:
        """Return the next message or NOTHING; raises MalformedError if it is too long or no MessagePack."""
        try:
            message = next(self._unpacker, NOTHING)
        except (ValueError, msgpack.UnpackException, RecursionError):
            raise MalformedError(SHAPE) from None
        end = self._received if message is NOTHING else self._unpacker.tell()
        if end - self._read > LONGEST_REQUEST:  # the unpacker bounds only each part of a message
            raise MalformedError(TOO_LONG)
        if message is not NOTHING:
            self._read, self._begun_s = end, inf
        elif end > self._read:
            self._begun_s = min(self._begun_s, now_s)
        return message

    def is_overdue(self, now_s: float) -> bool:
        """Return whether the rest of a request has been missing for too long."""
        return now_s - self._begun_s > LONGEST_SENDING_S

    def send(self, message: list[Any]) -> None:
        self.outgoing += msgpack.packb(message)

    def flush(self) -> None:
        """Send as much as fits; raises OSError if the client is gone."""
        if not self.outgoing:
            return
        try:
            sent = self.connection.send(self.outgoing[:WRITE_BYTES])
        except BlockingIOError:
            return
        del self.outgoing[:sent]
