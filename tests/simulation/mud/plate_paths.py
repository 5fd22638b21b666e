"""Motions of a plate that hypothesis draws, and the energy that the ground may return along a path of them."""

from collections.abc import Iterable
from typing import Any

from hypothesis import strategies as st

from simulation.mud.rigid_plate import Attitude, PlateSize, Twist

SIZE = PlateSize(0.025, 0.07, 0.004)
DT_S = 0.001
turns = st.floats(-4.0, 4.0)
speeds = st.floats(-0.5, 0.5)
twists = st.builds(Twist, speeds, speeds, speeds, turns, turns, turns, turns)


def assert_no_work_is_gained(plate: Any, path: Iterable[tuple[Any, Attitude, Twist, int]]) -> None:
    """Move a plate by ground, attitude, twist and number of steps; the fields of wrench and twist correspond."""
    given_j = 0.0
    for ground, attitude, twist, steps in path:
        for _ in range(steps):
            wrench = plate.step(DT_S, ground, attitude, twist)
            given_j += DT_S * sum(force * speed for force, speed in zip(wrench, twist, strict=True))
            assert given_j < 1e-9
