"""A device that prints lines, as a serial port meets it: text on a pseudo-terminal, with all its faults.

The other end of the pseudo-terminal is what any program opens as a serial port. Its baud rate is the kernel's, so a
device that was opened at another rate than its own answers with noise, as a wire would. Lines may be lost for a while,
garbled, or wait in an adapter that hands over what it has every few milliseconds. A link to the pseudo-terminal stands
for a name below /dev/serial/by-id: unplugged, the device is gone; plugged in again, it is another one by that name.
"""

from __future__ import annotations

import fcntl
import os
import struct
import termios
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Annotated

from control.bounds import Bounds

SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}
DELIVERED_S = 1.0  # longest that the kernel takes to carry a line across a pseudo-terminal


@dataclass(frozen=True)
class TalkerParameters:
    rate_hz: Annotated[float, Bounds(1.0, 1000.0)] = 100.0
    baud: Annotated[int, Bounds(300, 1000000)] = 115200
    burst_s: Annotated[float, Bounds(0.0, 0.2)] = 0.016  # of the adapter's latency timer
    drop_out_rate_hz: Annotated[float, Bounds(0.0, 10.0)] = 0.0
    drop_out_s: Annotated[float, Bounds(0.0, 10.0)] = 0.2
    garbled_fraction: Annotated[float, Bounds(0.0, 1.0)] = 0.0


class SerialTalker:
    """Owns the pseudo-terminal, what is on its way through it, and when the next line is due.

    `line_at`, told a time, is the line that is printed then; it is asked once for each, in order.
    """

    def __init__(
        self, line_at: Callable[[float], bytes], parameters: TalkerParameters, link: Path, random: Random
    ) -> None:
        self.parameters = parameters
        self.line_at = line_at
        self.link = link
        self.waits_for_delivery = True  # whoever reads does so between two steps, and finds what was written
        self.lost_lines = 0  # that nobody had read in time
        self._random = random
        self._master = self._slave = -1
        self._due_s = self._burst_due_s = 0.0
        self._started = False
        self._silent_until_s = 0.0
        self.waiting = b""
        self.plug_in()

    @property
    def is_plugged_in(self) -> bool:
        return self._master >= 0

    def plug_in(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._set_speed()
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(self._slave))

    def _set_speed(self) -> None:
        speed = next((code for code, baud in SPEEDS.items() if baud == self.parameters.baud), termios.B115200)
        settings = termios.tcgetattr(self._slave)
        settings[4] = settings[5] = speed
        termios.tcsetattr(self._slave, termios.TCSANOW, settings)

    def unplug(self) -> None:
        if self.is_plugged_in:
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1
            self.waiting = b""
            self.link.unlink(missing_ok=True)

    def step(self, now_s: float) -> None:
        """Every line up to now, and what the adapter hands over by then."""
        period_s = 1.0 / self.parameters.rate_hz
        if not self._started:
            self._started, self._due_s = True, now_s + period_s
        while self._due_s <= now_s:
            self._print(self._due_s)
            self._due_s += period_s
        if now_s >= self._burst_due_s:
            self._burst_due_s = now_s + self.parameters.burst_s
            self.deliver()

    def _print(self, at_s: float) -> None:
        line = self.line_at(at_s)
        if self._random.random() < self.parameters.drop_out_rate_hz / self.parameters.rate_hz:
            self._silent_until_s = at_s + self.parameters.drop_out_s
        if self.is_plugged_in and at_s >= self._silent_until_s:
            self.waiting += self._invalid(line)

    def _invalid(self, line: bytes) -> bytes:
        if self._random.random() < self.parameters.garbled_fraction:
            place = self._random.randrange(max(1, len(line) - 2))
            line = line[:place] + bytes([self._random.randrange(128, 256)]) + line[place + 1 :]
        opened_at = SPEEDS.get(termios.tcgetattr(self._slave)[5])
        return line if opened_at == self.parameters.baud else self._noise(len(line))

    def _noise(self, length: int) -> bytes:
        """What a receiver makes of bits at another rate: any bytes, few of them ends of lines."""
        return bytes(self._random.choice((0x00, 0x80, 0xE0, 0xF8, 0xFE, 0xFF, 0x9C, 0x66, 0x1E)) for _ in range(length))

    def deliver(self) -> None:
        """And wait until it is there: a pseudo-terminal delivers a moment later."""
        if not self.is_plugged_in or not self.waiting:
            return
        before, waiting, self.waiting = self._unread_bytes(), self.waiting, b""
        try:
            written = os.write(self._master, waiting)
        except BlockingIOError:
            written = 0
        self.lost_lines += waiting[written:].count(b"\n")
        deadline_s = time.monotonic() + DELIVERED_S
        while self.waits_for_delivery and self._unread_bytes() < before + written and time.monotonic() < deadline_s:
            time.sleep(0.00002)

    def _unread_bytes(self) -> int:
        (count,) = struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))
        return int(count)

    def close(self) -> None:
        with suppress(OSError):
            self.unplug()
