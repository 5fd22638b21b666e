"""Sand agrees with the published maps and with measured plates, and gives back no energy."""

import gzip
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulation.mud.grounds.sand import Sand, generic_resistance, spatial_resistance
from simulation.mud.grounds.sand_contact import SandContact
from simulation.mud.rigid_plate import Attitude, PlateSize, Twist
from tests.folders import SHARED_DATA
from tests.simulation.mud.plate_paths import SIZE, assert_no_work_is_gained, twists

UP, DOWN, AHEAD = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
SANDS = [Sand("generic", 1.55e6), Sand("spatial", 1.55e6, spatial=True)]
each_sand = pytest.mark.parametrize("sand", SANDS, ids=lambda sand: sand.name)
RUNS = sorted((SHARED_DATA / "plate_in_sand").glob("*.csv.gz"))
DEEPEST_M = 0.03  # that of a flipper


@pytest.mark.parametrize(
    ("normal", "direction", "along_motion"),
    [(UP, DOWN, 1.0), (UP, UP, 0.25), (AHEAD, AHEAD, 0.37), (AHEAD, DOWN, 0.128)],
)
def test_the_generic_map_has_the_published_values(normal, direction, along_motion) -> None:  # type: ignore[no-untyped-def]
    found = generic_resistance(normal, UP, direction)
    assert np.dot(found, direction) == pytest.approx(along_motion, abs=5e-4)


@pytest.mark.parametrize(("normal", "value"), [(DOWN, 0.875), (UP, 0.080)])
def test_the_spatial_map_has_the_published_values(normal, value) -> None:  # type: ignore[no-untyped-def]
    """It is scaled to 1 for a flat plate pushed down; only the side that advances counts."""
    assert 0.87504 * np.dot(spatial_resistance(normal, UP, normal), normal) == pytest.approx(value, abs=5e-4)
    assert spatial_resistance((-normal[0], -normal[1], -normal[2]), UP, normal) == (0.0, 0.0, 0.0)


@given(st.floats(-pi, pi), st.floats(-pi, pi), st.floats(-1.5, 1.5))
def test_maps_do_not_depend_on_the_heading_and_mirror(heading: float, bearing: float, steep: float) -> None:
    direction = np.array([cos(steep) * cos(bearing), cos(steep) * sin(bearing), sin(steep)])
    normal = np.array([sin(1.0), 0.0, -cos(1.0)])
    turn = np.array([[cos(heading), -sin(heading), 0.0], [sin(heading), cos(heading), 0.0], [0.0, 0.0, 1.0]])
    mirror = np.diag([1.0, -1.0, 1.0])
    for resistance in (generic_resistance, spatial_resistance):
        here = np.array(resistance(tuple(normal), UP, tuple(direction)))
        for change in (turn, mirror):
            there = resistance(tuple(change @ normal), UP, tuple(change @ direction))
            assert there == pytest.approx(tuple(change @ here), abs=1e-6)


def attitude_of(depth_m: float, sweep_rad: float, lean_rad: float) -> Attitude:
    tilt = sin(lean_rad)
    return Attitude(depth_m, -cos(sweep_rad) * tilt, cos(lean_rad), sin(sweep_rad) * tilt)


attitudes = st.builds(attitude_of, st.floats(-0.004, 0.08), st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))


@each_sand
@settings(max_examples=15)
@given(st.lists(st.tuples(attitudes, twists, st.integers(1, 20)), min_size=1, max_size=8))
def test_no_path_returns_more_work_than_the_sand_received(
    sand: Sand, motions: list[tuple[Attitude, Twist, int]]
) -> None:
    """Closed paths are among them: the plate may come back to any depth, and each leg here is also gone back."""
    backwards = [(a, Twist(*(-part for part in t)), n) for a, t, n in reversed(motions)]
    assert_no_work_is_gained(SandContact(SIZE), [(sand, *motion) for motion in (*motions, *backwards)])


@each_sand
def test_a_plate_at_rest_keeps_its_load_until_a_reset(sand: Sand) -> None:
    """In three dimensions the narrow sides add a part to the face's."""
    plate, deep = SandContact(SIZE), Attitude(0.03, 0.0, 1.0)
    for _ in range(300):
        moving = plate.step(0.001, sand, deep, Twist(0.1))
    assert -moving.normal_n == pytest.approx(sand.lateral_n(0.03, 0.025), rel=0.08 if sand.spatial else 1e-3)
    assert plate.step(0.001, sand, deep, Twist()) == moving
    plate.reset()
    assert not any(plate.step(0.001, sand, deep, Twist()))


def pushed(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return depth and force of the way down, and the simulated force for a stiffness of 1 N/m³."""
    with gzip.open(path, "rt") as file:
        depth_m, force_n = np.loadtxt(file.read().splitlines()[2:], delimiter=",")[:, 1:3].T / [[1000.0], [1.0]]
    down = slice(0, int(np.argmax(depth_m)) + 1)
    inside = (depth_m[down] > 0.0) & (depth_m[down] < DEEPEST_M)
    depth_m, force_n = depth_m[down][inside], force_n[down][inside]
    radius_m = float(path.name.removeprefix("plate").split("mm")[0]) / 2000.0
    circle = tuple((radius_m * cos(n * pi / 24.0), radius_m * sin(n * pi / 24.0)) for n in range(48))
    plate, grid_m = SandContact(PlateSize(2.0 * radius_m, 2.0 * radius_m, 0.004, circle)), np.arange(0.0, 0.03, 1e-4)
    forces_n = [
        plate.step(1e-3, Sand("unit", 1.0), Attitude(at_m, 0.0, 0.0, -1.0), Twist(-0.1)).normal_n for at_m in grid_m
    ]
    return depth_m, force_n, np.interp(depth_m, grid_m, forces_n)


@pytest.mark.skipif(not RUNS, reason="the shared measurements are not next to the repository")
def test_measured_plates_are_reproduced_with_one_stiffness_and_better_with_one_each() -> None:
    runs = [pushed(path) for path in RUNS]

    own = [float(force_n @ unit_n / (unit_n @ unit_n)) for _, force_n, unit_n in runs]

    def errors(stiffnesses: list[float]) -> np.ndarray:
        """Return the RMS errors over the peaks."""
        pairs = zip(stiffnesses, runs, strict=True)
        return np.array([np.sqrt(np.mean((f - k * unit) ** 2)) / f.max() for k, (_, f, unit) in pairs])

    assert errors(own).max() <= 0.08
    common = min(np.linspace(min(own), max(own), 41), key=lambda each: errors([each] * len(runs)).max())
    assert common == pytest.approx(1.55e6, rel=0.02)
    assert np.sqrt(np.mean(errors([common] * len(runs)) ** 2)) <= 0.15  # the worst run alone has 17 %
