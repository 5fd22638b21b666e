"""The muds along the way: segments of clay, the last of which goes on for ever."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from simulation.clay import MUDS, Clay

COMPARTMENT_M = 0.61  # the paper's trackway of 1.83 m, in three


class Segment(NamedTuple):
    end_m: float
    clay: Clay


class Track:
    def __init__(self, segments: Sequence[tuple[float, Clay]]) -> None:
        """`segments`: (length in metres, clay) from the start."""
        end_m = 0.0
        self.segments: list[Segment] = []
        for length_m, clay in segments:
            end_m += length_m
            self.segments.append(Segment(end_m, clay))

    @property
    def length_m(self) -> float:
        return self.segments[-1].end_m

    def clay_at(self, x_m: float) -> Clay:
        for segment in self.segments:
            if x_m < segment.end_m:
                return segment.clay
        return self.segments[-1].clay


def paper_track() -> Track:
    """Section II-F: w = 48.5, 53.1 and 45.3 %."""
    return Track([(COMPARTMENT_M, clay) for clay in MUDS.values()])
