"""The height of the mud's surface, from light touches of a robot that holds its pose.

Each flipper goes down slowly, at several sweeps, until its force has risen and a little further. A touch leaves a
print, so no two are at one position. The surface of each is found from force over depth as that of an insertion is
(estimation/strokes/surface.py), but only 2 to 5 mm deep: what the law of the force shifts it by is 0.2 to 0.6 mm. Mud
falls off the plate as it goes down, so the force in the air is a line, which is subtracted. Mud is met by the deepest
corner of a plate that leans, and withstands its full load once the edge has sunk by a tenth of its thickness, as under
footings.

The touches scatter by s, from their own errors and the unevenness of the mud; all have the same error ε of law and
sinking.
So the mean of n touches has the error √(s²/n + ε²), and the mud at one stride lies √(s² + s²/n + ε²) from this mean.
"""

from collections.abc import Callable, Sequence
from math import cos, hypot, sin, sqrt
from statistics import fmean, variance
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from control.computing.bounded_work import finish
from control.geometry import FlipperGeometry
from estimation.strokes.surface import NO_SURFACE, Surface, find_surface
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import BenchRobot, move

POSITIONS = 5  # of each flipper, from the front to the rear end of its stance
SPEED_RAD_S = 0.025  # 3 mm/s: dry friction is constant, and inertia nothing
REACH_M = 0.025  # below the nominal surface
RISE_N = 0.18  # six times the noise of the difference of two means, 5 mm apart
LATEST = 16  # samples of each mean, of 0.05 s: 2.4 mm
FIRST = 4  # samples in which the flipper accelerates
BEYOND_M = 0.001
BATCH_M = 0.00025
ACCELERATING_M = 0.001
ABOVE_M = 0.004  # the force has risen at most so far below the surface
SINKING_FRACTION = 0.1  # of the plate's thickness
MOST_MISSED = 2  # touches; the next one ends the probe

Column: TypeAlias = NDArray[np.float64]


class Descent(NamedTuple):
    """A way down until the force rose."""

    flipper: str
    sweep_rad: float
    begin_s: float
    end_s: float
    touched_m: float | None  # depth where the rise was noticed


class Touch(NamedTuple):
    flipper: str
    sweep_rad: float
    surface: Surface


class ProbedSurface(NamedTuple):
    """The mud's surface, below its nominal height."""

    touches: list[Touch]
    depth_m: float
    std_error_m: float
    scatter_m: float  # of the touches

    @property
    def stride_error_m(self) -> float:
        """The standard error of this height at one stride, as `estimation.surface_error_m` has it."""
        return hypot(self.scatter_m, self.std_error_m)


class Rise:
    """Watches the force on a flipper that goes down: it has arrived where the force rose, and a little further."""

    def __init__(self, flipper: str) -> None:
        self._flipper = flipper
        self._forces_n: list[float] = []
        self.touched_m: float | None = None

    def __call__(self, status: dict[str, Any]) -> bool:
        load = status["loads"][self._flipper]
        if self.touched_m is not None:
            return bool(load["depth_m"] > self.touched_m + BEYOND_M)
        self._forces_n.append(load["force_z_n"])
        before_n, latest_n = self._forces_n[-3 * LATEST : -2 * LATEST], self._forces_n[-LATEST:]
        if len(self._forces_n) > FIRST + 3 * LATEST and fmean(latest_n) > fmean(before_n) + RISE_N:
            self.touched_m = load["depth_m"]
        return False


def probe_surface(robot: BenchRobot, show: Callable[[int, int], None]) -> ProbedSurface:
    """Touch the mud with every flipper of a robot that holds its pose. Raises BenchError, also without ground."""
    rig, geometry, front_deg = (
        robot.configuration.rig,
        robot.configuration.geometry,
        robot.configuration.gait.sweep_angle_deg,
    )
    planned = [
        (flipper, sweep_deg) for flipper in rig.flippers for sweep_deg in np.linspace(front_deg, -front_deg, POSITIONS)
    ]
    move(robot, {f"{flipper}_adduction": 0.0 for flipper in rig.flippers})
    descents: list[Descent] = []
    for number, (flipper, sweep_deg) in enumerate(planned):
        show(number, len(planned))
        descents.append(descend(robot, flipper, float(np.radians(sweep_deg))))
        require_ground([each.touched_m is not None for each in descents])
    ticks = robot.record(descents[0].begin_s, descents[-1].end_s).ticks
    surfaces = [find_touched(ticks, rig.flippers.index(each.flipper), geometry, each) for each in descents]
    require_ground([surface.found for surface in surfaces])
    return combined(
        [
            Touch(each.flipper, each.sweep_rad, found)
            for each, found in zip(descents, surfaces, strict=True)
            if found.found
        ],
        SINKING_FRACTION * geometry.plate_thickness_m,
    )


def descend(robot: BenchRobot, flipper: str, sweep_rad: float) -> Descent:
    """Lower a flipper until it meets mud, and raise it. Raises BenchError."""
    adduction, rise = f"{flipper}_adduction", Rise(flipper)
    move(robot, {f"{flipper}_sweep": sweep_rad})
    begin_s = robot.call("status")["now_s"]
    there_rad = robot.configuration.geometry.adduction_rad(sweep_rad, REACH_M)
    move(robot, {adduction: there_rad}, rise, speed_rad_s=SPEED_RAD_S)
    end_s = robot.call("status")["now_s"]
    move(robot, {adduction: 0.0})
    return Descent(flipper, sweep_rad, begin_s, end_s, rise.touched_m)


def require_ground(found: Sequence[bool]) -> None:
    """Raises BenchError after too many touches without ground."""
    missed = found.count(False)
    if missed > MOST_MISSED:
        raise BenchError(
            f"{missed} touches met no ground down to {1000.0 * REACH_M:.0f} mm below the nominal surface: fill up the"
            " mud, or correct geometry.axis_height_m"
        )


def find_touched(ticks: NDArray[np.void], index: int, geometry: FlipperGeometry, descent: Descent) -> Surface:
    """Find the surface in the rows of a descent of one flipper."""
    stamps_s = ticks["stamp_s"]
    rows = ticks[(stamps_s > descent.begin_s) & (stamps_s <= descent.end_s)]
    if descent.touched_m is None or not len(rows):
        return NO_SURFACE
    depths_m, forces_n = batches(rows["depth_m"][:, index], rows["force_z_n"][:, index])
    air = depths_m < descent.touched_m - ABOVE_M
    if np.count_nonzero(air) > LATEST:
        forces_n = forces_n - np.polyval(np.polyfit(depths_m[air], forces_n[air], 1), depths_m)
    surface = finish(find_surface(depths_m.tolist(), forces_n.tolist()))
    if not surface.found:
        return surface
    adduction_rad = geometry.adduction_rad(descent.sweep_rad, surface.depth_m)
    corner_m = geometry.plate.below_origin_m(-cos(descent.sweep_rad) * sin(adduction_rad), cos(adduction_rad))
    return surface._replace(depth_m=surface.depth_m + corner_m)


def batches(depths_m: Column, forces_n: Column) -> tuple[Column, Column]:
    """Return the means over equal travel, in order of depth, without the part in which the flipper accelerates."""
    pieces = ((depths_m - depths_m[0] - ACCELERATING_M) // BATCH_M).astype(int)
    moving = pieces >= 0
    samples = np.bincount(pieces[moving])
    sums = (np.bincount(pieces[moving], each[moving])[samples > 0] for each in (depths_m, forces_n))
    depth_sums_m, force_sums_n = sums
    return depth_sums_m / samples[samples > 0], force_sums_n / samples[samples > 0]


def combined(touches: list[Touch], sinking_m: float) -> ProbedSurface:
    """Return the mean height, its error, and how much the touches scatter, which is at least their own error."""
    surfaces = [touch.surface for touch in touches]
    depths_m = [surface.depth_m for surface in surfaces]
    own_m2 = fmean(surface.std_error_m**2 for surface in surfaces)
    scatter_m = sqrt(max(variance(depths_m), own_m2))
    shared_m = hypot(fmean(surface.law_error_m for surface in surfaces), sinking_m)
    return ProbedSurface(touches, fmean(depths_m), hypot(scatter_m / sqrt(len(touches)), shared_m), scatter_m)
