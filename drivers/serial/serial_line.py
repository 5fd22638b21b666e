"""A device that talks in lines of text on a serial port: opened, heard without waiting, found again when it is back.

Nothing is ever sent. The first line after opening may have lost its beginning and is passed over; what never ends is
given out in pieces, since bytes without an end are what a wrong baud rate looks like. A device that is pulled out is
opened again by the same path when somebody says so (`/dev/serial/by-id/...` stays the same in another socket,
`/dev/ttyUSB0` may not): opening may take milliseconds, which not every caller has at every moment. pyserial opens and
sets up the device, and is imported only then; reading is one call.
"""

from __future__ import annotations

import errno
import os
import re
import select
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, NamedTuple

from control.records import NEVER_S

RETRY_S = 0.5  # between tries to open a device that is gone
LONGEST_LINE_BYTES = 200
MOST_BYTES_PER_READ = 4096  # as much as a tty keeps
KEPT_LINES = 40  # by which it is judged what arrives
COMMON_BAUDS = (9600, 115200, 57600, 38400, 19200, 4800, 2400, 230400)
GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL
LINE_ENDS = re.compile(rb"[\r\n]+")


class Arrivals(NamedTuple):
    """Of the last lines, what share was readable, and what share of their bytes was text."""

    lines: int
    readable: float
    text: float


class SerialLineError(Exception):
    """The port does not open, or is gone. The text says what to do, `why` only what the system says."""

    def __init__(self, message: str, why: str = "") -> None:
        super().__init__(message)
        self.why = why or message


class SerialLine:
    """Owns the open device, of which there is none while it is gone, and the line that has begun."""

    def __init__(
        self,
        path: str,
        baud: int,
        longest_bytes: int = LONGEST_LINE_BYTES,
        retry_s: float = RETRY_S,
        open_device: Callable[[str, int], Any] | None = None,
    ) -> None:
        """Raises SerialLineError where it does not open."""
        self.path, self.baud = path, baud
        self.unpluggings = 0
        self.problem: SerialLineError | None = None  # the last one
        self.open_device = open_device or open_serial
        self._longest_bytes, self._retry_s, self._retry_at_s = longest_bytes, retry_s, NEVER_S
        self._begin(self.open_device(path, baud))

    def _begin(self, device: Any) -> None:
        self._device: Any = device
        self._file = int(device.fileno())
        os.set_blocking(self._file, False)
        self._poll = select.poll()
        self._poll.register(self._file, select.POLLIN)
        self.reset()

    def reset(self) -> None:
        """As after opening."""
        self._begun = b""
        self._whole = False  # whether the line that has begun was heard from its beginning
        self.recent: deque[bytes] = deque(maxlen=KEPT_LINES)

    @property
    def is_there(self) -> bool:
        return self._device is not None

    def arrivals(self, is_readable: Callable[[bytes], bool]) -> Arrivals:
        lines = list(self.recent)
        readable = sum(map(is_readable, lines))
        return Arrivals(len(lines), readable / len(lines) if lines else 0.0, text_fraction(lines))

    def read(self, now_s: float) -> list[bytes]:
        """All lines that have come to their end, without it, oldest first; never waits. None where it is gone."""
        if self._device is None:
            return []
        try:
            *lines, self._begun = LINE_ENDS.split(self._begun + self._fetch())
        except OSError as problem:
            self._lose(problem, now_s)
            return []
        heard = [line for line in (lines if self._whole else lines[1:]) if line.strip()]
        self._whole = self._whole or bool(lines)
        if len(self._begun) > self._longest_bytes:
            heard.append(self._begun)
            self._begun, self._whole = b"", False
        self.recent.extend(heard)
        return heard

    def _fetch(self) -> bytes:
        """All that has arrived. Raises OSError where the device is gone."""
        events = self._poll.poll(0)
        if not events:
            return b""
        if self._device.in_waiting:  # an empty read of a device set up by pyserial is no end of it
            return self._read_file()
        if events[0][1] & GONE or not self._device.in_waiting:  # a device that is gone is ready, and has nothing
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return b""

    def _read_file(self) -> bytes:
        try:
            return os.read(self._file, MOST_BYTES_PER_READ)
        except BlockingIOError:  # somebody else has read it
            return b""

    def _lose(self, problem: OSError, now_s: float) -> None:
        self.unpluggings += 1
        self.problem = SerialLineError(problem.strerror or str(problem))
        self.close()
        self._retry_at_s = now_s + self._retry_s

    def reopen(self, now_s: float) -> bool:
        """Where it was lost, try again once in a while; whether it was opened anew."""
        if self._device is not None or now_s < self._retry_at_s:
            return False
        self._retry_at_s = now_s + self._retry_s
        try:
            self._begin(self.open_device(self.path, self.baud))
        except SerialLineError as problem:
            self.problem = problem
            return False
        return True

    def close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            with suppress(OSError):  # of a device that is gone already
                device.close()


def text_fraction(lines: Iterable[bytes]) -> float:
    """How much of what arrives is text at all: at a wrong baud rate little is."""
    letters = b"".join(lines)
    return sum(32 <= letter < 127 or letter in b"\t\r\n" for letter in letters) / len(letters) if letters else 0.0


def open_serial(path: str, baud: int) -> Any:
    """A port of pyserial that nobody else may open. Raises SerialLineError."""
    try:
        import serial
    except ModuleNotFoundError:
        raise SerialLineError("a serial port needs pyserial: pip install 'mudskipper[serial]'") from None
    try:
        return serial.Serial(path, baud, timeout=0, exclusive=True)
    except (OSError, ValueError) as problem:  # SerialException is an OSError
        number = getattr(problem, "errno", None)
        why = os.strerror(number) if number else str(problem)
        raise SerialLineError(_refusal(path, baud, problem), why) from problem


def _refusal(path: str, baud: int, problem: Exception) -> str:
    number = getattr(problem, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"there is no serial port {path}: {_ports_reported()}"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {path}: add yourself to the group of serial ports with "
            "`sudo usermod -aG dialout $USER`, log out and in again"
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(problem).lower():
        return f"{path} is in use by another program, such as a serial monitor: close that one"
    if number == errno.EISDIR or f"({errno.ENOTTY}," in str(problem):  # pyserial tells it in words only
        return f"{path} is no serial port: {_ports_reported()}"
    if isinstance(problem, ValueError):
        return f"{path} does not take {baud} baud: {problem}"
    return f"{path} does not open: {problem}"


def _ports_reported() -> str:
    ports = list_ports()
    if not ports:
        return "this computer sees none at all; is the device plugged in, and does its cable carry data?"
    return f"there are {', '.join(ports)}; name one of them"


def list_ports() -> list[str]:
    """Serial ports of this computer, by their lasting names where they have one."""
    from serial.tools import list_ports as serial_ports

    lasting = {}
    folder = "/dev/serial/by-id"
    if os.path.isdir(folder):
        lasting = {os.path.realpath(f"{folder}/{name}"): f"{folder}/{name}" for name in sorted(os.listdir(folder))}
    return [lasting.get(port.device, port.device) for port in sorted(serial_ports.comports())]
