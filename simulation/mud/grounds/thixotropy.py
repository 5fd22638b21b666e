"""How a mud softens while it is worked and recovers at rest (simulation/mud/grounds/thixotropic_mud.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds


@dataclass(frozen=True)
class Thixotropy:
    loss_per_strain: Annotated[float, Bounds(0.0, 10.0)] = 0.09  # Γ: 17 % of the strength in a stroke, as in the logs
    recovery_s: Annotated[float, Bounds(0.1, 1e6)] = 60.0  # τ, which no log of ours fixes
    relaxation_s: Annotated[float, Bounds(0.1, 1e6)] = 20.0  # T: 14 % of a load in 3 s
    viscosity_pa_s: Annotated[float, Bounds(0.0, 1e3)] = 5.0  # η
