"""An emulated instrument on a pseudo-terminal, and the port that reads it, in steps of one clock."""

from typing import Any

from simulation.devices.serial_device import SerialTalker


class InstrumentBench:
    """Owns the time of both."""

    def __init__(self, instrument: SerialTalker, port: Any) -> None:
        self.instrument, self.port, self.now_s = instrument, port, 0.0

    def run(self, duration_s: float) -> list[Any]:
        """Return what the port reads in this time."""
        read, end_s = list[Any](), self.now_s + duration_s
        while self.now_s < end_s:
            self.now_s += 0.01
            self.instrument.step(self.now_s)
            read += self.port.read(self.now_s)
        return read

    def close(self) -> None:
        self.port.close()
        self.instrument.close()
