"""The position of a linear stage from its encoder: a serial port on which a counter sends one count per line.

encoder_counts.py decodes the lines and rejects implausible counts. The counter sends at a steady rate of its own, so
the stamps are as even (sample_clock.py); a constant delay remains in them. Reading never waits, and an unplugged device
is opened again as soon as it is back.
"""

from dataclasses import dataclass
from typing import NamedTuple

from drivers.load_cell.sample_clock import SampledLine
from drivers.serial.encoder_counts import EncoderCounts


@dataclass(frozen=True)
class StageEncoderSettings:
    path: str
    metres_per_count: float  # its sign is found from the stroke
    baud: int = 115_200
    label: str = ""  # with which each line begins


class StagePosition(NamedTuple):
    stamp_s: float
    position_m: float


class StageEncoder:
    """Reads the positions. Owns its serial line and its counts."""

    def __init__(self, settings: StageEncoderSettings) -> None:
        """Open the line; raises SerialLineError where it does not open."""
        self.settings = settings
        self.line = SampledLine(settings.path, settings.baud)
        self.counts = EncoderCounts(settings.metres_per_count, settings.label)
        self._heard_s: float | None = None

    @property
    def breaks(self) -> int:
        """The number of times that the zero of the positions may have changed."""
        return self.line.unpluggings + self.counts.jumps

    @property
    def last_problem(self) -> str:
        return "" if self.line.problem is None else self.line.problem.why

    @property
    def readable_fraction(self) -> float:
        return self.line.readable_fraction(lambda line: self.counts.decode(line) is not None)

    def silent_for_s(self, now_s: float) -> float:
        """Return for how long no count has arrived."""
        return 0.0 if self._heard_s is None else now_s - self._heard_s

    def read(self, now_s: float) -> list[StagePosition]:
        """Return all positions that have arrived, oldest first; never waits."""
        if self.line.reopen(now_s):
            self.counts.reset()
        accepted = [(stamp_s, self.counts.accept(line, stamp_s)) for stamp_s, line in self.line.read_stamped(now_s)]
        positions = [StagePosition(stamp_s, position_m) for stamp_s, position_m in accepted if position_m is not None]
        if positions or self._heard_s is None:
            self._heard_s = now_s
        return positions

    def close(self) -> None:
        self.line.close()
