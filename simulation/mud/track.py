"""The ground along the track: segments of mud or sand, the last of which has no end, and their unevenness.

    ridges             the surface is A sin(2 π x / λ) above its nominal height
    random strength    log-normal about each segment's own, with the standard deviation `relative_spread` times the
                       mean, and a correlation that falls to 1/e over `correlation_length_m`: a chain of cells a tenth
                       of that long, each drawn from the one before it (a first-order autoregression of its logarithm)
    stones             buried blocks: stones.py models their forces on a plate

Each is off by default. Draws depend on their own seed only, so the ground is the same in every run.
"""

from collections.abc import Sequence
from math import exp, log, pi, sin, sqrt
from random import Random
from typing import NamedTuple

from simulation.mud.clay import MUDS
from simulation.mud.ground_contact import Ground
from simulation.mud.stones import Stone
from simulation.mud.unevenness import RandomStrength, Ridges

COMPARTMENT_M = 0.61  # the paper's trackway of 1.83 m, in three
CELLS_PER_LENGTH = 10
FARTHEST_DRAW = 3.0  # standard deviations: no single cell of rock
LEVEL = Ridges()
UNIFORM = RandomStrength()


class Segment(NamedTuple):
    end_m: float
    ground: Ground


class StrengthChain:
    """Owns the factors drawn so far, cell by cell from the start of the track."""

    def __init__(self, parameters: RandomStrength) -> None:
        self.parameters = parameters
        self.cell_m = parameters.correlation_length_m / CELLS_PER_LENGTH
        self.reset()

    def reset(self) -> None:
        self._random = Random(self.parameters.seed)
        self._deviation = self._random.gauss()
        self._factors = [self._factor()]

    def factor_at(self, x_m: float) -> float:
        cell = max(0, int(x_m / self.cell_m))
        while len(self._factors) <= cell:
            memory = exp(-1.0 / CELLS_PER_LENGTH)
            self._deviation = memory * self._deviation + sqrt(1.0 - memory * memory) * self._random.gauss()
            self._factors.append(self._factor())
        return self._factors[cell]

    def _factor(self) -> float:
        """exp(σ d - σ²/2) with σ² = ln(1 + spread²) has the mean 1 and the spread's standard deviation."""
        variance = log(1.0 + self.parameters.relative_spread**2)
        deviation = min(max(self._deviation, -FARTHEST_DRAW), FARTHEST_DRAW)
        return exp(sqrt(variance) * deviation - variance / 2.0)


class Track:
    def __init__(
        self,
        segments: Sequence[tuple[float, Ground]],
        stones: Sequence[Stone] = (),
        ridges: Ridges = LEVEL,
        random_strength: RandomStrength = UNIFORM,
    ) -> None:
        """`segments`: (length in metres, ground) from the start."""
        end_m = 0.0
        self.segments: list[Segment] = []
        for length_m, ground in segments:
            end_m += length_m
            self.segments.append(Segment(end_m, ground))
        self.stones = tuple(stones)
        self.ridges = ridges
        self._chain = StrengthChain(random_strength) if random_strength.relative_spread else None

    @property
    def length_m(self) -> float:
        return self.segments[-1].end_m

    def segment_at(self, x_m: float) -> Segment:
        for segment in self.segments:
            if x_m < segment.end_m:
                return segment
        return self.segments[-1]

    def ground_at(self, x_m: float) -> Ground:
        ground = self.segment_at(x_m).ground
        return ground.scaled(self._chain.factor_at(x_m)) if self._chain else ground

    def surface_m(self, x_m: float) -> float:
        """Return how far the mud's surface lies below its nominal height because of the ridges."""
        if not self.ridges.amplitude_m:
            return 0.0
        return -self.ridges.amplitude_m * sin(2.0 * pi * x_m / self.ridges.wavelength_m)


def paper_track() -> Track:
    """Make the track of section II-F: w = 48.5, 53.1 and 45.3 %."""
    return Track([(COMPARTMENT_M, clay) for clay in MUDS.values()])
