"""Walks over the simulated trackway: three muds in a row, at one depth or by a method of adaptation.

After section III-D of the paper the trackway of 1.83 m holds mud of 48.5, 53.1 and 45.3 % of water, here in the
simulator's clay with the disturbances of the authors' logs. A walk ends when the plates would go down past the end,
after 90 s in one mud, or with a fault.
"""

from collections.abc import Sequence
from math import fsum
from typing import Any

from experiments.trackway.depth_rule import rule_of, walk_by
from experiments.trackway.walk import Walk, WalkedStride
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

STUCK_S = 90.0  # longest walking time in one mud


def walk_trackway(compartment_m: float, seed: int, depth_m: float = 0.0, method: str = "") -> dict[str, Any]:
    """Return the entry of a walk over the paper's muds."""
    track = Track([(compartment_m, clay) for clay in MUDS.values()])
    return walk_by(rule_of(depth_m, method), track, seed, lambda strides: is_over(track.length_m, strides)).entry


def is_over(length_m: float, strides: Sequence[WalkedStride]) -> bool:
    return bool(strides) and (is_past(length_m, strides[-1]) or is_stuck(strides))


def is_past(length_m: float, last: WalkedStride) -> bool:
    """Return whether the plates go down past the end of the track next."""
    return last.position_m + last.step_m >= length_m


def is_stuck(strides: Sequence[WalkedStride]) -> bool:
    mud = strides[-1].mud
    return fsum(stride.duration_s for stride in strides if stride.mud == mud) >= STUCK_S


def end_of(walk: Walk, length_m: float) -> str:
    """Describe how a walk ended."""
    if walk.fault:
        return walk.fault
    last = walk.strides[-1]
    return "past the end" if is_past(length_m, last) else f"stuck in {last.mud}"
