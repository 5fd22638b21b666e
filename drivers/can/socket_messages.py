"""Reads the frames that wait on a socket by one system call: recvmmsg(2), which Python's socket module does not have.

The kernel adds to each frame its time stamp (SO_TIMESTAMPNS), from the first loss on how many frames found the queue
full (SO_RXQ_OVFL), and marks. Layouts: struct mmsghdr and iovec of recvmmsg(2), struct cmsghdr of cmsg(3), in the sizes
and the alignment of this machine, where `0P` pads to those of a pointer.
"""

import ctypes
import os
import struct
import sys
from socket import CMSG_SPACE, MSG_DONTWAIT, socket

MOST = 32  # frames of one call
LONGEST_BYTES = 80  # more than a CAN FD frame has, so that a longer one is noticed
BUFFER = struct.Struct("@PN")  # address, length
HEADER = struct.Struct("@PIPNPNi0PI0P")  # name, its length, buffers, their number, additions; and RESULT
RESULT = struct.Struct(f"@{struct.calcsize('@PIPNP0N')}xNi0PI0P")  # length of the additions, marks, length of the frame
STAMPED_BYTES, COUNTED_BYTES = CMSG_SPACE(2 * struct.calcsize("l")), CMSG_SPACE(4)  # struct timespec, __u32
ADDITION = struct.calcsize("@Nii0l")  # bytes before the value: length, level, kind
RECORD = struct.Struct(f"@IB3x8s{LONGEST_BYTES - 16}x{ADDITION}x2l{COUNTED_BYTES}x0l")  # a frame, then its additions

Arrived = tuple[tuple[int, int, int], tuple[int, int, bytes, int, int]]  # RESULT, and word, length, payload and stamp


class SocketMessages:
    """Owns the buffers of the frames, and the headers that describe them to the kernel."""

    def __init__(self, own_socket: socket) -> None:
        self._socket = own_socket
        self.records, self.headers = bytearray(MOST * RECORD.size), bytearray(MOST * HEADER.size)
        self._buffers = bytearray(MOST * BUFFER.size)
        record, buffer = _address(self.records), _address(self._buffers)
        room_bytes = RECORD.size - LONGEST_BYTES
        for i in range(MOST):
            BUFFER.pack_into(self._buffers, i * BUFFER.size, record, LONGEST_BYTES)
            HEADER.pack_into(self.headers, i * HEADER.size, 0, 0, buffer, 1, record + LONGEST_BYTES, room_bytes, 0, 0)
            record, buffer = record + RECORD.size, buffer + BUFFER.size
        self._unused = bytes(self.headers)
        self._receive = ctypes.CDLL(None, use_errno=True).recvmmsg
        self._receive.argtypes = ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
        self._address = _address(self.headers)

    def fill(self) -> int:
        """Read into the buffers; return the number of frames. Raises OSError, without any frame BlockingIOError."""
        count: int = self._receive(self._socket.fileno(), self._address, MOST, MSG_DONTWAIT, None)
        if count < 0:
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number))
        return count

    def read(self) -> list[Arrived]:
        """Return what has arrived, at most MOST frames; raises OSError."""
        try:
            count = self.fill()
        except BlockingIOError:
            return []
        used = count * HEADER.size
        results = RESULT.iter_unpack(self.headers[:used])
        self.headers[:used] = self._unused[:used]
        return list(zip(results, RECORD.iter_unpack(self.records[: count * RECORD.size]), strict=True))

    def data(self, index: int, length: int) -> bytes:
        """Return all bytes of a frame of the last read."""
        begin = index * RECORD.size
        return bytes(self.records[begin : begin + length])

    def lost(self, index: int, added: int) -> int:
        """Return how many frames were lost since the socket's opening, modulo 2³²; the last addition says it."""
        begin = index * RECORD.size + LONGEST_BYTES + added - COUNTED_BYTES + ADDITION
        return int.from_bytes(self.records[begin : begin + 4], sys.byteorder)


def _address(buffer: bytearray) -> int:
    return ctypes.addressof((ctypes.c_char * len(buffer)).from_buffer(buffer))
