"""A serial CAN adapter for python-can's slcan interface: LAWICEL's ASCII protocol on a pseudo-terminal.

Commands and frames are lines that end with a carriage return; a valid command is answered by one, an invalid one by a
bell. S0 to S8 choose the bit rate, O or L opens the channel, C closes it; t, T, r and R carry a frame in either
direction (standard, extended, and their remote frames) and are answered by z or Z; V, N and F return version, serial
number and status. Source: LAWICEL CANUSB manual 1.0 and CAN232 manual v3. The other end is any CanPort, so a simulated
robot is reached through the bytes of a real adapter. The owner calls `step`.
"""

import re

from drivers.can.can_port import CanPort, open_port
from drivers.can.frames import Frame
from simulation.devices.pseudo_terminal import PseudoTerminal

END, REFUSED = b"\r", b"\a"
FRAME_LINE = re.compile(rb"([tr][0-7][0-9A-Fa-f]{2}|[TR][01][0-9A-Fa-f]{7})([0-8])((?:[0-9A-Fa-f]{2})*)")
LONGEST_LINE_BYTES = 32
OPENING_LINES = 5  # of python-can: C, S8, an empty one, O, O
ANSWERS = {b"V": b"V1013", b"N": b"NA123", b"F": b"F00"}


def encode_line(frame: Frame) -> bytes:
    kind = "tTrR"[frame.is_extended + 2 * frame.is_remote]
    digits = 8 if frame.is_extended else 3
    return f"{kind}{frame.arbitration_id:0{digits}X}{len(frame.data)}{frame.data.hex().upper()}\r".encode()


def decode_line(line: bytes) -> Frame | None:
    """Return the frame of a line, or None for a line that is not a frame."""
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
        self._terminal = PseudoTerminal()
        self.device = self._terminal.device
        self.bit_rate = ""  # S0 to S8
        self.is_open = self._listens_only = False
        self.heard_lines = self.written_bytes = 0
        self.lost_lines = 0  # that found the computer's buffer full
        self._partial_line = b""  # received without its end so far

    def step(self) -> None:
        """Execute the lines that the computer has written, then write the frames of the bus to it."""
        self._partial_line += self._terminal.read()
        *lines, self._partial_line = self._partial_line.split(END)
        self._partial_line = self._partial_line[-LONGEST_LINE_BYTES:]
        self.heard_lines += len(lines)
        for line in lines:
            self.write(self._answer(line))
        for frame in self._port.receive():
            if self.is_open:
                self.write(encode_line(frame))

    def write(self, line: bytes) -> None:
        """Write a line to the computer."""
        written = self._terminal.write(line)
        self.written_bytes += written
        self.lost_lines += written == 0

    def _answer(self, line: bytes) -> bytes:
        if line in ANSWERS:
            return ANSWERS[line] + END
        frame = decode_line(line)
        if frame is not None:
            return self._pass(frame)
        return END if line == b"" or self._executes(line) else REFUSED

    def _pass(self, frame: Frame) -> bytes:
        if not self.is_open or self._listens_only:
            return REFUSED
        self._port.send(frame)
        return (b"Z" if frame.is_extended else b"z") + END

    def _executes(self, line: bytes) -> bool:
        """Execute S while closed, O and L once a bit rate is chosen, and C while open; return whether it was valid."""
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
        """Return the number of written bytes that the computer can read; a pseudo-terminal delivers them after a
        moment.
        """
        return self._terminal.unread_bytes

    def unplug(self) -> None:
        self._terminal.close()

    def open_port(self) -> CanPort:
        """Return the daemon's port of this adapter."""
        return open_port("slcan", self.device, {"bitrate": 1000000, "sleep_after_open": 0.0})
