"""A CAN bus between one user's processes on a machine without CAN: python-can's interface `mudskipper_local`.

A channel is a folder. Every node listens on a Unix stream socket in it and is connected to every other node. A frame
goes to each of them in the bytes of `struct can_frame` or `struct canfd_frame` (drivers/can/frames.py), so nothing
leaves the machine and no node receives its own frames. The sockets are streams, because the kernel queues only
net.unix.max_dgram_qlen (10) datagrams. There is no bit rate and no arbitration, and only the order between two nodes is
preserved. A node that does not read loses frames, like a full CAN controller: it never blocks a sender, which counts
the lost frames.

`LocalLink` is the mesh of sockets, `LocalBus` its interface to python-can. Neither starts a thread.
"""

import errno
import fcntl
import os
import select
import socket
from collections import deque
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from time import time

import can

from drivers.can.can_port import frame_from, message_from
from drivers.can.frames import FD_FORMAT, FD_FRAME_LAYOUT, FLAGS_BYTE, FRAME_LAYOUT, decode_frame, encode_frame
from drivers.can.run_folder import make_own_folder, run_folder

BUSES = "buses"  # in the user's private folder
FRAME_BYTES, FD_FRAME_BYTES = FRAME_LAYOUT.size, FD_FRAME_LAYOUT.size
CHUNK_BYTES = 65536
PATH_MAX_BYTES = 107  # sun_path of unix(7) has 108 with its final zero
BACKLOG_NODES = 4096  # that may join while one node is stopped
SEND_BUFFER_BYTES = 1 << 20  # the kernel limits it to net.core.wmem_max; a frame occupies some 800


@dataclass(slots=True, eq=False)
class Peer:
    connection: socket.socket
    rest: bytes = b""  # the start of a frame whose end has not arrived yet


class LocalLink:
    """The mesh: this node's listener, and one connection to each other node of the channel's folder."""

    def __init__(self, folder: Path) -> None:
        self.lost_frames = 0  # that another node had no room for, counted once for each such node
        self._path: Path | None = None
        self._peers: dict[int, Peer] = {}  # by the connection's descriptor
        self._arrived: deque[bytes] = deque()
        self._listener = _new_socket()
        self._epoll = select.epoll()
        self._joining = select.epoll()  # reports nodes that want to join, and no frames: `send` polls only this
        self._waiting = os.eventfd(0, os.EFD_NONBLOCK)  # readable while frames wait in `_arrived`
        try:
            self._join(folder)
        except OSError:
            self.close()
            raise

    def fileno(self) -> int:
        return self._epoll.fileno()

    def send(self, data: bytes) -> None:
        """Send one encoded frame to every other node that has room."""
        if self._joining.poll(0, 1):
            self._accept()
        for peer in tuple(self._peers.values()):
            try:
                written = peer.connection.send(data)
            except BlockingIOError:
                self.lost_frames += 1
            except OSError:
                while self._read(peer):  # the frames that the node sent before it left
                    pass
            else:
                if written != len(data):  # never observed; all following bytes would be misread
                    self._drop(peer)

    def receive(self, timeout_s: float | None = 0.0) -> bytes | None:
        """Return the next encoded frame, or None after the time-out, and also when a node joined or left."""
        arrived = self._arrived
        if not arrived:
            self._read_ready(timeout_s)
            if not arrived:
                return None
        data = arrived.popleft()
        if not arrived:
            os.eventfd_read(self._waiting)
        return data

    def close(self) -> None:
        if self._epoll.closed:
            return
        if self._path:
            self._path.unlink(missing_ok=True)
        for peer in tuple(self._peers.values()):
            self._drop(peer)
        self._listener.close()
        self._joining.close()
        self._epoll.close()
        os.close(self._waiting)

    def _join(self, folder: Path) -> None:
        with open(folder / "lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # two nodes that join at once must see each other exactly once
            for path in folder.glob("*.node"):
                self._connect(path)
            self._path = _free_path(folder)
            self._listener.bind(str(self._path))
            self._listener.listen(BACKLOG_NODES)
        for descriptor in (self._listener.fileno(), self._waiting):
            self._epoll.register(descriptor, select.EPOLLIN)
        self._joining.register(self._listener.fileno(), select.EPOLLIN)

    def _connect(self, path: Path) -> None:
        connection = _new_socket()
        try:
            connection.connect(str(path))
        except OSError as error:
            connection.close()
            if error.errno == errno.ECONNREFUSED and path.is_socket():  # left by a node that was killed
                path.unlink(missing_ok=True)
        else:
            self._add(connection)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except BlockingIOError:
                return
            self._add(connection)

    def _add(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        self._peers[connection.fileno()] = Peer(connection)
        self._epoll.register(connection.fileno(), select.EPOLLIN)

    def _drop(self, peer: Peer) -> None:
        self._peers.pop(peer.connection.fileno(), None)
        peer.connection.close()  # which also takes it out of the epoll

    def _read_ready(self, timeout_s: float | None) -> None:
        for descriptor, _ in self._epoll.poll(timeout_s, 64):
            if peer := self._peers.get(descriptor):
                self._read(peer)
            elif descriptor == self._listener.fileno():
                self._accept()
                self._read_ready(0.0)  # the new node may have sent already

    def _read(self, peer: Peer) -> bool:
        """Read what a peer has sent so far. Returns False if there was nothing, or the peer is gone."""
        try:
            chunk = peer.connection.recv(CHUNK_BYTES)
        except BlockingIOError:
            return False
        except OSError:
            chunk = b""
        if not chunk:
            self._drop(peer)
            return False
        self._split(peer, peer.rest + chunk)
        return True

    def _split(self, peer: Peer, stream: bytes) -> None:
        """Queue the complete frames of a peer's stream, and store the incomplete last one."""
        begin, end = 0, _end_of_frame(stream, 0)
        frames: list[bytes] = []
        while end <= len(stream):
            frames.append(stream[begin:end])
            begin, end = end, _end_of_frame(stream, end)
        peer.rest = stream[begin:]
        if frames:
            os.eventfd_write(self._waiting, 1)
            self._arrived.extend(frames)


class LocalBus(can.BusABC):
    """Implements python-can's bus: `can.Bus(interface="mudskipper_local", channel="demo")` opens one."""

    def __init__(
        self,
        channel: str | Path,
        can_filters: can.typechecking.CanFilters | None = None,
        receive_own_messages: bool = False,
        **kwargs: object,
    ) -> None:
        if receive_own_messages:
            raise can.CanInitializationError("A node of a local bus does not receive its own messages.")
        try:
            self._link = LocalLink(make_channel_folder(channel))
        except (OSError, ValueError) as error:
            raise can.CanInitializationError(f"Cannot open local bus {channel}: {error}") from error
        self._channel = str(channel)
        self._can_protocol = can.CanProtocol.CAN_FD  # which carries CAN 2.0 as well
        self.channel_info = f"local bus {channel}"
        super().__init__(channel=str(channel), can_filters=can_filters, **kwargs)

    @property
    def lost_frames(self) -> int:
        """Frames that another node had no room for, counted once for each such node."""
        return self._link.lost_frames

    def fileno(self) -> int:
        return self._link.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Never waits: without room in a node's buffer the frame is lost for that node."""
        self._link.send(encode_frame(frame_from(msg)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """Apply the filters here, because can.BusABC would treat a filtered frame like an empty bus."""
        while (data := self._link.receive(timeout)) is not None:
            message = self._decode(data)
            if self._matches_filters(message):
                return message, True
            timeout = 0.0
        return None, True

    def _decode(self, data: bytes) -> can.Message:
        try:
            frame = decode_frame(data)
        except ValueError as error:
            raise can.CanOperationError(f"Malformed bytes on the {self.channel_info}: {error}") from error
        message = message_from(frame)
        message.timestamp, message.channel = time(), self._channel
        return message

    def shutdown(self) -> None:
        super().shutdown()
        self._link.close()


def _end_of_frame(stream: bytes, begin: int) -> int:
    """Return the end of the frame that begins at `begin`; it may lie beyond the bytes that have arrived."""
    if begin + FLAGS_BYTE < len(stream) and stream[begin + FLAGS_BYTE] & FD_FORMAT:
        return begin + FD_FRAME_BYTES
    return begin + FRAME_BYTES


def make_channel_folder(channel: str | Path) -> Path:
    """Return the folder of a channel: an absolute path itself, or a plain name in this user's private folder."""
    folder = Path(channel)
    if not folder.is_absolute():
        if folder.name != str(channel) or folder.name in ("", ".."):
            raise ValueError(f"{str(channel)!r} is neither an absolute path nor a plain name.")
        folder = make_own_folder(run_folder() / BUSES) / folder
    return make_own_folder(folder)


def _free_path(folder: Path) -> Path:
    """Return an unused name; a process in another container may have the same process id."""
    paths = (folder / f"{os.getpid()}-{number}.node" for number in count())
    path = next(path for path in paths if not path.exists())
    if len(os.fsencode(path)) > PATH_MAX_BYTES:
        raise OSError(f"{path} is longer than the {PATH_MAX_BYTES} bytes that a socket's path has.")
    return path


def _new_socket() -> socket.socket:
    node = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    node.setblocking(False)
    return node
