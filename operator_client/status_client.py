"""A client of the status socket; it imports only the standard library and msgpack, so that commands start quickly."""

import socket
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgpack

from firmware_host.sockets.rpc import LONGEST_REQUEST, NOT_PERMITTED, REQUEST, TOO_LONG
from firmware_host.sockets.socket_file import operators_path

ANSWER_S = 5.0
CREDENTIALS = struct.Struct("iII")  # struct ucred: pid, uid, gid
CLOSED = "it is ending, or made room for another client; try again"
SILENT = "'systemctl status mudskipper' shows more"
TIMEVAL = struct.Struct("ll")  # seconds and microseconds


class NoDaemonError(Exception):
    """No daemon answers on the socket."""


class DroppedError(NoDaemonError):
    """A daemon is running, but gives no answer; the message gives the cause."""


class NotPermittedError(Exception):
    """The user may not use the socket or this method; the message says what to do."""


class CallRefusedError(Exception):
    """The daemon refuses the request; the message says why."""


class StatusClient:
    """Connects through the operators' own socket where this user may, else through the one for every user."""

    def __init__(self, path: Path, timeout_s: float = ANSWER_S) -> None:
        self._path = path
        self._number = 0
        self._unpacker = msgpack.Unpacker(raw=False)
        try:
            self._socket = _connected(operators_path(path), timeout_s)
        except OSError:
            self._socket = self._connect_as_anyone(timeout_s)
        self._socket.settimeout(timeout_s)

    def _connect_as_anyone(self, timeout_s: float) -> socket.socket:
        try:
            return _connected(self._path, timeout_s)
        except PermissionError as problem:
            why = f"no permission to use {self._path}: its folder lets only its owner in"
            raise NotPermittedError(why) from problem
        except OSError as problem:
            raise NoDaemonError(f"no daemon answers on {self._path}") from problem

    @property
    def daemon_pid(self) -> int:
        """Return the process that created the socket, as the kernel reports it."""
        size = CREDENTIALS.size
        return int(CREDENTIALS.unpack(self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size))[0])

    def call(self, method: str, **params: Any) -> Any:
        """Return the result of a method.

        Raises CallRefusedError or NotPermittedError with the daemon's message, or NoDaemonError if no answer comes.
        """
        self._number += 1
        request = msgpack.packb([REQUEST, self._number, method, params], unicode_errors="backslashreplace")
        if len(request) > LONGEST_REQUEST:
            name = max(params, key=lambda key: len(str(params[key])))
            raise CallRefusedError(f"{name} = {params[name]!r:.40}... is too long: {TOO_LONG}")
        try:
            with suppress(ConnectionError):  # what it said before it closed the connection can still be read
                self._socket.sendall(request)
            problem, result = self._receive()
        except ConnectionError as problem_reading:
            raise DroppedError(f"the daemon on {self._path} closed the connection: {CLOSED}") from problem_reading
        except OSError as problem_reading:
            raise DroppedError(f"the daemon on {self._path} does not answer: {SILENT}") from problem_reading
        except (ValueError, TypeError, KeyError, msgpack.UnpackException) as problem_reading:
            raise NoDaemonError(f"what answers on {self._path} is no mudskipper daemon") from problem_reading
        if problem is not None and str(problem).startswith(NOT_PERMITTED):
            raise NotPermittedError(str(problem).removeprefix(NOT_PERMITTED))
        if problem is not None:
            raise CallRefusedError(problem)
        return result

    def read_map(self) -> list[dict[str, Any]]:
        """Return the mud along the track since the walk began, page after page."""
        pieces: list[dict[str, Any]] = []
        while page := self.call("map", after_m=pieces[-1]["place_m"] if pieces else None):
            pieces += page
        return pieces

    def _receive(self) -> tuple[Any, Any]:
        """Return problem and result; skips an answer to an earlier request, which a Ctrl-C may have left unread."""
        while True:
            for message in self._unpacker:
                _, number, problem, result = message
                if number in (self._number, None):
                    return problem, result
            data = self._socket.recv(65536)
            if not data:
                raise ConnectionResetError
            self._unpacker.feed(data)

    def close(self) -> None:
        self._socket.close()


def _connected(path: Path, timeout_s: float) -> socket.socket:
    """Return a connected socket; raises OSError. A full queue is waited for: with Python's own timeout it would not."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, TIMEVAL.pack(*divmod(int(1e6 * timeout_s), 10**6)))
        connection.connect(str(path))
    except BaseException:
        connection.close()
        raise
    return connection
