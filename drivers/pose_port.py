"""The body's place along the track, from a motion-capture bridge or a rail encoder on the same machine.

A Unix datagram socket takes 16-byte messages, two little-endian doubles: the source's own time and the place x in
metres. The newest one wins; its stamp is the time it was read.
"""

from __future__ import annotations

import contextlib
import os
import socket
from math import isfinite
from pathlib import Path
from struct import Struct
from typing import Protocol

from control.records import BodyPose

POSE = Struct("<dd")
STALE_S = 0.05  # six frames of 120 Hz: a body that seems to stand makes a bound on k_s a value
SOCKET_MODE = 0o660  # a bridge run by an operator may send
MOST_MESSAGES_PER_READ = 64  # a sender gone wild must not hold the loop


class PoseSource(Protocol):
    def read(self, now_s: float) -> BodyPose:
        """The newest pose, or an empty one where none is known."""


class PosePort:
    """Listens at `path`; without one there is never a pose. A pose older than STALE_S counts as none."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._socket = _listen(path) if path else None
        self.garbled_messages = 0
        self.reset()

    def reset(self) -> None:
        self._pose = BodyPose()

    def read(self, now_s: float) -> BodyPose:
        if self._socket is not None:
            self._drain(self._socket, now_s)
        return self._pose if now_s - self._pose.stamp_s <= STALE_S else BodyPose()

    def _drain(self, listener: socket.socket, now_s: float) -> None:
        for _ in range(MOST_MESSAGES_PER_READ):
            try:
                data = listener.recv(64)
            except BlockingIOError:
                return
            x_m = POSE.unpack(data)[1] if len(data) == POSE.size else float("nan")
            if isfinite(x_m):
                self._pose = BodyPose(now_s, x_m)
            else:
                self.garbled_messages += 1

    def close(self) -> None:
        if self._socket is not None and self._path is not None:
            self._socket.close()
            self._path.unlink(missing_ok=True)


def _listen(path: Path) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listener.setblocking(False)
    if path.is_socket():  # left behind; anything else makes bind refuse
        path.unlink()
    listener.bind(str(path))
    os.chmod(path, SOCKET_MODE)
    return listener


class PoseSender:
    """The other end. A pose that nobody listens to is lost, as it would be on a network."""

    def __init__(self, path: Path) -> None:
        self._path = str(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, source_time_s: float, x_m: float) -> None:
        with contextlib.suppress(FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            self._socket.sendto(POSE.pack(source_time_s, x_m), self._path)

    def close(self) -> None:
        self._socket.close()
