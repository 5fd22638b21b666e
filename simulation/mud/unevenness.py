"""How the simulated ground varies along the track (simulation/mud/track.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds


@dataclass(frozen=True)
class Ridges:
    """Waves of the surface; track.py has their formula."""

    amplitude_m: Annotated[float, Bounds(0.0, 0.01)] = 0.0  # less than the 14 mm by which a raised flipper clears mud
    wavelength_m: Annotated[float, Bounds(0.02, 10.0)] = 0.2


@dataclass(frozen=True)
class RandomStrength:
    """Variation of the strength along the track; track.py has its law."""

    relative_spread: Annotated[float, Bounds(0.0, 0.5)] = 0.0
    correlation_length_m: Annotated[float, Bounds(0.01, 10.0)] = 0.1
    seed: Annotated[int, Bounds(0, 2**31 - 1)] = 1
