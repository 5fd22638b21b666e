"""A stride as a table of rows, each a straight line or half an ellipse of the plate's lower edge in sweep and depth.

The crutching gait (paper, section II-A) is a table like any other. The edge goes down at the front of the sweep, holds
its depth through the stance while the flipper sweeps back, comes up at the back and swings forward above the mud. A
row's duration is its path length over its speed, as in the authors' controller, so stride times equal theirs.

A gait whose phases are pure, straight down, then at one depth, then straight up, names them for the estimator. Rows of
any other gait are strokes, whose parts it finds by their motion (estimation/path_motion.py).
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from math import cos, fsum, hypot, pi, radians, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint
from control.records import Phase

CHORDS = 32  # of a half ellipse, whose length they give to 0.1 %
CRUTCHING = ["insertion", "stance", "extraction", "swing"]


class Begun(NamedTuple):
    """Where a phase begins, since the one before it ended early."""

    number: int
    sweep_rad: float
    depth_m: float


class PhaseRow(NamedTuple):
    phase: Phase
    duration_s: float
    sweep_start_rad: float
    sweep_end_rad: float
    depth_start_m: float
    depth_end_m: float
    number: int = 0  # of the phase in its gait
    sweep_bulge_rad: float = 0.0  # of a half ellipse: its peak from the middle between start and end
    depth_bulge_m: float = 0.0

    def at(self, fraction: float) -> tuple[float, float, float, float]:
        """Return sweep and depth at a fraction of the path, and their derivatives by the fraction.

        Half an ellipse is M - (B - A)/2 cos πf + (P - M) sin πf from A through its peak P to B, with M between.
        """
        _, _, sweep, sweep_end, depth, depth_end, _, sweep_bulge, depth_bulge = self
        sweep_span, depth_span = sweep_end - sweep, depth_end - depth
        if not (sweep_bulge or depth_bulge):
            return sweep + sweep_span * fraction, depth + depth_span * fraction, sweep_span, depth_span
        c, s = cos(pi * fraction), sin(pi * fraction)
        return (
            sweep + sweep_span / 2.0 * (1.0 - c) + sweep_bulge * s,
            depth + depth_span / 2.0 * (1.0 - c) + depth_bulge * s,
            pi * (sweep_span / 2.0 * s + sweep_bulge * c),
            pi * (depth_span / 2.0 * s + depth_bulge * c),
        )


@lru_cache(maxsize=64)
def crutching(gait: GaitParameters) -> GaitPath:
    """Return the crutching gait with these speeds and durations."""
    front = WayPoint(gait.sweep_angle_deg, depth_fraction=1.0)
    rear = WayPoint(-gait.sweep_angle_deg, depth_fraction=1.0)
    over_front, over_rear = replace(front, depth_fraction=-1.0), replace(rear, depth_fraction=-1.0)
    pause = (GaitPhase("pause", duration_s=gait.pause_s),) * (gait.pause_s > 0.0)
    swing_m_s = None if gait.swing_duration_s else gait.swing_speed_m_s
    return GaitPath(
        (
            GaitPhase("insertion", (front,), speed_m_s=gait.insertion_speed_m_s),
            *pause,
            GaitPhase("stance", (rear,), speed_m_s=gait.stance_speed_m_s),
            *pause,
            GaitPhase("extraction", (over_rear,), speed_m_s=gait.extraction_speed_m_s),
            *pause,
            GaitPhase("swing", (over_front,), speed_m_s=swing_m_s, duration_s=gait.swing_duration_s or None),
        )
    )


def crutching_parameters(path: GaitPath) -> GaitParameters | None:
    """Return the parameters with which the crutching gait is this path; None for another path."""
    phases: dict[str, GaitPhase] = {phase.name: phase for phase in path.phase}
    ordered = [phase.name for phase in path.phase if phase.name != "pause"] == CRUTCHING
    if not ordered or path.right_offset_fraction or not phases["swing"].way_points:
        return None
    swing, speeds = phases["swing"], {f"{name}_speed_m_s": phases[name].speed_m_s for name in CRUTCHING}
    parameters = GaitParameters(
        sweep_angle_deg=abs(swing.way_points[-1].sweep_deg),
        swing_duration_s=swing.duration_s or 0.0,
        pause_s=phases["pause"].duration_s or 0.0 if "pause" in phases else 0.0,
        **{key: speed_m_s for key, speed_m_s in speeds.items() if speed_m_s is not None},
    )
    return parameters if crutching(parameters).phase == path.phase else None


def stride_table(
    gait: GaitParameters | GaitPath, geometry: FlipperGeometry, depth_m: float, begun: Begun | None = None
) -> tuple[PhaseRow, ...]:
    """Return the rows of one stride at `depth_m` below the nominal surface, in time order."""
    path = crutching(gait) if isinstance(gait, GaitParameters) else gait
    ordered = [phase.name for phase in path.phase if phase.name != "pause"] == CRUTCHING
    here = position(path.phase[-1].way_points[-1], geometry, depth_m)
    rows = list[PhaseRow]()
    for number, phase in enumerate(path.phase):
        if begun and number == begun.number:
            here = begun.sweep_rad, begun.depth_m
        legs = list(_legs(number, phase, here, geometry, depth_m, ordered))
        here = legs[-1].sweep_end_rad, legs[-1].depth_end_m
        rows += _timed(legs, phase, geometry)
    return _named(rows)


def _named(rows: list[PhaseRow]) -> tuple[PhaseRow, ...]:
    """Return the rows by their names for the estimator: one that is not pure makes strokes of all."""
    if any(row.phase is Phase.STROKE for row in rows):
        rows = [row if row.phase in (Phase.SWING, Phase.PAUSE) else row._replace(phase=Phase.STROKE) for row in rows]
    return tuple(rows)


def position(point: WayPoint, geometry: FlipperGeometry, depth_m: float) -> tuple[float, float]:
    """Return sweep and depth of a way-point."""
    fraction = point.depth_fraction
    if fraction is None:
        return radians(point.sweep_deg), point.depth_m or 0.0
    return radians(point.sweep_deg), fraction * (depth_m if fraction > 0.0 else geometry.clearance_m)


def _legs(
    number: int,
    phase: GaitPhase,
    here: tuple[float, float],
    geometry: FlipperGeometry,
    depth_m: float,
    ordered: bool,
) -> Iterator[PhaseRow]:
    """Yield the parts of a phase's path, with no duration yet; a phase without way-points has one that stays."""
    points = [position(point, geometry, depth_m) for point in phase.way_points] or [here]
    (sweep, depth), peak = here, points.pop(0) if phase.curve == "half_ellipse" else None
    for to_sweep, to_depth in points:
        bulge = (peak[0] - (sweep + to_sweep) / 2.0, peak[1] - (depth + to_depth) / 2.0) if peak else (0.0, 0.0)
        reported = _reported(phase.name, to_sweep - sweep, to_depth - depth, ordered and bulge == (0.0, 0.0))
        yield PhaseRow(reported, 0.0, sweep, to_sweep, depth, to_depth, number, *bulge)
        sweep, depth = to_sweep, to_depth


def _timed(legs: list[PhaseRow], phase: GaitPhase, geometry: FlipperGeometry) -> list[PhaseRow]:
    """Return the legs with their durations, without those that take no time."""
    lengths_m = [length_m(leg, geometry) for leg in legs]
    if phase.speed_m_s:
        durations_s = [each_m / phase.speed_m_s for each_m in lengths_m]
    else:
        total_m, all_s = fsum(lengths_m), phase.duration_s or 0.0
        durations_s = [all_s * (each_m / total_m if total_m else 1.0 / len(legs)) for each_m in lengths_m]
    return [
        leg._replace(duration_s=duration_s)
        for leg, duration_s in zip(legs, durations_s, strict=True)
        if duration_s > 0.0
    ]


def length_m(row: PhaseRow, geometry: FlipperGeometry) -> float:
    """Return the length of the lower edge's path, with the sweep along its arc."""
    arm_m = geometry.flipper_length_m
    if not (row.sweep_bulge_rad or row.depth_bulge_m):
        return hypot(arm_m * (row.sweep_end_rad - row.sweep_start_rad), row.depth_end_m - row.depth_start_m)
    points = [row.at(i / CHORDS)[:2] for i in range(CHORDS + 1)]
    return fsum(hypot(arm_m * (b[0] - a[0]), b[1] - a[1]) for a, b in zip(points, points[1:], strict=False))


def _reported(name: str, swept_rad: float, sunk_m: float, straight: bool) -> Phase:
    """Return the phase that a row is for the estimator; only a `straight` one of a crutching gait can be pure."""
    pure = name in ("swing", "pause") or (
        straight
        and (
            (name == "insertion" and swept_rad == 0.0 and sunk_m > 0.0)
            or (name == "stance" and swept_rad != 0.0 and sunk_m == 0.0)
            or (name == "extraction" and swept_rad == 0.0 and sunk_m < 0.0)
        )
    )
    return Phase[name.upper()] if pure else Phase.STROKE


def swing_duration_s(gait: GaitParameters | GaitPath, geometry: FlipperGeometry) -> float:
    return fsum(row.duration_s for row in stride_table(gait, geometry, 0.0) if row.phase is Phase.SWING)


def full_step_m(gait: GaitParameters, geometry: FlipperGeometry) -> float:
    """Return the body's step in one stride of the crutching gait if the plates stand still in the mud."""
    return 2.0 * geometry.flipper_length_m * sin(radians(gait.sweep_angle_deg))


def stride_duration_s(gait: GaitParameters | GaitPath, geometry: FlipperGeometry, depth_m: float) -> float:
    return fsum(row.duration_s for row in stride_table(gait, geometry, depth_m))
