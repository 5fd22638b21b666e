"""Which mud is where: named muds along the track, or those that the robot noticed, described by their coefficient k_p.

The description of a walk names one mud. Who prepared several can name them: as lengths along the track, or as the world
of a simulated robot. Without names a mud begins with the stride after which the robot noticed it.
"""

from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import inf
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from experiments.pictures.recorded_walk import RecordedWalk
from experiments.reports.mud_names import mud_label, mud_name
from experiments.reports.value_text import N_CM3
from simulation.mud.track import Track

BORDER_M = 0.03  # a plate closer to a border than this may be in either mud
UNMEASURED = "unmeasured mud"


class MudRegion(NamedTuple):
    """One mud along the time axis of a walk."""

    start_s: float
    end_s: float
    name: str


class MudLayout(NamedTuple):
    """Named muds along the track, one after the other."""

    names: tuple[str, ...]
    ends_m: tuple[float, ...]
    from_start: bool = False  # positions count from where the first walk begins, not from the origin of the pose

    def beginning_at(self, start_m: float) -> "MudLayout":
        """Return the same muds by the positions of a log in which the first walk begins at `start_m`."""
        if not self.from_start:
            return self
        return MudLayout(self.names, tuple(start_m + end_m for end_m in self.ends_m))

    def mud_at(self, plates_m: float, slip_m: float = 0.0) -> str:
        """Name the mud in which a plate goes down and slips back; empty past the last mud and near a border."""
        rear_m, front_m = plates_m - max(0.0, slip_m) - BORDER_M, plates_m - min(0.0, slip_m) + BORDER_M
        if not plates_m < self.ends_m[-1] or any(rear_m < border_m < front_m for border_m in self.ends_m[:-1]):
            return ""
        return self.names[sum(plates_m >= border_m for border_m in self.ends_m[:-1])]


def layout_of_lengths(muds: Sequence[tuple[str, float]]) -> MudLayout:
    """Return the layout of muds with their lengths in metres, on which the first walk begins."""
    ends_m = tuple(accumulate(length_m for _, length_m in muds))
    return MudLayout(tuple(mud_name(name) for name, _ in muds), ends_m, from_start=True)


def layout_of_track(track: Track) -> MudLayout:
    """Return the layout of a simulated track, the last mud of which has no end."""
    *borders_m, _ = [segment.end_m for segment in track.segments]
    return MudLayout(tuple(segment.ground.name for segment in track.segments), (*borders_m, inf))


def mud_regions(walk: RecordedWalk, layout: MudLayout | None) -> list[MudRegion]:
    """Return the muds along the time axis: by the arrival of the body in them, or as the robot noticed them."""
    starts_s, muds = ([0.0, *walk.mud_starts_s], []) if layout is None else _arrivals(walk, layout)
    pieces = [*pairwise([*starts_s, float(walk.time_s[-1])])]
    names = _described(walk, pieces) if layout is None else [mud_label(layout.names[mud]) for mud in muds]
    return [
        MudRegion(start_s, until_s, name)
        for (start_s, until_s), name in zip(pieces, names, strict=True)
        if start_s < until_s
    ]


def _arrivals(walk: RecordedWalk, layout: MudLayout) -> tuple[list[float], list[int]]:
    """Return when the body first arrived in each mud, forward or backward, and the number of that mud."""
    known = np.flatnonzero(np.isfinite(walk.body_x_m))
    if not len(known):
        return [0.0], [0]
    position_m = walk.body_x_m[known]
    farthest = np.minimum if position_m[-1] < position_m[0] else np.maximum
    muds = farthest.accumulate(np.searchsorted(layout.ends_m[:-1], position_m, side="right"))
    changes = np.flatnonzero(np.diff(muds)) + 1
    return [0.0, *walk.time_s[known[changes]].tolist()], muds[[0, *changes]].tolist()


def _described(walk: RecordedWalk, pieces: Sequence[tuple[float, float]]) -> list[str]:
    """Describe the mud of each piece of time by its k_p; where two read alike, also by the time at which they begin."""
    names: list[str] = []
    for start_s, until_s in pieces:
        name = describe_mud([s for s in walk.strides if start_s <= s["t_start_s"] < until_s])
        names.append(f"{name}, from {start_s:.0f} s" if name in names else name)
    return names


def describe_mud(strides: Sequence[dict[str, Any]]) -> str:
    """Describe a mud by the median of the strides' valid k_p, to two digits."""
    known = [each["k_p"] for each in strides if each.get("k_p_valid") and not each["k_p_at_least"]]
    return f"k_p {median(known) / N_CM3:#.2g} N/cm³" if known else UNMEASURED
