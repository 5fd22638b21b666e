"""A load cell's amplifier on a serial port: samples of force, whatever becomes of the cable.

The amplifier talks whenever it likes, in lines of text; nothing is ever sent to it. Reading never waits. A line that
cannot be read is counted and kept to be shown, an adapter that is pulled out is opened again by the same path as soon
as it is back (`/dev/serial/by-id/...` stays the same in another socket, `/dev/ttyUSB0` may not), and bytes that are no
text are what a wrong baud rate looks like. pyserial opens and sets up the device, and is imported only then.
"""

from __future__ import annotations

import errno
import os
import select
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

from drivers.load_cell_calibration import LoadCellCalibration
from drivers.load_cell_clock import LineClock
from drivers.load_cell_lines import LONGEST_LINE_BYTES, NEWTONS, LineFormat, Reading, printable, text_share

RETRY_S = 0.5
KEPT_LINES = 40  # by which it is judged what arrives
MOST_BYTES = 65536
COMMON_BAUDS = (9600, 115200, 57600, 38400, 19200, 4800, 2400, 230400)
SILENT_S = 1.0  # without any line
GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL


class LoadCellPortError(Exception):
    """The port does not open; the text says why, and what to do."""


class Sample(NamedTuple):
    stamp_s: float
    force_n: float  # NaN where overloaded
    overloaded: bool = False


class Arrivals(NamedTuple):
    """Of the last lines, what share was readable, and what share of their bytes was text."""

    lines: int
    readable: float
    text: float


class LoadCellPort:
    """Owns the open device, the line under way and the counters, which only grow."""

    def __init__(
        self,
        path: str,
        baud: int,
        line_format: LineFormat,
        calibration: LoadCellCalibration,
        open_line: Callable[[str, int], Any] | None = None,
    ) -> None:
        """Raises LoadCellPortError where it does not open."""
        self.path, self.baud = path, baud
        self.line_format, self.calibration = line_format, calibration
        self.lines = self.garbled_lines = self.overloads = self.unpluggings = 0
        self.last_garbled = self.last_problem = ""
        self.clock = LineClock(baud)
        self.open_line = open_line or open_serial
        self._line: Any = self.open_line(path, baud)
        self._heard_s: float | None = None
        self._retry_s = 0.0
        self._start_line()

    def _start_line(self) -> None:
        self._begun, self._is_first = b"", True  # the first line may be the end of one
        self._recent: deque[bytes] = deque(maxlen=KEPT_LINES)
        self._judged: deque[bool] = deque(maxlen=KEPT_LINES)
        self._poll = select.poll()
        self._poll.register(self._line.fileno(), select.POLLIN)

    @property
    def is_there(self) -> bool:
        return self._line is not None

    @property
    def rate_hz(self) -> float | None:
        """Of the lines, once a few have come."""
        return None if self.clock.period_s is None else 1.0 / self.clock.period_s

    @property
    def arrivals(self) -> Arrivals:
        lines = len(self._judged)
        return Arrivals(lines, sum(self._judged) / lines if lines else 0.0, text_share(self._recent))

    @property
    def recent_lines(self) -> list[bytes]:
        return list(self._recent)

    def silent_for_s(self, now_s: float) -> float:
        return 0.0 if self._heard_s is None else now_s - self._heard_s

    def read(self, now_s: float) -> list[Sample]:
        """All samples that have arrived, oldest first; never waits."""
        if self._heard_s is None:
            self._heard_s = now_s
        if self._line is None and not self._reopen(now_s):
            return []
        try:
            arrived = self._fetch()
        except BlockingIOError:  # somebody else has read it
            arrived = b""
        except OSError as problem:
            self._lose(problem, now_s)
            return []
        *lines, self._begun = (self._begun + arrived).replace(b"\r", b"\n").split(b"\n")
        if len(self._begun) > LONGEST_LINE_BYTES:  # no end of a line is to be expected of noise
            lines, self._begun = [*lines, self._begun], b""
        return self._take([line for line in lines if line.strip()], now_s)

    def _fetch(self) -> bytes:
        """Raises OSError where the device is gone."""
        events = self._poll.poll(0)
        if not events:
            return b""
        waiting = self._line.in_waiting
        if waiting:
            return os.read(self._line.fileno(), min(waiting, MOST_BYTES))
        if events[0][1] & GONE or not self._line.in_waiting:  # a device that is gone is ready, and has nothing
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return b""

    def _take(self, lines: list[bytes], now_s: float) -> list[Sample]:
        if not lines:
            return []
        self._heard_s = now_s
        samples = []
        for line, stamp_s in zip(lines, self.clock.stamps_s(len(lines), now_s), strict=True):
            reading = self.line_format.decode(line)
            if self._is_first:
                self._is_first = False
                continue
            self._count(line, reading)
            if reading is not None:
                samples.append(self._sample(stamp_s, reading))
        return samples

    def _count(self, line: bytes, reading: Reading | None) -> None:
        self.lines += 1
        self._recent.append(line)
        self._judged.append(reading is not None)
        if reading is None:
            self.garbled_lines += 1
            self.last_garbled = printable(line[:60]) or repr(line[:30])[2:-1]

    def _sample(self, stamp_s: float, reading: Reading) -> Sample:
        if reading.overloaded:
            self.overloads += 1
            return Sample(stamp_s, float("nan"), True)
        return Sample(stamp_s, self.calibration.force_n(self._in_unit(reading)))

    def _in_unit(self, reading: Reading) -> float:
        """A line that names its unit is believed."""
        own, wanted = reading.unit, self.calibration.unit.lower()
        if own == wanted or own not in NEWTONS or wanted not in NEWTONS:
            return reading.value
        return reading.value * NEWTONS[own] / NEWTONS[wanted]

    def _lose(self, problem: OSError, now_s: float) -> None:
        self.unpluggings += 1
        self.last_problem = problem.strerror or str(problem)
        self.close()
        self._retry_s = now_s + RETRY_S

    def _reopen(self, now_s: float) -> bool:
        if now_s < self._retry_s:
            return False
        self._retry_s = now_s + RETRY_S
        try:
            self._line = self.open_line(self.path, self.baud)
        except LoadCellPortError as problem:
            self.last_problem = str(problem)
            return False
        self._start_line()
        self.clock.reset()
        return True

    def close(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            with suppress(OSError):  # of a device that is gone already
                line.close()


def open_serial(path: str, baud: int) -> Any:
    """Non-blocking. Raises LoadCellPortError."""
    try:
        import serial
    except ModuleNotFoundError:
        raise LoadCellPortError("a load cell needs pyserial: install mudskipper with its extra 'serial'") from None
    try:
        line = serial.Serial(path, baud, timeout=0, exclusive=True)
    except (serial.SerialException, ValueError) as problem:
        raise LoadCellPortError(_refusal(path, baud, problem)) from problem
    os.set_blocking(line.fileno(), False)
    return line


def _refusal(path: str, baud: int, problem: Exception) -> str:
    number = getattr(problem, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"there is no serial port {path}: {_ports_told()}"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {path}: add yourself to the group of serial ports with "
            "`sudo usermod -aG dialout $USER`, log out and in again"
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(problem).lower():
        return f"{path} is in use by another program, such as a serial monitor: close that one"
    if f"({errno.ENOTTY}," in str(problem):  # pyserial tells it in words only
        return f"{path} is no serial port: {_ports_told()}"
    if isinstance(problem, ValueError):
        return f"{path} does not take {baud} baud: {problem}"
    return f"{path} does not open: {problem}"


def _ports_told() -> str:
    ports = list_ports()
    if not ports:
        return "this computer sees none at all; is the amplifier plugged in, and does its cable carry data?"
    return f"there are {', '.join(ports)}; use --port with one of them"


def list_ports() -> list[str]:
    """Serial ports of this computer, by their lasting names where they have one."""
    from serial.tools import list_ports as serial_ports

    lasting = {}
    folder = "/dev/serial/by-id"
    if os.path.isdir(folder):
        lasting = {os.path.realpath(f"{folder}/{name}"): f"{folder}/{name}" for name in sorted(os.listdir(folder))}
    return [lasting.get(port.device, port.device) for port in sorted(serial_ports.comports())]
