"""The limits of every joint, which control/limits.py and the transmit gate enforce."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class JointLimits:
    torque_nm: Annotated[float, Bounds(0.0, 5.0), Meaning("largest commanded torque of a joint")] = (
        0.75  # the authors' optimiser's figure for the R60
    )
    torque_rate_nm_s: Annotated[
        float, Bounds(1.0, 10000.0), Meaning("largest rate of change of a commanded torque", "N·m/s")
    ] = 150.0
    velocity_rad_s: Annotated[float, Bounds(0.1, 200.0), Meaning("at which torque in the direction of motion ends")] = (
        20.0  # an extraction from 5 cm takes up to 16
    )
    sweep_min_deg: Annotated[float, Bounds(-180.0, 180.0), Meaning("end of the sweep joints' range, backward")] = -60.0
    sweep_max_deg: Annotated[float, Bounds(-180.0, 180.0), Meaning("end of the sweep joints' range, forward")] = 60.0
    adduction_min_deg: Annotated[
        float, Bounds(-180.0, 180.0), Meaning("end of the adduction joints' range, downward")
    ] = -75.0
    adduction_max_deg: Annotated[
        float, Bounds(-180.0, 180.0), Meaning("end of the adduction joints' range, upward")
    ] = 45.0
    temperature_warm_c: Annotated[float, Bounds(0.0, 150.0), Meaning("full torque up to this motor temperature")] = 70.0
    temperature_hot_c: Annotated[
        float, Bounds(0.0, 150.0), Meaning("no torque from this motor temperature on, and a fault")
    ] = 90.0
    position_margin_deg: Annotated[
        float, Bounds(0.0, 90.0), Meaning("beyond a joint's range by this much is a fault")
    ] = 10.0

    @property
    def widest_sweep_deg(self) -> float:
        """The widest sweep, from plus to minus this angle, within the range of the sweep joints."""
        return min(-self.sweep_min_deg, self.sweep_max_deg)
