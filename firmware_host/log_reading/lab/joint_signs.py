"""Finds the signs of the joints' positions and currents, which differ from log to log."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from control.records import Phase

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Truths = NDArray[np.bool_]

PUSHING = (Phase.STANCE, Phase.INSERTION, Phase.STANCE, Phase.INSERTION)  # the phase in which each joint works on mud


def orient(angle_rad: Floats, current_a: Floats, phase: Integers) -> None:
    """Inverts a joint's angle unless it falls while pushing, then its current unless that does positive work."""
    for joint, pushing in enumerate(PUSHING):
        inside = steps_inside(phase, pushing)
        if np.nansum(np.diff(angle_rad[:, joint])[inside]) > 0.0:
            angle_rad[:, joint] *= -1.0
        mean_current_a = (current_a[1:, joint] + current_a[:-1, joint]) / 2.0
        if np.nansum((mean_current_a * np.diff(angle_rad[:, joint]))[inside]) < 0.0:
            current_a[:, joint] *= -1.0


def steps_inside(phase: Integers, wanted: Phase) -> Truths:
    """Returns which steps from one row to the next begin and end in a phase."""
    inside: Truths = (phase[1:] == wanted) & (phase[:-1] == wanted)
    return inside
