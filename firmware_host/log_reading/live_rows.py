"""Subscribes to the rows of a running daemon (firmware_host/log/row_stream.py) and decodes them."""

import json
import select
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from firmware_host.log.row_records import split_records
from firmware_host.log.row_stream import BUFFER_BYTES, LOST, OPENING, REFUSAL
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.schema import LayoutError, RowKind, read_definition
from firmware_host.operator.status_client import NoDaemonError, NotPermittedError

OPENING_S = 5.0  # the longest wait for the first packet


class LiveRow(NamedTuple):
    kind: RowKind
    content: bytes  # a ROS 2 message in CDR, as in the log

    @property
    def values(self) -> dict[str, Any]:
        return self.kind.decode(self.content)


class LiveRows:
    """Owns the connection to the rows' socket. Raises NoDaemonError or NotPermittedError."""

    def __init__(self, path: Path) -> None:
        self.lost = 0  # rows, because this program did not read in time
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._socket.connect(str(path))
        except PermissionError as problem:
            raise NotPermittedError(f"no permission to use {path}") from problem
        except OSError as problem:
            raise NoDaemonError(f"no daemon serves rows on {path}: it is not running, or its log is off") from problem
        self.kinds: list[RowKind] = []
        self.metadata: dict[str, Any] = {}
        self.configuration_text = ""
        self._read_opening(path)

    def _read_opening(self, path: Path) -> None:
        if not select.select([self._socket], [], [], OPENING_S)[0]:
            raise NoDaemonError(f"{path} accepts no more subscribers; end another viewer")
        for number, content in split_records(self._socket.recv(BUFFER_BYTES))[0]:
            if number == REFUSAL:
                raise NotPermittedError(content.decode())
            if number == OPENING:
                opening = json.loads(content)
                self.metadata, self.configuration_text = opening["metadata"], opening["configuration_text"]
                self.kinds = [_kind(own, served) for own, served in zip(ROW_KINDS, opening["kinds"], strict=False)]
        if not self.kinds:
            raise NoDaemonError(f"what answers on {path} is no mudskipper daemon")

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
            if number == LOST:
                self.lost += int(json.loads(content)["rows"])
            elif number < len(self.kinds):
                yield LiveRow(self.kinds[number], content)

    def close(self) -> None:
        self._socket.close()


def _kind(own: RowKind, served: dict[str, str]) -> RowKind:
    try:
        return read_definition(own, served["definition"])
    except LayoutError as problem:
        raise NoDaemonError(f"the daemon is of another version: {problem}") from problem
