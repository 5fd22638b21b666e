"""The interface of a source of the body's position along the track, and the simplest source.

Sources are motion capture, a rail encoder or `PosePort`: a Unix datagram socket that receives 16-byte messages from a
bridge on the same machine, two little-endian doubles: the source's own time and the position x in metres. The newest
message wins; its stamp is the time when it was read. After a jump one read has no pose.
"""

import contextlib
import os
import socket
from math import isfinite
from pathlib import Path
from struct import Struct
from typing import NamedTuple, Protocol

from control.records import NEVER_S, BodyPose
from drivers.pose.pose_timing import JUMP_M

POSE = Struct("<dd")
STALE_S = 0.05  # six frames of 120 Hz; a frozen position would turn a lower bound on k_s into a value
SOCKET_MODE = 0o660  # a bridge run by an operator may send
MOST_MESSAGES_PER_READ = 64  # so that a flood of messages cannot block the loop


class PoseSourceError(Exception):
    """The source does not open; the text says why and what to do."""


class PoseReport(NamedTuple):
    """The state of a source for the operator."""

    source: str = ""  # empty: there is none
    poses: int = 0  # accepted since the start
    malformed: int = 0  # malformed messages, and messages of other senders
    lost: int = 0  # messages without a usable pose of the body
    trouble: str = ""  # why no pose arrives
    what_to_do: str = ""

    @property
    def message(self) -> str:
        """One line. Trouble is only a warning, because the robot also walks without a pose."""
        counted = f"{self.poses} poses, {self.malformed} malformed messages, {self.lost} without the body"
        return f"{self.trouble} {self.source}: {counted}".lstrip()


NO_SOURCE = PoseReport()


class PoseSource(Protocol):
    def read(self, now_s: float) -> BodyPose:
        """Return the newest pose, or an empty one where none is known."""

    def report(self) -> PoseReport:
        """Return the state at the last `read`, for `status` and `check`."""


class OpenedPose(PoseSource, Protocol):
    """A source that the daemon has opened."""

    def reopen(self, now_s: float) -> bool:
        """Try to open a lost source again; return whether it did. Only called while nothing moves."""

    def close(self) -> None: ...


class NoPose:
    """The source of a robot without a measured position."""

    def read(self, now_s: float) -> BodyPose:
        return BodyPose()

    def report(self) -> PoseReport:
        return NO_SOURCE

    def reopen(self, now_s: float) -> bool:
        return False

    def close(self) -> None:
        return


class PosePort:
    """Receives poses at `path`. A pose older than STALE_S does not count."""

    def __init__(self, path: Path) -> None:
        """Open the socket; raises PoseSourceError where it cannot."""
        self._path = path
        self._socket = _listen(path)
        self.poses = self.malformed_messages = 0
        self._now_s = NEVER_S
        self._pose = BodyPose()

    def read(self, now_s: float) -> BodyPose:
        self._now_s, jumped = now_s, False
        for _ in range(MOST_MESSAGES_PER_READ):
            try:
                data = self._socket.recv(64)
            except BlockingIOError:
                break
            x_m = POSE.unpack(data)[1] if len(data) == POSE.size else float("nan")
            if isfinite(x_m):
                jumped = jumped or abs(x_m - self._pose.x_m) > JUMP_M  # never true of the first, after NaN
                self._pose = BodyPose(now_s, x_m)
                self.poses += 1
            else:
                self.malformed_messages += 1
        return self._pose if now_s - self._pose.stamp_s <= STALE_S and not jumped else BodyPose()

    def report(self) -> PoseReport:
        report = PoseReport(f"socket {self._path}", self.poses, self.malformed_messages)
        if self._now_s - self._pose.stamp_s <= STALE_S:
            return report
        heard = "any more" if self._pose.stamp_s > NEVER_S else "yet"
        return report._replace(
            trouble=f"no pose arrives at {self._path} {heard}.",
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
        if path.is_socket() and not _has_reader(path):  # left by an earlier process; bind refuses any other file
            path.unlink()
        listener.bind(str(path))
        os.chmod(path, SOCKET_MODE)
    except OSError as problem:
        listener.close()
        raise PoseSourceError(f"the pose socket {path} cannot be opened: {problem.strerror}") from None
    return listener


def _has_reader(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe, contextlib.suppress(ConnectionRefusedError):
        probe.connect(str(path))
        return True
    return False


class PoseSender:
    """The sending end. Without a receiver a pose is lost, as on a network."""

    def __init__(self, path: Path) -> None:
        self._path = str(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, source_time_s: float, x_m: float) -> None:
        with contextlib.suppress(FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            self._socket.sendto(POSE.pack(source_time_s, x_m), self._path)

    def close(self) -> None:
        self._socket.close()
