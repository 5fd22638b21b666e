"""A device that sends lines of text on a serial port: it is read without waiting, and opened again after unplugging.

Nothing is ever sent to the device. The first line after opening may lack its beginning and is skipped. A line that does
not end is returned in pieces, because that is how a wrong baud rate shows. An unplugged device is opened again by the
same path when the caller says so, because opening may take milliseconds (`/dev/serial/by-id/...` stays the same in
another socket, `/dev/ttyUSB0` may not). pyserial opens and sets up the device, and is imported only then; reading is
one call.
"""

import errno
import os
import re
import select
import sys
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from control.records import NEVER_S

RETRY_S = 0.5  # between tries to open a device that is gone
LONGEST_LINE_BYTES = 200
MOST_BYTES_PER_READ = 4096  # the buffer of a tty
RECENT_LINES = 40  # by which the format and the baud rate are checked
GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL
LINE_ENDS = re.compile(rb"[\r\n]+")


class SerialLineError(Exception):
    """The port does not open, or is gone. The text says what to do; `why` is only the reason of the system."""

    def __init__(self, message: str, why: str = "") -> None:
        super().__init__(message)
        self.why = why or message


class SerialLine:
    """Owns the open device, which is None while it is gone, and the incomplete line."""

    def __init__(self, path: str, baud: int, longest_bytes: int = LONGEST_LINE_BYTES, retry_s: float = RETRY_S) -> None:
        """Open the device; raises SerialLineError where it does not open."""
        self.path, self.baud = path, baud
        self.unpluggings = 0
        self.problem: SerialLineError | None = None  # the newest one
        self._longest_bytes, self._retry_s, self._retry_at_s = longest_bytes, retry_s, NEVER_S
        self._use(open_serial(path, baud))

    def _use(self, device: Any) -> None:
        self._device: Any = device
        self._file = int(device.fileno())
        os.set_blocking(self._file, False)
        self._poll = select.poll()
        self._poll.register(self._file, select.POLLIN)
        self.reset()

    def reset(self) -> None:
        """Restore the state after opening."""
        self._incomplete = b""
        self._from_its_start = False  # whether the incomplete line was received from its beginning
        self.recent: deque[bytes] = deque(maxlen=RECENT_LINES)

    @property
    def is_there(self) -> bool:
        return self._device is not None

    def readable_fraction(self, is_readable: Callable[[bytes], bool]) -> float:
        """Return the fraction of the recent lines; it is small with a wrong format or baud rate."""
        return sum(map(is_readable, self.recent)) / max(len(self.recent), 1)

    def read(self, now_s: float) -> list[bytes]:
        """Return all complete lines without their ends, oldest first; none where the device is gone. Never waits."""
        if self._device is None:
            return []
        try:
            *lines, self._incomplete = LINE_ENDS.split(self._incomplete + self._fetch())
        except OSError as problem:
            self.unpluggings += 1
            self.problem = SerialLineError(problem.strerror or str(problem))
            self.close()
            self._retry_at_s = now_s + self._retry_s
            return []
        heard = [line for line in (lines if self._from_its_start else lines[1:]) if line.strip()]
        self._from_its_start = self._from_its_start or bool(lines)
        if len(self._incomplete) > self._longest_bytes:
            heard.append(self._incomplete)
            self._incomplete, self._from_its_start = b"", False
        self.recent.extend(heard)
        return heard

    def _fetch(self) -> bytes:
        """Return all bytes that have arrived. Raises OSError where the device is gone."""
        events = self._poll.poll(0)
        if not events:
            return b""
        if self._device.in_waiting:  # an empty read does not mean that the device is gone
            with suppress(BlockingIOError):  # another program has read it
                return os.read(self._file, MOST_BYTES_PER_READ)
            return b""
        if events[0][1] & GONE or not self._device.in_waiting:  # a device that is gone is readable and has no bytes
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return b""

    def reopen(self, now_s: float) -> bool:
        """Try to open a lost device again, every `retry_s`; return whether it did."""
        if self._device is not None or now_s < self._retry_at_s:
            return False
        self._retry_at_s = now_s + self._retry_s
        try:
            self._use(open_serial(self.path, self.baud))
        except SerialLineError as problem:
            self.problem = problem
            return False
        return True

    def close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            with suppress(OSError):  # the device may be gone already
                device.close()


def text_fraction(lines: Iterable[bytes]) -> float:
    """Return the fraction of bytes that is text; it is small at a wrong baud rate."""
    letters = b"".join(lines)
    return sum(32 <= letter < 127 or letter in b"\t\r\n" for letter in letters) / len(letters) if letters else 0.0


def open_serial(path: str, baud: int) -> Any:
    """Open a port of pyserial for exclusive use. Raises SerialLineError."""
    try:
        import serial
    except ModuleNotFoundError:
        raise SerialLineError(f"a serial port needs pyserial: {sys.executable} -m pip install pyserial") from None
    try:
        return serial.Serial(path, baud, timeout=0, exclusive=True)
    except (OSError, ValueError) as problem:  # SerialException is an OSError
        number = getattr(problem, "errno", None)
        why = os.strerror(number) if number else str(problem)
        raise SerialLineError(_refusal(path, baud, problem), why) from problem


def _refusal(path: str, baud: int, problem: Exception) -> str:
    number = getattr(problem, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"there is no serial port {path}: {_ports_text()}"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {path}: add yourself to the group of serial ports with "
            "`sudo usermod -aG dialout $USER`, log out and in again"
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(problem).lower():
        return f"{path} is in use by another program, such as a serial monitor: close that program"
    if number == errno.EISDIR or f"({errno.ENOTTY}," in str(problem):  # pyserial reports it in the text only
        return f"{path} is no serial port: {_ports_text()}"
    if isinstance(problem, ValueError):
        return f"{path} does not support {baud} baud: {problem}"
    return f"{path} does not open: {problem}"


def _ports_text() -> str:
    ports = list_ports()
    if not ports:
        return "this computer has none; is the device plugged in, and does its cable carry data?"
    return f"there are {', '.join(ports)}; name one of them"


def list_ports() -> list[str]:
    """List the serial ports of this computer, by their persistent names where they have one."""
    from serial.tools import list_ports as serial_ports

    persistent = {}
    folder = "/dev/serial/by-id"
    if os.path.isdir(folder):
        persistent = {os.path.realpath(f"{folder}/{name}"): f"{folder}/{name}" for name in sorted(os.listdir(folder))}
    return [persistent.get(port.device, port.device) for port in sorted(serial_ports.comports())]
