"""A serial CAN adapter as python-can's slcan interface meets it: LAWICEL's ASCII protocol on a pseudo-terminal.

Commands and frames are lines that end with a carriage return; a good command is answered by one, a bad one by a bell.
S0 to S8 choose the bit rate and O or L opens the channel, C closes it; t, T, r and R carry a frame in either direction
(standard, extended, and their remote frames) and are answered by z or Z; V, N and F tell version, serial number and
status. Source: LAWICEL CANUSB manual 1.0 and CAN232 manual v3. The other end is any CanPort, so a simulated robot is
reached through the bytes of a real adapter; who owns it calls `step`.
"""

from __future__ import annotations

import fcntl
import os
import re
import struct
import termios
import tty
from contextlib import suppress

from drivers.can.can_port import CanPort
from drivers.can.frames import Frame

END, REFUSED = b"\r", b"\a"
FRAME_LINE = re.compile(rb"([tr][0-7][0-9A-Fa-f]{2}|[TR][01][0-9A-Fa-f]{7})([0-8])((?:[0-9A-Fa-f]{2})*)")
LONGEST_LINE_BYTES = 32
MOST_BYTES = 65536
ANSWERS = {b"V": b"V1013", b"N": b"NA123", b"F": b"F00"}


def encode_line(frame: Frame) -> bytes:
    kind = "tTrR"[frame.is_extended + 2 * frame.is_remote]
    digits = 8 if frame.is_extended else 3
    return f"{kind}{frame.arbitration_id:0{digits}X}{len(frame.data)}{frame.data.hex().upper()}\r".encode()


def decode_line(line: bytes) -> Frame | None:
    """None where it is no frame."""
    match = FRAME_LINE.fullmatch(line)
    if match is None:
        return None
    kind, is_remote = line[:1], line[:1] in b"rR"
    data = bytes.fromhex(match[3].decode())
    if len(data) != (0 if is_remote else int(match[2])):
        return None
    return Frame(int(match[1][1:], 16), data, is_remote, False, kind in b"TR")


class SlcanAdapter:
    """Owns the pseudo-terminal, whose path is `device`, and whether the channel is open."""

    def __init__(self, port: CanPort) -> None:
        self._port = port
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)
        self.bit_rate = ""  # S0 to S8
        self.is_open = self._listens_only = False
        self.heard_lines = self.written_bytes = 0
        self.lost_lines = 0  # that found the computer's buffer full
        self._begun = b""  # a line whose end has not come yet

    def step(self) -> None:
        """Obey what the computer has written, then hand it what the bus has brought."""
        with suppress(BlockingIOError):
            self._begun += os.read(self._master, MOST_BYTES)
        *lines, self._begun = self._begun.split(END)
        self._begun = self._begun[-LONGEST_LINE_BYTES:]
        self.heard_lines += len(lines)
        for line in lines:
            self.write(self._answer(line))
        for frame in self._port.receive():
            if self.is_open:
                self.write(encode_line(frame))

    def write(self, line: bytes) -> None:
        """To the computer."""
        try:
            self.written_bytes += os.write(self._master, line)
        except BlockingIOError:
            self.lost_lines += 1

    def _answer(self, line: bytes) -> bytes:
        if line in ANSWERS:
            return ANSWERS[line] + END
        frame = decode_line(line)
        if frame is not None:
            return self._pass(frame)
        return END if line == b"" or self._obeys(line) else REFUSED

    def _pass(self, frame: Frame) -> bytes:
        if not self.is_open or self._listens_only:
            return REFUSED
        self._port.send(frame)
        return (b"Z" if frame.is_extended else b"z") + END

    def _obeys(self, line: bytes) -> bool:
        """S while closed, O and L once a bit rate is chosen, C while open."""
        if line == b"C":
            was_open, self.is_open = self.is_open, False
            return was_open
        if self.is_open:
            return False
        if re.fullmatch(rb"S[0-8]", line):
            self.bit_rate = line.decode()
            return True
        self.is_open, self._listens_only = line in (b"O", b"L") and self.bit_rate != "", line == b"L"
        return self.is_open

    @property
    def unread_bytes(self) -> int:
        """Of those written, which the computer may read; a pseudo-terminal delivers a moment later."""
        (count,) = struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))
        return int(count)

    def unplug(self) -> None:
        os.close(self._master)
        os.close(self._slave)
