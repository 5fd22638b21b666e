"""Subscribes to the rows of a running daemon (firmware_host/log/row_stream.py) and decodes them."""

import json
import select
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from firmware_host.log.row_records import split_records
from firmware_host.log.row_stream import BUFFER_BYTES, FULL, LOST, OPENING, REFUSAL
from firmware_host.log.rows import TICK_KIND, rig_of, row_kinds
from firmware_host.log.schema import LayoutError, RowKind, read_definition
from operator_client.status_client import SILENT, DroppedError, NoDaemonError, NotPermittedError

OPENING_S = 5.0  # the longest wait for the first packet


class LiveRow(NamedTuple):
    kind: RowKind
    content: bytes  # a ROS 2 message in CDR, as in the log

    @property
    def values(self) -> dict[str, Any]:
        return self.kind.decode(self.content)

    @property
    def stamp_s(self) -> float:
        return self.kind.stamp_s(self.content)


class LiveRows:
    """Owns the connection to the rows' socket. Raises NoDaemonError or NotPermittedError."""

    def __init__(self, path: Path, opening_s: float = OPENING_S) -> None:
        """Wait `opening_s` for the daemon's description of its rows; with 0 s, `read` takes it, and then `is_open`."""
        self.lost = 0  # rows, because this program did not read in time
        self.kinds: list[RowKind] = []
        self.metadata: dict[str, Any] = {}
        self.configuration_text = ""
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)  # connecting to a full queue would wait
        try:
            self._connect()
            if opening_s > 0.0 and not (self.read(opening_s) or self.is_open):
                raise self.silent
        except (NoDaemonError, NotPermittedError):
            self.close()
            raise

    def _connect(self) -> None:
        try:
            self._socket.connect(str(self._path))
        except PermissionError as problem:
            raise NotPermittedError(f"no permission to use {self._path}") from problem
        except BlockingIOError:
            raise self.silent from None
        except OSError as problem:
            missing = f"no daemon serves rows on {self._path}: it is not running, or its log is off"
            raise NoDaemonError(missing) from problem

    @property
    def silent(self) -> DroppedError:
        """Return the error of a daemon that is too slow to accept; one without a free place says so itself."""
        return DroppedError(f"the daemon does not answer on {self._path}: it is busy or hangs; {SILENT}")

    @property
    def is_open(self) -> bool:
        return bool(self.kinds)

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self, timeout_s: float) -> list[LiveRow]:
        """Return the rows that have come; none after the time. Raises NoDaemonError once the daemon has ended."""
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return []
        try:
            packet = self._socket.recv(BUFFER_BYTES)
        except OSError:
            packet = b""
        if not packet:
            raise NoDaemonError("the daemon has ended")
        return list(self._rows(packet))

    def _rows(self, packet: bytes) -> Iterator[LiveRow]:
        for number, content in split_records(packet)[0]:
            if number == REFUSAL:
                raise NotPermittedError(content.decode())
            if number == FULL:
                raise NoDaemonError(f"{self._path} accepts no more subscribers: {content.decode()}")
            if number == OPENING:
                self._open(json.loads(content))
            elif not self.is_open:
                raise NoDaemonError(f"what answers on {self._path} is no mudskipper daemon")
            elif number == LOST:
                self.lost += int(json.loads(content)["rows"])
            elif number < len(self.kinds):
                yield LiveRow(self.kinds[number], content)

    def _open(self, opening: dict[str, Any]) -> None:
        self.metadata, self.configuration_text = opening["metadata"], opening["configuration_text"]
        kinds = opening["kinds"]
        own = row_kinds(rig_of(kinds[TICK_KIND].get("metadata", {})))
        try:
            self.kinds = list(map(read_definition, own, (kind["definition"] for kind in kinds)))
        except LayoutError as problem:
            raise NoDaemonError(f"the daemon is of another version: {problem}") from problem

    def close(self) -> None:
        self._socket.close()
