"""A client of the status socket that sends any bytes, piece by piece, and never waits."""

import socket
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgpack


class StreamClient:
    """Owns one connection, the pieces that it has not sent yet, and the answers: refusal or None by request number."""

    def __init__(self, path: Path, pieces: list[bytes], hurried: bool = False, reads: bool = True) -> None:
        """`hurried`: hangs up as soon as all is sent; `reads`: or keeps the connection and never reads."""
        self.pieces, self.hurried, self._reads = pieces, hurried, reads
        self.answers: dict[Any, str | None] = {}
        self.closed = False
        self._unpacker = msgpack.Unpacker(raw=False)
        self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._connection.connect(str(path))
        self._connection.setblocking(False)

    def step(self) -> None:
        """Send the next piece and receives what has come."""
        if self.closed:
            return
        if self.pieces:
            with suppress(BrokenPipeError, ConnectionResetError, BlockingIOError):
                self._connection.send(self.pieces.pop(0))
        if self.hurried and not self.pieces:
            self.close()
        elif self._reads:
            self._receive()

    def _receive(self) -> None:
        try:
            data = self._connection.recv(65536)
        except BlockingIOError:
            return
        except ConnectionResetError:
            data = b""
        self.closed = not data
        self._unpacker.feed(data)
        self.answers |= {number: problem for _, number, problem, _ in self._unpacker}

    def close(self) -> None:
        self._connection.close()
        self.closed = True
