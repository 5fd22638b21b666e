"""Serves the log's rows to subscribers on a Unix socket, from the writer's process.

The loop knows nothing of it: it hands its rows to the writer, and the writer passes them on. The socket keeps the
boundaries of packets (SOCK_SEQPACKET), so a packet is sent whole or not at all. A subscriber that does not read fills
its own buffer in the kernel and then loses whole packets; the number of lost rows is sent to it before the next row.

A packet is a sequence of records (row_records.py) of these kinds:

    0 to 2      rows of the log: tick, stride, event (rows.py)
    OPENING     JSON, the first record: the kinds with topic, name, ros2msg definition and metadata, the run's
                metadata and its configuration
    LOST        JSON, the number of rows that this subscriber has lost here
    REFUSAL     text, the only record for a user without the right to read; the connection then ends
    FULL        text, the only record where every place is taken; the connection then ends

Some places are for operators alone, so that silent readers cannot take the rows from those who drive.
"""

import json
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from firmware_host.log.row_records import Record, pack_record
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.schema import RowKind
from firmware_host.sockets.rights import Group, Peer, Rights, read_peer
from firmware_host.sockets.socket_file import SocketFile
from firmware_host.sockets.socket_methods import Level

OPENING, LOST, REFUSAL, FULL = 255, 254, 253, 252
MOST_SUBSCRIBERS = {Level.READ: 6, Level.DRIVE: 8}  # at which one more of this level is refused
MOST_ACCEPTS = 32  # at once
BACKLOG = 128  # connections that wait to be accepted
PACKET_BYTES = 32 * 1024  # less than the kernel's smallest usual buffer
BUFFER_BYTES = 512 * 1024  # of one subscriber: three seconds of rows; the kernel may allow less


def read_rights(values: Sequence[Any]) -> Rights:
    """Return rights that have been JSON on their way from the loop."""
    readers, operators, own_uid, anyone_may_stop = values
    return Rights(Group(*readers), Group(*operators), own_uid, anyone_may_stop)


class Subscriber:
    """Owns one connection and the count of its lost rows."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._lost = 0
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)

    def send(self, packet: bytes, rows: int) -> bool:
        """Send a packet of so many rows, or count them as lost; return false, and close, if the subscriber is gone."""
        report = pack_record(LOST, json.dumps({"rows": self._lost}).encode()) if self._lost else b""
        try:
            self._connection.send(report + packet)
        except BlockingIOError:
            self._lost += rows
            return True
        except OSError:
            self.close()
            return False
        self._lost = 0
        return True

    def close(self) -> None:
        self._connection.close()


class RowStream:
    """Owns the listening socket and the subscribers. No method raises OSError; `problem` says why nothing is served."""

    def __init__(
        self,
        path: Path,
        rights: Rights,
        metadata: dict[str, Any],
        configuration_text: str = "",
        kinds: Sequence[RowKind] = ROW_KINDS,
        peer_of: Callable[[socket.socket], Peer] = read_peer,
    ) -> None:
        self.problem = ""
        self._rights, self._peer_of = rights, peer_of
        served = [
            {"topic": kind.topic, "schema": kind.schema_name, "definition": kind.definition, "metadata": kind.metadata}
            for kind in kinds
        ]
        opening = {"kinds": served, "metadata": metadata, "configuration_text": configuration_text}
        self._opening = pack_record(OPENING, json.dumps(opening).encode())
        self._subscribers: list[Subscriber] = []
        self._file: SocketFile | None = None
        try:
            self._file = SocketFile(path, BACKLOG, kind=socket.SOCK_SEQPACKET)
        except OSError as problem:
            self.problem = f"rows are not served on {path}: {problem}"

    def publish(self, rows: Sequence[Record]) -> None:
        """Accept those who wait, and send the rows to every subscriber; call this regularly, without rows too."""
        self._accept()
        if not self._subscribers:
            return
        for packet, count in packets(rows):
            self._subscribers = [each for each in self._subscribers if each.send(packet, count)]

    def _accept(self) -> None:
        for _ in range(MOST_ACCEPTS if self._file is not None else 0):
            assert self._file is not None
            try:
                connection, _ = self._file.listener.accept()
            except OSError:
                return
            self._admit(connection)

    def _admit(self, connection: socket.socket) -> None:
        """Add the subscriber, or send it the reason why not."""
        level, subscriber = Level.ANYONE, Subscriber(connection)
        with suppress(OSError):  # it has disconnected already
            level = self._rights.level(self._peer_of(connection))
        refusal = self._rights.refusal("status", level)
        if refusal:
            first = pack_record(REFUSAL, refusal.encode())
        elif len(self._subscribers) >= MOST_SUBSCRIBERS[level]:
            places = f"all {MOST_SUBSCRIBERS[level]} places for the level {level.name.lower()} are taken"
            first = pack_record(FULL, f"{places}; end another viewer".encode())
        elif subscriber.send(self._opening, 0):
            return self._subscribers.append(subscriber)
        else:
            return None
        subscriber.send(first, 0)
        return subscriber.close()

    def close(self) -> None:
        for subscriber in self._subscribers:
            subscriber.close()
        self._subscribers = []
        if self._file is not None:
            self._file.close()


def packets(rows: Sequence[Record]) -> list[tuple[bytes, int]]:
    """Return the rows as packets of at most PACKET_BYTES, each with its number of rows."""
    made: list[tuple[bytes, int]] = []
    packet, count = b"", 0
    for kind, row in rows:
        piece = pack_record(kind, row)
        if packet and len(packet) + len(piece) > PACKET_BYTES:
            made.append((packet, count))
            packet, count = b"", 0
        packet, count = packet + piece, count + 1
    return [*made, (packet, count)] if packet else made
