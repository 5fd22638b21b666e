"""The body's place along the track, from motion capture or a rail encoder: what a source of it is; the simplest one.

A Unix datagram socket takes 16-byte messages from a bridge on the same machine, two little-endian doubles: the
source's own time and the place x in metres. The newest one wins; its stamp is the time it was read.
"""

from __future__ import annotations

import contextlib
import os
import socket
from math import isfinite
from pathlib import Path
from struct import Struct
from typing import NamedTuple, Protocol

from control.records import NEVER_S, BodyPose

POSE = Struct("<dd")
STALE_S = 0.05  # six frames of 120 Hz: a body that seems to stand makes a bound on k_s a value
SOCKET_MODE = 0o660  # a bridge run by an operator may send
MOST_MESSAGES_PER_READ = 64  # a sender gone wild must not hold the loop


class PoseSourceError(Exception):
    """A source that does not open; the text says why and what to do."""


class PoseReport(NamedTuple):
    """What a person is told of a source."""

    source: str = ""  # empty: there is none
    poses: int = 0  # taken in since the start
    garbled: int = 0  # messages that are none of the source's, or cut off
    lost: int = 0  # messages that say that the body is not seen
    trouble: str = ""  # why no pose comes, in a sentence
    what_to_do: str = ""

    @property
    def message(self) -> str:
        """A robot walks without a pose, and knows less: trouble is a warning."""
        counted = f"{self.source}: {self.poses} poses, {self.garbled} messages garbled, {self.lost} without the body"
        if not self.trouble:
            return counted
        return f"warning: {self.trouble} {self.what_to_do[:1].upper()}{self.what_to_do[1:]}. {counted}"


NO_SOURCE = PoseReport()


class PoseSource(Protocol):
    def read(self, now_s: float) -> BodyPose:
        """The newest pose, or an empty one where none is known."""

    def report(self) -> PoseReport:
        """As of the last reading, for `status` and `check`."""


class OpenedPose(PoseSource, Protocol):
    """One that was opened for the daemon."""

    def reopen(self, now_s: float) -> bool:
        """Where it was lost, try again; whether it was opened anew. Only called while nothing moves."""

    def close(self) -> None: ...


class NoPose:
    """For a robot that nobody watches."""

    def read(self, now_s: float) -> BodyPose:
        return BodyPose()

    def report(self) -> PoseReport:
        return NO_SOURCE

    def reopen(self, now_s: float) -> bool:
        return False

    def close(self) -> None:
        return


class PosePort:
    """Listens at `path`. A pose older than STALE_S counts as none."""

    def __init__(self, path: Path) -> None:
        """Raises PoseSourceError."""
        self._path = path
        self._socket = _listen(path)
        self.poses = self.garbled_messages = 0
        self._now_s = NEVER_S
        self.reset()

    def reset(self) -> None:
        self._pose = BodyPose()

    def read(self, now_s: float) -> BodyPose:
        self._now_s = now_s
        self._drain(now_s)
        return self._pose if now_s - self._pose.stamp_s <= STALE_S else BodyPose()

    def _drain(self, now_s: float) -> None:
        for _ in range(MOST_MESSAGES_PER_READ):
            try:
                data = self._socket.recv(64)
            except BlockingIOError:
                return
            x_m = POSE.unpack(data)[1] if len(data) == POSE.size else float("nan")
            if isfinite(x_m):
                self._pose = BodyPose(now_s, x_m)
                self.poses += 1
            else:
                self.garbled_messages += 1

    def report(self) -> PoseReport:
        report = PoseReport(f"socket {self._path}", self.poses, self.garbled_messages)
        if self._now_s - self._pose.stamp_s <= STALE_S:
            return report
        heard = "any more" if self._pose.stamp_s > NEVER_S else "yet"
        return report._replace(
            trouble=f"no pose comes through {self._path} {heard}.",
            what_to_do='start the motion capture\'s bridge, or set pose.source = "none"',
        )

    def reopen(self, now_s: float) -> bool:
        return False  # a socket of this machine is never lost

    def close(self) -> None:
        self._socket.close()
        self._path.unlink(missing_ok=True)


def _listen(path: Path) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listener.setblocking(False)
    try:
        if path.is_socket():  # left behind; anything else makes bind refuse
            path.unlink()
        listener.bind(str(path))
        os.chmod(path, SOCKET_MODE)
    except OSError as problem:
        listener.close()
        raise PoseSourceError(f"the pose socket {path} cannot be opened: {problem.strerror}") from None
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
