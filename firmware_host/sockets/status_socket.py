"""MessagePack-RPC over a Unix stream socket, served between two ticks.

The loop calls `serve` once a tick. It never waits, answers at most one request, and takes the clients in turn. Every
client has bounded buffers, a bounded rate and a bounded time to send a request: faster requests wait in the kernel, and
malformed ones get an error and end the connection. A method with a bug answers with an error and is logged: it does not
stop the robot.

There are two listeners. Every user may connect to the first one. The second one is for operators: the permissions of
its file admit them alone, so its queue and its places stay free when other accounts fill those of the first.
"""

import select
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgpack

from firmware_host.configuration.socket_paths import operators_path
from firmware_host.sockets.connection import LONGEST_BACKLOG, NOTHING, Caller, Client
from firmware_host.sockets.listener import Listener
from firmware_host.sockets.rights import Peer, Rights, read_peer
from firmware_host.sockets.rpc import RESPONSE, MalformedError, RefusedError, read_params, read_shape
from firmware_host.sockets.socket_file import SocketFile

MOST_CLIENTS, MOST_OPERATORS = 16, 8  # of the socket for every user, and of the operators' own
BACKLOG = 4096  # connections that wait to be accepted; the kernel limits it to net.core.somaxconn
MOST_ACCEPTS, ACCEPTING_S = 32, 0.0004  # in one tick: the time is 15 % of its period
REMEDY = "make the daemon's user a member of {group}, and permit @chown in the unit's SystemCallFilter="
MOST_EVENTS = 8  # handled in one tick; the kernel reports the others in the next ones, in turn

Methods = Mapping[str, Callable[[dict[str, Any], Caller], Any]]


class StatusSocket:
    """Listens from the start on; each of `methods` takes the params of a request and its sender."""

    def __init__(
        self,
        path: Path,
        methods: Methods,
        rights: Rights,
        peer_of: Callable[[socket.socket], Peer] = read_peer,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Raises AlreadyServedError, or OSError if a path cannot be bound."""
        self.path = path
        self.methods = methods
        self.report_bug: Callable[[str], None] = lambda message: None
        self.on_hang_up: Callable[[Caller], None] = lambda caller: None  # may be called twice for one client
        self.is_protected: Callable[[Caller], bool] = lambda caller: False  # its disconnection would stop the robot
        self._rights = rights
        self._peer_of = peer_of
        self.clock = clock
        self._for_everyone = Listener(SocketFile(path, BACKLOG), MOST_CLIENTS)
        self._for_operators = self._open_for_operators(path)
        self._turns = [self._for_operators, self._for_everyone]  # the next one to answer comes first
        self._poll = select.epoll()
        for listener in self._turns:
            self._poll.register(listener.file.listener.fileno(), select.EPOLLIN)
        self._listeners: dict[int, Listener] = {}  # of every client, by its descriptor
        self._accepted = self._malformed = self._not_permitted = self._too_slow = self._made_room = 0

    def _open_for_operators(self, path: Path) -> Listener:
        try:
            file = SocketFile(operators_path(path), BACKLOG, self._rights.operators.gid)
        except BaseException:
            self._for_everyone.file.close()
            raise
        return Listener(file, MOST_OPERATORS)

    @property
    def warnings(self) -> list[str]:
        """Return why operators share the socket of all users, if they do."""
        group = self._rights.operators.name
        problem = f"the group {group} cannot be given a socket of its own, so other accounts may delay its commands"
        return [] if self._for_operators.file.has_group else [f"{problem}: {REMEDY.format(group=group)}"]

    @property
    def counters(self) -> dict[str, int]:
        """Return the counts since the start, and the number of present clients."""
        return {
            "clients": len(self._listeners),
            "accepted_clients": self._accepted,
            "malformed_requests": self._malformed,
            "not_permitted": self._not_permitted,
            "dropped_slow_clients": self._too_slow,
            "dropped_for_others": self._made_room,
        }

    def serve(self, now_s: float) -> None:
        """Accept, read and send as far as possible without waiting, and answer at most one request."""
        for descriptor, events in self._poll.poll(0.0, MOST_EVENTS):
            if listener := self._listeners.get(descriptor):
                self._handle_events(listener, descriptor, events)
            else:
                self._accept_some(descriptor)
        self._answer_next(now_s)
        for listener in self._turns:
            for descriptor in [each for each, client in listener.clients.items() if client.is_overdue(now_s)]:
                self._too_slow += 1
                self._drop(descriptor)

    def _accept_some(self, descriptor: int) -> None:
        """Accept clients for a bounded time, and until a user loses its only connection: that one was just accepted."""
        listener = next((each for each in self._turns if each.file.listener.fileno() == descriptor), None)
        if listener is None:  # a client that was dropped while these events were handled
            return
        until_s = self.clock() + ACCEPTING_S
        for _ in range(MOST_ACCEPTS):
            if not self._accept(listener) or self.clock() >= until_s:
                return

    def _accept(self, listener: Listener) -> bool:
        """Accept one client; return whether another one may follow in this tick."""
        try:
            connection, _ = listener.file.listener.accept()
        except OSError:  # none waits, or it disconnected before it was accepted
            return False
        try:
            peer = self._peer_of(connection)
        except OSError:
            connection.close()
            return True
        level = self._rights.level(peer)
        connection.setblocking(False)
        refused = self._rights.refusal_to_connect(level)
        if refused:
            self._not_permitted += 1
            with connection, suppress(OSError):  # the client may have disconnected already
                connection.send(msgpack.packb([RESPONSE, None, refused, None]))
            return True
        self._accepted += 1
        more = not listener.is_full or self._make_room(listener, peer)
        client = Client(connection, Caller(self._accepted, peer, level))
        listener.add(connection.fileno(), client)
        self._listeners[connection.fileno()] = listener
        client.watched = select.EPOLLIN
        self._poll.register(connection.fileno(), client.watched)
        return more

    def _make_room(self, listener: Listener, newcomer: Peer) -> bool:
        """Drop a client for a newcomer; return whether its user has others."""
        descriptor, is_only = listener.choose_victim(newcomer, self.is_protected)
        self._made_room += 1
        self._drop(descriptor)
        return not is_only

    def _handle_events(self, listener: Listener, descriptor: int, events: int) -> None:
        """Read from a client, unless an earlier request of it still waits; further data stays in the kernel."""
        client = listener.clients[descriptor]
        if events & select.EPOLLHUP and self.is_protected(client.caller):  # for any other, its drop is soon enough
            self.on_hang_up(client.caller)
        if events & (select.EPOLLIN | select.EPOLLHUP) and descriptor not in listener.waiting and not client.ended:
            listener.clients[descriptor] = listener.clients.pop(descriptor)  # to the end of the order
            try:
                client.receive()
                listener.waiting[descriptor] = None
            except MalformedError as problem:
                self._reject(client, str(problem))
            except BlockingIOError:  # the event was of a dropped client, whose descriptor this one got since
                pass
            except OSError:
                return self._drop(descriptor)
        return self._flush(listener, descriptor)

    def _answer_next(self, now_s: float) -> None:
        """Answer one request. The listeners take turns, so that neither's clients wait for all of the other's."""
        for listener in self._turns:
            while listener.waiting and (descriptor := listener.next_to_answer(now_s)) is not None:
                if self._answer_one(listener, descriptor, now_s):
                    self._turns.remove(listener)
                    return self._turns.append(listener)
        return None

    def _answer_one(self, listener: Listener, descriptor: int, now_s: float) -> bool:
        """Answer one request of a client; return whether it had one."""
        client = listener.clients[descriptor]
        message: Any = None
        try:
            message = client.next_message(now_s)
            request = None if message is NOTHING else read_shape(message)
        except MalformedError as problem:
            self._reject(client, str(problem))
        else:
            if request is not None:
                client.budget -= 1.0
                listener.waiting[descriptor] = None  # another request may follow
                self._answer(client, *request)
        self._flush(listener, descriptor)
        return message is not NOTHING

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

    def _flush(self, listener: Listener, descriptor: int) -> None:
        """Send pending answers; drop a client that is rejected, too slow, or finished."""
        client, waiting = listener.clients[descriptor], listener.waiting
        try:
            client.flush()
        except OSError:  # the client has disconnected; its earlier requests still count
            client.ended = True
            client.outgoing.clear()
            waiting.setdefault(descriptor)
        slow = len(client.outgoing) > LONGEST_BACKLOG
        self._too_slow += slow
        done = client.ended and descriptor not in waiting and not client.outgoing
        if done or slow or client.closing:
            self._drop(descriptor)
        else:
            self._watch(client, descriptor in waiting)

    def _watch(self, client: Client, waits: bool) -> None:
        wanted = 0 if client.ended or waits else select.EPOLLIN
        wanted |= select.EPOLLOUT if client.outgoing else 0
        if wanted != client.watched:
            client.watched = wanted
            self._poll.modify(client.connection.fileno(), wanted)

    def _drop(self, descriptor: int) -> None:
        listener = self._listeners.pop(descriptor)
        client = listener.remove(descriptor)
        self._poll.unregister(descriptor)
        client.connection.close()
        self.on_hang_up(client.caller)

    def close(self) -> None:
        for descriptor in list(self._listeners):
            self._drop(descriptor)
        self._poll.close()
        for listener in self._turns:
            listener.file.close()
