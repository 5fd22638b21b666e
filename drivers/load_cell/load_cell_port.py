"""A load cell's amplifier on a serial port: samples of force, also after the adapter was unplugged.

The amplifier sends lines of text at its own rate. LineReading never waits. A malformed line is counted and stored for
display, and an unplugged adapter is opened again as soon as it is back (serial_line.py).
"""

from math import isnan
from typing import NamedTuple

from drivers.load_cell.calibration import LoadCellCalibration
from drivers.load_cell.line_formats import NEWTONS, LineFormat, LineReading, printable
from drivers.load_cell.sample_clock import SampledLine


class ForceSample(NamedTuple):
    stamp_s: float
    force_n: float  # NaN where overloaded
    overloaded: bool = False


class LoadCellPort:
    """Reads samples of force. Owns its serial line and the counters, which only grow."""

    def __init__(self, path: str, baud: int, line_format: LineFormat, calibration: LoadCellCalibration) -> None:
        """Open the line; raises SerialLineError where it does not open."""
        self.line_format, self.calibration = line_format, calibration
        self.lines = self.malformed_lines = self.overloads = 0
        self.last_malformed = ""
        self.line = SampledLine(path, baud)

    @property
    def readable_fraction(self) -> float:
        return self.line.readable_fraction(lambda line: self.line_format.decode(line) is not None)

    def read(self, now_s: float) -> list[ForceSample]:
        """Return all samples that have arrived, oldest first; never waits."""
        self.line.reopen(now_s)
        samples = []
        for stamp_s, line in self.line.read_stamped(now_s):
            reading = self.line_format.decode(line)
            self.lines += 1
            if reading is None:
                self.malformed_lines += 1
                self.last_malformed = printable(line[:60]) or repr(line[:30])[2:-1]
                continue
            force_n = self.calibration.force_n(self._in_unit(reading))
            samples.append(ForceSample(stamp_s, force_n, isnan(force_n)))
            self.overloads += samples[-1].overloaded
        return samples

    def _in_unit(self, reading: LineReading) -> float:
        """Convert a reading whose line names another unit than the calibration."""
        own, wanted = reading.unit, self.calibration.unit.lower()
        if own == wanted or own not in NEWTONS or wanted not in NEWTONS:
            return reading.value
        return reading.value * NEWTONS[own] / NEWTONS[wanted]

    def close(self) -> None:
        self.line.close()
