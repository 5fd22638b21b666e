"""Vectors in three dimensions, as bare tuples: the simulator's steps make many of them."""

from math import hypot

LEVEL = 1e-6  # a horizontal part that is smaller has no direction
Vector = tuple[float, float, float]


def dot(one: Vector, other: Vector) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: Vector, other: Vector) -> Vector:
    (a, b, c), (x, y, z) = one, other
    return b * z - c * y, c * x - a * z, a * y - b * x


def along(vector: Vector, factor: float) -> Vector:
    return vector[0] * factor, vector[1] * factor, vector[2] * factor


def added(*vectors: Vector) -> Vector:
    x = y = z = 0.0
    for vector in vectors:
        x, y, z = x + vector[0], y + vector[1], z + vector[2]
    return x, y, z


def horizontal(up: Vector, *candidates: Vector) -> Vector:
    """Return the direction of the first horizontal part that has one."""
    for vector in (*candidates, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        level = added(vector, along(up, -dot(vector, up)))
        length = hypot(*level)
        if length > LEVEL:
            return along(level, 1.0 / length)
    raise ValueError("up: must not be zero")
