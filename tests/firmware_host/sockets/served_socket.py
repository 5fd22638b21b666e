"""A status socket with its own clock, and clients with the credentials that a test chooses."""

import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack

from control.rate import PERIOD_S
from firmware_host.configuration.socket_paths import operators_path
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Group, Peer, Rights
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.status_socket import StatusSocket


def refuse(params: dict[str, Any], caller: Caller) -> Any:
    raise RefusedError("not now")


METHODS: dict[str, Callable[[dict[str, Any], Caller], Any]] = {
    "echo": lambda params, caller: params,
    "refuse": refuse,
    "long": lambda params, caller: "x" * 300_000,
}


RIGHTS = Rights(readers=Group("viewers", 70), operators=Group("pilots", 71), own_uid=1)
OPERATOR, READER, OTHER_USER = (
    Peer(500, 1000, frozenset({1000, 71})),
    Peer(501, 1001, frozenset({1001, 70})),
    Peer(502, 1002, frozenset({1002})),
)


class Served(StatusSocket):
    def __init__(self, path: Path, rights: Rights = RIGHTS) -> None:
        self.coming: list[Peer] = []
        super().__init__(path, METHODS, rights, self._next_peer, clock=lambda: self.now_s)
        self.now_s = 1000.0

    def _next_peer(self, connection: socket.socket) -> Peer:
        """Return the credentials of the next test client; an operator's on the operators' socket."""
        return OPERATOR if connection.getsockname() == str(operators_path(self.path)) else self.coming.pop(0)

    def tick(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.now_s += PERIOD_S
            self.serve(self.now_s)


def stops_of(served: Served) -> list[Caller]:
    """Return the list to which every caller of `stop` is added from now on."""
    stopped: list[Caller] = []
    served.methods = METHODS | {"stop": lambda params, caller: stopped.append(caller)}
    return stopped


def connect(served: Served, peer: Peer = OPERATOR) -> socket.socket:
    served.coming.append(peer)
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.settimeout(2.0)
    client.connect(str(served.path))
    return client


def serve(served: Served, ticks: int = 6) -> None:
    served.tick(ticks)


def ask(served: Served, client: socket.socket, data: bytes) -> list[Any]:
    """Send the data and return all answers of a few ticks."""
    client.sendall(data)
    serve(served)
    client.setblocking(False)
    unpacker = msgpack.Unpacker(raw=False)
    while True:
        try:
            answer = client.recv(1 << 20)
        except (BlockingIOError, ConnectionResetError):
            break
        if not answer:
            break
        unpacker.feed(answer)
        serve(served)
    client.settimeout(2.0)
    return list(unpacker)


def unpacked(data: bytes) -> Iterator[Any]:
    unpacker = msgpack.Unpacker(raw=False)
    unpacker.feed(data)
    yield from unpacker


def is_open(client: socket.socket) -> bool:
    client.setblocking(False)
    try:
        return bool(client.recv(65536))
    except BlockingIOError:
        return True
    except ConnectionResetError:
        return False
