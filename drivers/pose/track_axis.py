"""Parses the direction of the track in the frame of the motion capture: one of its axes, or any vector."""

from __future__ import annotations

from math import hypot, isfinite

Direction = tuple[float, float, float]
AXES: dict[str, Direction] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def parse_axis(axis: object) -> Direction | None:
    """Returns a unit vector from "x", "-z" or three numbers; None for anything else."""
    if isinstance(axis, str):
        direction = AXES.get(axis.removeprefix("-"))
        if direction is None or not axis.startswith("-"):
            return direction
        x, y, z = direction
        return -x, -y, -z
    if not isinstance(axis, list | tuple) or len(axis) != 3:
        return None
    if not all(isinstance(each, int | float) and not isinstance(each, bool) for each in axis):
        return None
    x, y, z = axis
    length = hypot(x, y, z)
    return (x / length, y / length, z / length) if isfinite(length) and length > 0.0 else None
