"""A client of the status socket; it imports only the standard library and msgpack, so that commands start quickly."""

import struct
from _socket import AF_UNIX, SO_PEERCRED, SO_SNDTIMEO, SOCK_STREAM, SOL_SOCKET, socket  # `socket` is slow to import
from _thread import allocate_lock
from contextlib import suppress
from os import PathLike, fspath
from os.path import splitext
from typing import Any, Self

import msgpack

from firmware_host.sockets.rpc import (
    LONGEST,
    LONGEST_ARRAY,
    LONGEST_REQUEST,
    MOST_PARAMS,
    NOT_PERMITTED,
    REQUEST,
    TOO_LONG,
)

ANSWER_S = 5.0
OPERATORS = "-operators"  # in the name of their own socket, as the daemon has it
CREDENTIALS = struct.Struct("iII")  # struct ucred: pid, uid, gid
CLOSED = "it is ending, or made room for another client; try again"
ENDED = "this client is closed, as by the end of its `with` statement: make another one"
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
    """Connects through the operators' own socket where this user may, else through the one for every user.

    A `with` statement closes it. Raises NoDaemonError and NotPermittedError. After a call whose connection the daemon
    closed, the next call connects again; no request is sent twice.
    """

    def __init__(self, path: str | PathLike[str], timeout_s: float = ANSWER_S) -> None:
        self._path, self._timeout_s = fspath(path), timeout_s
        self._number, self._one_thread = 0, allocate_lock()
        self._connect()

    def _connect(self) -> None:
        stem, ending = splitext(self._path)
        try:
            self._socket = _connected(f"{stem}{OPERATORS}{ending}", self._timeout_s)
        except OSError:
            self._socket = self._connect_as_anyone()
        self._socket.settimeout(self._timeout_s)
        self._unpacker, self._is_lost = msgpack.Unpacker(raw=False), False

    def _connect_as_anyone(self) -> socket:
        try:
            return _connected(self._path, self._timeout_s)
        except PermissionError as problem:
            why = f"no permission to use {self._path}: its folder lets only its owner in"
            raise NotPermittedError(why) from problem
        except OSError as problem:
            raise NoDaemonError(f"no daemon answers on {self._path}") from problem

    @property
    def daemon_pid(self) -> int:
        """Return the process that created the socket, as the kernel reports it."""
        size = CREDENTIALS.size
        return int(CREDENTIALS.unpack(self._socket.getsockopt(SOL_SOCKET, SO_PEERCRED, size))[0])

    def call(self, method: str, /, **params: Any) -> Any:
        """Return the result of a method.

        Raises CallRefusedError or NotPermittedError with the daemon's message, or NoDaemonError if no answer comes.
        """
        longest = max((len(value) for value in params.values() if isinstance(value, list)), default=0)
        if len(params) > MOST_PARAMS or longest > LONGEST_ARRAY:  # for which the daemon closes the connection
            raise CallRefusedError(f"{method}: a request has {LONGEST}")
        with self._one_thread:
            problem, result = self._exchange(method, params)
        if problem is not None and str(problem).startswith(NOT_PERMITTED):
            raise NotPermittedError(str(problem).removeprefix(NOT_PERMITTED))
        if problem is not None:
            raise CallRefusedError(problem)
        return result

    def _exchange(self, method: str, params: dict[str, Any]) -> tuple[Any, Any]:
        """Send a request and return problem and result of its answer."""
        self._number += 1
        message = [REQUEST, self._number, method, params]
        request = msgpack.packb(message, default=plain, unicode_errors="backslashreplace")
        if len(request) > LONGEST_REQUEST:
            name = max(params, key=lambda key: len(str(params[key])))
            raise CallRefusedError(f"{name} = {params[name]!r:.40}... is too long: {TOO_LONG}")
        if self._is_lost and self._socket.fileno() >= 0:
            lost = self._socket
            self._connect()
            lost.close()
        try:
            with suppress(ConnectionError):  # what it said before it closed the connection can still be read
                self._socket.sendall(request)
            return self._receive()
        except ConnectionError as problem_reading:
            self._is_lost = True
            raise DroppedError(f"the daemon on {self._path} closed the connection: {CLOSED}") from problem_reading
        except OSError as problem_reading:
            silent = f"the daemon on {self._path} does not answer: {SILENT}"
            raise DroppedError(ENDED if self._socket.fileno() < 0 else silent) from problem_reading
        except (ValueError, TypeError, KeyError, msgpack.UnpackException) as problem_reading:
            raise NoDaemonError(f"what answers on {self._path} is no mudskipper daemon") from problem_reading

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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def plain(value: Any) -> Any:
    """Return a number or an array of numpy as Python's own. Raises TypeError for what no request can have."""
    if not hasattr(value, "tolist"):
        raise TypeError(f"no request has a {type(value).__name__}")
    return value.tolist()


def _connected(path: str, timeout_s: float) -> socket:
    """Return a connected socket; raises OSError. A full queue is waited for: with Python's own timeout it would not."""
    connection = socket(AF_UNIX, SOCK_STREAM)
    try:
        connection.setsockopt(SOL_SOCKET, SO_SNDTIMEO, TIMEVAL.pack(*divmod(int(1e6 * timeout_s), 10**6)))
        connection.connect(path)
    except BaseException:
        connection.close()
        raise
    return connection
