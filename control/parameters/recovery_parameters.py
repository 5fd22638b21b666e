"""How a flipper that is stuck in the mud is freed (control/gait/recovery.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class RecoveryParameters:
    """The attempts to free a flipper that is stuck, and their motion."""

    attempts: Annotated[
        int,
        Bounds(0, 20),
        Meaning("to free a stuck flipper before it is a fault; 0: swing does not wait for it", "count"),
    ] = 3
    grace_s: Annotated[float, Bounds(0.0, 5.0), Meaning("at full torque before the first attempt")] = (
        0.3  # joints follow late, by up to 0.2 s in simulated clay
    )
    pause_s: Annotated[float, Bounds(0.0, 30.0), Meaning("without pull, before each attempt")] = 0.3
    attempt_s: Annotated[float, Bounds(0.1, 30.0), Meaning("of one attempt")] = 4.0
    lift_rad_s: Annotated[float, Bounds(0.05, 5.0), Meaning("speed at which the adduction target rises")] = 1.0
    rock_s: Annotated[float, Bounds(0.02, 2.0), Meaning("one movement of the sweep to and fro")] = 0.1
    lead_deg: Annotated[
        float, Bounds(0.5, 45.0), Meaning("of the targets ahead of the joints; times the stiffness, the full torque")
    ] = 8.0
