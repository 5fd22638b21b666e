"""A crust or a weak layer of the simulated mud."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds


@dataclass(frozen=True)
class Layer:
    """Between two depths below the surface the mud has `factor` times its strength. Layers do not overlap."""

    top_m: Annotated[float, Bounds(0.0, 1.0)]
    bottom_m: Annotated[float, Bounds(0.0, 1.0)]
    factor: Annotated[float, Bounds(0.01, 20.0)]
