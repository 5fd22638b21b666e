"""Drive states from a recorded row, as the estimator reads them live.

A log holds the age of each signal in the tick that used it; the estimator reads stamps. This is the one place where
an age becomes a stamp again. The stamp is the one that the loop had, to the last digit: `now_s - stamp_s` is exact
while the age is at most half of `now_s` (Sterbenz's lemma), and an age of infinity stays one. Only within the first
moments of a clock that starts at zero, as a simulation's does, may the last bit differ.
"""

from collections.abc import Iterable, Sequence
from itertools import repeat

from control.records import DriveState, DriveStates, Joints

NO_AGES_S = repeat(0.0)


def recorded_states(
    now_s: float,
    angles_rad: Sequence[float],
    velocities_rad_s: Sequence[float],
    currents_a: Sequence[float],
    angle_ages_s: Iterable[float] = NO_AGES_S,
    current_ages_s: Iterable[float] = NO_AGES_S,
) -> DriveStates:
    """Return the states of a row at `now_s`; each sequence has one value for each joint, in the order of the rig."""
    states = (
        DriveState(angle_rad, velocity_rad_s, now_s - angle_age_s, current_a, now_s - current_age_s)
        for angle_rad, velocity_rad_s, current_a, angle_age_s, current_age_s in zip(
            angles_rad, velocities_rad_s, currents_a, angle_ages_s, current_ages_s, strict=False
        )
    )
    return Joints(*states)
