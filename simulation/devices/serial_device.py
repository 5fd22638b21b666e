"""A device that prints lines on a serial port, emulated on a pseudo-terminal, with the faults of a real one.

Any program opens the other end of the pseudo-terminal as a serial port. Its baud rate is the kernel's setting, so a
device that was opened at another rate than its own sends noise, as over a wire. Lines may be lost for a while, be
garbled, or wait in an adapter that delivers its buffer every few milliseconds. A link to the pseudo-terminal stands in
for a name below /dev/serial/by-id: it disappears when the device is unplugged and points to a new one afterwards.
"""

import termios
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

from simulation.devices.pseudo_terminal import PseudoTerminal

SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}
DELIVERED_S = 1.0  # longest that the kernel takes to carry a line across a pseudo-terminal


@dataclass(frozen=True)
class TalkerParameters:
    rate_hz: float = 100.0
    baud: int = 115200
    burst_s: float = 0.016  # of the adapter's latency timer
    drop_out_rate_hz: float = 0.0
    drop_out_s: float = 0.2
    garbled_fraction: float = 0.0


class SerialTalker:
    """Owns the pseudo-terminal, the bytes in transit, and the time at which the next line is due.

    `line_at(time)` returns the line that is printed then; it is called once for each line, in order.
    """

    def __init__(
        self, line_at: Callable[[float], bytes], parameters: TalkerParameters, link: Path, random: Random
    ) -> None:
        self.parameters = parameters
        self.line_at = line_at
        self.link = link
        self.lost_lines = 0  # that were not read in time
        self._random = random
        self._terminal: PseudoTerminal | None = None
        self._due_s = self._burst_due_s = 0.0
        self._started = False
        self._silent_until_s = 0.0
        self.waiting = b""
        self.plug_in()

    def plug_in(self) -> None:
        self.link.unlink(missing_ok=True)
        self._terminal = PseudoTerminal(self.link)
        speed = next((code for code, baud in SPEEDS.items() if baud == self.parameters.baud), termios.B115200)
        settings = termios.tcgetattr(self._terminal.slave)
        settings[4] = settings[5] = speed
        termios.tcsetattr(self._terminal.slave, termios.TCSANOW, settings)

    def unplug(self) -> None:
        if self._terminal is not None:
            self._terminal.close()
            self._terminal, self.waiting = None, b""

    def step(self, now_s: float) -> None:
        """Print every line up to now, and deliver the adapter's buffer when it is due."""
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
        if self._terminal is not None and at_s >= self._silent_until_s:
            self.waiting += self._disturbed(line, self._terminal)

    def _disturbed(self, line: bytes, terminal: PseudoTerminal) -> bytes:
        if self._random.random() < self.parameters.garbled_fraction:
            index = self._random.randrange(max(1, len(line) - 2))
            line = line[:index] + bytes([self._random.randrange(128, 256)]) + line[index + 1 :]
        opened_at = SPEEDS.get(termios.tcgetattr(terminal.slave)[5])
        return line if opened_at == self.parameters.baud else self._noise(len(line))

    def _noise(self, length: int) -> bytes:
        """Return what a receiver decodes at another rate: any bytes, few of them line ends."""
        return bytes(self._random.choice((0x00, 0x80, 0xE0, 0xF8, 0xFE, 0xFF, 0x9C, 0x66, 0x1E)) for _ in range(length))

    def deliver(self) -> None:
        """Write the buffer and wait until it can be read: a pseudo-terminal delivers a moment later.

        The reader reads between two steps and must find all written bytes.
        """
        terminal = self._terminal
        if terminal is None or not self.waiting:
            return
        before, waiting, self.waiting = terminal.unread_bytes, self.waiting, b""
        written = terminal.write(waiting)
        self.lost_lines += waiting[written:].count(b"\n")
        deadline_s = time.monotonic() + DELIVERED_S
        while terminal.unread_bytes < before + written and time.monotonic() < deadline_s:
            time.sleep(0.00002)

    def close(self) -> None:
        self.unplug()
