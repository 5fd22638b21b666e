"""A load cell's amplifier as a serial port meets it: lines of text on a pseudo-terminal, with all their faults.

The other end of the pseudo-terminal is what any program opens as a serial port. Its baud rate is the kernel's, so an
amplifier that was opened at another rate than its own answers with noise, as a wire would. A converter integrates over
its period, adds noise and drift, rounds to a step of its own, and stops at its range. Lines may be lost for a while,
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
STYLES = ("counts", "newtons", "indicator", "columns")


@dataclass(frozen=True)
class AmplifierParameters:
    rate_hz: Annotated[float, Bounds(1.0, 1000.0)] = 80.0  # of an HX711 with its rate pin high; 10 with it low
    style: str = "counts"
    baud: Annotated[int, Bounds(300, 1000000)] = 115200
    counts_per_newton: Annotated[float, Bounds(-1e6, 1e6)] = 42000.0  # a cell of 20 N, 2 mV/V, and gain 128
    zero_counts: Annotated[float, Bounds(-8e6, 8e6)] = 81000.0
    noise_n: Annotated[float, Bounds(0.0, 1.0)] = 0.008  # of the mounted cell: the stage shakes more than the chip
    drift_n_s: Annotated[float, Bounds(-1.0, 1.0)] = 0.0
    range_n: Annotated[float, Bounds(0.0, 1e4)] = 20.0  # beyond it the cell is overloaded
    burst_s: Annotated[float, Bounds(0.0, 0.2)] = 0.016  # of the adapter's latency timer
    drop_out_rate_hz: Annotated[float, Bounds(0.0, 10.0)] = 0.0
    drop_out_s: Annotated[float, Bounds(0.0, 10.0)] = 0.2
    garbled_share: Annotated[float, Bounds(0.0, 1.0)] = 0.0


class EmulatedAmplifier:
    """Owns the pseudo-terminal, what is on its way through it, and when the next conversion ends.

    `mean_force_n`, told a time, is the force on the cell on average since the last conversion.
    """

    def __init__(
        self, mean_force_n: Callable[[float], float], parameters: AmplifierParameters, link: Path, seed: int = 1
    ) -> None:
        self.parameters = parameters
        self.mean_force_n = mean_force_n
        self.link = link
        self.awaits_delivery = True  # whoever reads does so between two steps, and finds what was written
        self.lost_lines = 0  # that nobody had read in time
        self._random = Random(seed)
        self._master = self._slave = -1
        self._due_s = self._burst_due_s = 0.0
        self._started_s: float | None = None
        self._silent_until_s = 0.0
        self._waiting = b""
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
            self._waiting = b""
            self.link.unlink(missing_ok=True)

    def step(self, now_s: float) -> None:
        """Every conversion up to now, and what the adapter hands over by then."""
        period_s = 1.0 / self.parameters.rate_hz
        if self._started_s is None:
            self._started_s, self._due_s = now_s, now_s + period_s
        while self._due_s <= now_s:
            self._convert(self._due_s)
            self._due_s += period_s
        if now_s >= self._burst_due_s:
            self._burst_due_s = now_s + self.parameters.burst_s
            self._hand_over()

    def _convert(self, at_s: float) -> None:
        force_n = self.mean_force_n(at_s) + self._random.gauss(0.0, self.parameters.noise_n)
        force_n += self.parameters.drift_n_s * (at_s - (self._started_s or 0.0))
        if self._random.random() < self.parameters.drop_out_rate_hz / self.parameters.rate_hz:
            self._silent_until_s = at_s + self.parameters.drop_out_s
        if self.is_plugged_in and at_s >= self._silent_until_s:
            self._waiting += self._spoilt(self._line(force_n, at_s))

    def _line(self, force_n: float, at_s: float) -> bytes:
        overloaded = abs(force_n) > self.parameters.range_n
        style, told = self.parameters.style, max(min(force_n, 1e6), -1e6)
        if style == "indicator":
            return b"OL,GS,+-------kg\r\n" if overloaded else f"ST,GS,{told / 9.80665:+09.5f}kg\r\n".encode()
        if style == "newtons":
            return b"OL\r\n" if overloaded else f"Load: {told:.4f} N\r\n".encode()
        end = 2**23 - 1 if force_n * self.parameters.counts_per_newton > 0.0 else -(2**23)
        counts = round(self.parameters.zero_counts + self.parameters.counts_per_newton * force_n)
        counts = end if overloaded else max(-(2**23), min(counts, 2**23 - 1))
        return f"{round(1000 * at_s)},{counts}\r\n".encode() if style == "columns" else f"{counts}\r\n".encode()

    def _spoilt(self, line: bytes) -> bytes:
        if self._random.random() < self.parameters.garbled_share:
            place = self._random.randrange(max(1, len(line) - 2))
            line = line[:place] + bytes([self._random.randrange(128, 256)]) + line[place + 1 :]
        opened_at = SPEEDS.get(termios.tcgetattr(self._slave)[5])
        return line if opened_at == self.parameters.baud else self._noise(len(line))

    def _noise(self, length: int) -> bytes:
        """What a receiver makes of bits at another rate: any bytes, few of them ends of lines."""
        return bytes(self._random.choice((0x00, 0x80, 0xE0, 0xF8, 0xFE, 0xFF, 0x9C, 0x66, 0x1E)) for _ in range(length))

    def _hand_over(self) -> None:
        """And wait until it is there: a pseudo-terminal delivers a moment later."""
        if not self.is_plugged_in or not self._waiting:
            return
        before, waiting, self._waiting = self._unread_bytes(), self._waiting, b""
        try:
            written = os.write(self._master, waiting)
        except BlockingIOError:
            written = 0
        self.lost_lines += waiting[written:].count(b"\n")
        deadline_s = time.monotonic() + DELIVERED_S
        while self.awaits_delivery and self._unread_bytes() < before + written and time.monotonic() < deadline_s:
            time.sleep(0.00002)

    def _unread_bytes(self) -> int:
        (count,) = struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))
        return int(count)

    def close(self) -> None:
        with suppress(OSError):
            self.unplug()
