"""MessagePack-RPC over a Unix stream socket, served between two ticks.

The loop calls `serve` once a tick. It never waits, answers at most one request, and takes the clients in turn. Every
client has bounded buffers, a bounded rate and a bounded time to send a request: faster requests wait in the kernel, and
malformed ones get an error and end the connection. When all connections are in use, the user with the most of them
loses one, so that no user can exclude another; the holder of the lease keeps its own. A method with a bug answers with
an error and is logged: it does not stop the robot.
"""

import select
import socket
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgpack

from firmware_host.operator.connection import LONGEST_BACKLOG, NOTHING, Caller, Client
from firmware_host.operator.rights import Peer, Rights, read_peer
from firmware_host.operator.rpc import RESPONSE, MalformedError, RefusedError, read_params, read_shape
from firmware_host.operator.socket_file import SocketFile

MOST_CLIENTS = 16

Methods = Mapping[str, Callable[[dict[str, Any], Caller], Any]]


class StatusSocket:
    """Listens from the start on; each of `methods` takes the params of a request and its sender."""

    def __init__(
        self,
        path: Path,
        methods: Methods,
        rights: Rights,
        peer_of: Callable[[socket.socket], Peer] = read_peer,
    ) -> None:
        """Raises AlreadyServedError, or OSError if the path cannot be bound."""
        self.path = path
        self.methods = methods
        self.report_bug: Callable[[str], None] = lambda message: None
        self.on_hang_up: Callable[[Caller], None] = lambda caller: None  # may be called twice for one client
        self.is_protected: Callable[[Caller], bool] = lambda caller: False  # its disconnection would stop the robot
        self._rights = rights
        self._peer_of = peer_of
        self._file = SocketFile(path, MOST_CLIENTS)
        self._listener = self._file.listener
        self._poll = select.epoll()
        self._poll.register(self._listener.fileno(), select.EPOLLIN)
        self._clients: dict[int, Client] = {}  # ordered by their last message, oldest first
        self._waiting: dict[int, None] = {}  # clients that may have an unanswered request, in turn
        self._accepted = self._malformed = self._not_permitted = self._too_slow = self._made_room = 0

    @property
    def counters(self) -> dict[str, int]:
        """Counts since the start, and the number of present clients."""
        return {
            "clients": len(self._clients),
            "accepted_clients": self._accepted,
            "malformed_requests": self._malformed,
            "not_permitted": self._not_permitted,
            "dropped_slow_clients": self._too_slow,
            "dropped_for_others": self._made_room,
        }

    def serve(self, now_s: float) -> None:
        """Accept, read and send as far as possible without waiting, and answer at most one request."""
        for descriptor, events in self._poll.poll(0.0):
            if descriptor == self._listener.fileno():
                self._accept()
            elif descriptor in self._clients:
                self._handle_events(descriptor, events)
        self._answer_next(now_s)
        for descriptor in [each for each, client in self._clients.items() if client.is_overdue(now_s)]:
            self._too_slow += 1
            self._drop(descriptor)

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:  # the client disconnected before it was accepted
            return None
        try:
            peer = self._peer_of(connection)
        except OSError:
            return connection.close()
        level = self._rights.level(peer)
        connection.setblocking(False)
        refused = self._rights.refusal_to_connect(level)
        if refused:
            self._not_permitted += 1
            with connection, suppress(OSError):  # the client may have disconnected already
                connection.send(msgpack.packb([RESPONSE, None, refused, None]))
            return None
        self._accepted += 1
        if len(self._clients) >= MOST_CLIENTS:
            self._drop_for(peer)
        caller = Caller(self._accepted, peer, level)
        client = self._clients[connection.fileno()] = Client(connection, caller)
        client.watched = select.EPOLLIN
        return self._poll.register(connection.fileno(), client.watched)

    def _drop_for(self, newcomer: Peer) -> None:
        """Drop the longest silent client of the user with the most connections; of equal users, the less privileged."""
        connections = Counter(client.caller.peer.uid for client in self._clients.values())
        connections[newcomer.uid] += 1

        def claim(descriptor: int) -> tuple[int, int, bool]:
            caller = self._clients[descriptor].caller
            return connections[caller.peer.uid], -caller.level, descriptor not in self._waiting

        candidates = [each for each, client in self._clients.items() if not self.is_protected(client.caller)]
        self._made_room += 1
        self._drop(max(candidates or self._clients, key=claim))  # the first of equals

    def _handle_events(self, descriptor: int, events: int) -> None:
        """Read from a client, unless an earlier request of it still waits; further data stays in the kernel."""
        client = self._clients[descriptor]
        if events & select.EPOLLHUP:
            self.on_hang_up(client.caller)
        if events & (select.EPOLLIN | select.EPOLLHUP) and descriptor not in self._waiting and not client.ended:
            self._clients[descriptor] = self._clients.pop(descriptor)  # to the end of the order
            try:
                client.receive()
                self._waiting[descriptor] = None
            except MalformedError as problem:
                self._reject(client, str(problem))
            except OSError:
                return self._drop(descriptor)
        return self._flush(descriptor)

    def _answer_next(self, now_s: float) -> None:
        """Answer the first client in turn whose request rate permits it."""
        for descriptor in self._waiting:
            if self._clients[descriptor].may_request(now_s):
                del self._waiting[descriptor]
                return self._answer_one(descriptor, now_s)
        return None

    def _answer_one(self, descriptor: int, now_s: float) -> None:
        client = self._clients[descriptor]
        try:
            message = client.next_message(now_s)
            request = None if message is NOTHING else read_shape(message)
        except MalformedError as problem:
            self._reject(client, str(problem))
        else:
            if request is not None:
                client.budget -= 1.0
                self._waiting[descriptor] = None  # another request may follow
                self._answer(client, *request)
        self._flush(descriptor)

    def _answer(self, client: Client, number: int, method: str, params: Any) -> None:
        if method not in self.methods:
            known = ", ".join(sorted(self.methods))
            return client.send([RESPONSE, number, f"no method {method!r}; there are {known}", None])
        refused = self._rights.refusal(method, client.caller.level)
        if refused:
            self._not_permitted += 1
            return client.send([RESPONSE, number, refused, None])
        try:
            return client.send([RESPONSE, number, None, self.methods[method](read_params(params), client.caller)])
        except RefusedError as refusal:
            return client.send([RESPONSE, number, str(refusal), None])
        except Exception as problem:  # noqa: BLE001 - the robot continues although a report fails
            self.report_bug(f"{method} failed: {type(problem).__name__}: {problem}")
            return client.send([RESPONSE, number, f"{method} failed: this is a bug, the log says more", None])

    def _reject(self, client: Client, message: str) -> None:
        self._malformed += 1
        client.send([RESPONSE, None, message, None])
        client.closing = True

    def _flush(self, descriptor: int) -> None:
        """Send pending answers; drop a client that is rejected, too slow, or finished."""
        client = self._clients[descriptor]
        try:
            client.flush()
        except OSError:  # the client has disconnected; its earlier requests still count
            client.ended = True
            client.outgoing.clear()
            self._waiting.setdefault(descriptor)
        slow = len(client.outgoing) > LONGEST_BACKLOG
        self._too_slow += slow
        done = client.ended and descriptor not in self._waiting and not client.outgoing
        if done or slow or client.closing:
            self._drop(descriptor)
        else:
            self._watch(client, descriptor in self._waiting)

    def _watch(self, client: Client, waits: bool) -> None:
        wanted = 0 if client.ended or waits else select.EPOLLIN
        wanted |= select.EPOLLOUT if client.outgoing else 0
        if wanted != client.watched:
            client.watched = wanted
            self._poll.modify(client.connection.fileno(), wanted)

    def _drop(self, descriptor: int) -> None:
        client = self._clients.pop(descriptor)
        self._poll.unregister(descriptor)
        client.connection.close()
        self._waiting.pop(descriptor, None)
        self.on_hang_up(client.caller)

    def close(self) -> None:
        for descriptor in list(self._clients):
            self._drop(descriptor)
        self._poll.close()
        self._file.close()
