"""A plate cut into panels across its width, for the sum over its surface (plate_contact.py).

The paper's rectangle is one panel. Any other outline is cut into SLICES of equal width, and within a slice its lower
and upper boundary are replaced by the straight lines through their heights at the slice's two Gauss points. Where an
outline has a notch a slice has several panels, one above the other.
"""

from collections.abc import Iterator, Sequence
from math import sqrt
from typing import NamedTuple

from simulation.mud.rigid_plate import Attitude, PlateSize

GAUSS = 0.5 / sqrt(3.0)  # of a width, each side of its middle
SLICES = 4

Corner = tuple[float, float]


class Panel(NamedTuple):
    """From `inner_m` to `outer_m` outward; heights and their change outward are those of straight boundaries."""

    inner_m: float
    outer_m: float
    foot_m: float  # height of the lower boundary at 0 outward
    foot_slope: float
    length_m: float  # from there to the upper boundary
    length_slope: float

    def foot_at_m(self, outward_m: float) -> float:
        return self.foot_m + self.foot_slope * outward_m

    def length_at_m(self, outward_m: float) -> float:
        return self.length_m + self.length_slope * outward_m

    def foot_depth_m(self, attitude: Attitude, outward_m: float) -> float:
        depth_m, per_outward, per_upward, _ = attitude
        return depth_m + per_outward * outward_m - per_upward * self.foot_at_m(outward_m)

    def wet_part_m(self, attitude: Attitude) -> tuple[float, float]:
        """Return the width of the submerged part of the lower boundary, and how far outward its middle is."""
        inner_m, outer_m = self.inner_m, self.outer_m
        low_m, high_m = self.foot_depth_m(attitude, inner_m), self.foot_depth_m(attitude, outer_m)
        if low_m < 0.0 or high_m < 0.0:
            if low_m <= 0.0 and high_m <= 0.0:
                return 0.0, inner_m
            if self.foot_slope or self.foot_m:
                waterline_m = inner_m + (outer_m - inner_m) * low_m / (low_m - high_m)
            else:
                waterline_m = -attitude.depth_m / attitude.per_outward
            if low_m < 0.0:
                inner_m = waterline_m
            else:
                outer_m = waterline_m
        return outer_m - inner_m, (inner_m + outer_m) / 2.0


def panels_of(size: PlateSize) -> tuple[Panel, ...]:
    if not size.corners_m:
        return (Panel(-size.width_m / 2.0, size.width_m / 2.0, 0.0, 0.0, size.height_m, 0.0),)
    inner_m, slice_m = min(size.corners_m)[0], size.width_m / SLICES
    starts_m = [inner_m + number * slice_m for number in range(SLICES)]
    return tuple(panel for start_m in starts_m for panel in _slice(size.corners_m, start_m, start_m + slice_m))


def _slice(corners: Sequence[Corner], inner_m: float, outer_m: float) -> Iterator[Panel]:
    middle_m, apart_m = (inner_m + outer_m) / 2.0, 2.0 * GAUSS * (outer_m - inner_m)
    near_m, far_m = middle_m - apart_m / 2.0, middle_m + apart_m / 2.0
    near, far = chords_m(corners, near_m), chords_m(corners, far_m)
    if len(near) != len(far):  # a notch begins between them
        near = far = chords_m(corners, middle_m)
    for (low, high), (far_low, far_high) in zip(near, far, strict=True):
        foot_slope = (far_low - low) / apart_m
        length_slope = (far_high - far_low - high + low) / apart_m
        yield Panel(
            inner_m, outer_m, low - foot_slope * near_m, foot_slope, high - low - length_slope * near_m, length_slope
        )


def chords_m(corners: Sequence[Corner], outward_m: float) -> list[tuple[float, float]]:
    """Return the lower and upper end of each part of the outline at one distance outward."""
    edges = zip(corners, [*corners[1:], corners[0]], strict=True)
    heights_m = sorted(
        a[1] + (b[1] - a[1]) * (outward_m - a[0]) / (b[0] - a[0])
        for a, b in edges
        if (a[0] < outward_m) != (b[0] < outward_m)
    )
    return list(zip(heights_m[::2], heights_m[1::2], strict=True))


def sides_m(size: PlateSize, heights: int) -> tuple[float, float]:
    """Return how far outward the inner and the outer narrow side are: the middle of each one's range."""
    if not size.corners_m:
        return -size.width_m / 2.0, size.width_m / 2.0
    turned = [(s, u) for u, s in size.corners_m]
    middles_m = [size.height_m * (number + 0.5) / heights for number in range(heights)]
    chords = [chords_m(turned, height_m) for height_m in middles_m]
    inner_m, outer_m = [chord[0][0] for chord in chords], [chord[-1][1] for chord in chords]
    return (min(inner_m) + max(inner_m)) / 2.0, (min(outer_m) + max(outer_m)) / 2.0
