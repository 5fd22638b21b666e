"""The gains of the joint controller (control/joint_pd.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class JointGains:
    """The configuration refuses gains that leave less phase margin than LEAST_MARGIN_RAD of control/joint_pd.py."""

    sweep_stiffness_nm_rad: Annotated[float, Bounds(0.0, 200.0), Meaning("PD stiffness of the sweep joints")] = 8.0
    sweep_damping_nm_s_rad: Annotated[float, Bounds(0.0, 5.0), Meaning("PD damping of the sweep joints")] = 0.06
    adduction_stiffness_nm_rad: Annotated[
        float, Bounds(0.0, 200.0), Meaning("PD stiffness of the adduction joints")
    ] = 10.0
    adduction_damping_nm_s_rad: Annotated[float, Bounds(0.0, 5.0), Meaning("PD damping of the adduction joints")] = 0.08


# Answers to questions are a whole tick old, so the loop's delay is 1.5 ticks, 3.9 ms. The gains above then have phase
# margins of 12 and 15 degrees before the velocity is predicted, and joints held in clay of 9 kPa oscillate; these have
# 17 and 20, nearly those of drives that report by themselves.
GAINS_OF_ASKED_DRIVES = JointGains(
    sweep_stiffness_nm_rad=6.4,
    sweep_damping_nm_s_rad=0.054,
    adduction_stiffness_nm_rad=8.0,
    adduction_damping_nm_s_rad=0.072,
)
