"""Checks a gait whole before any joint follows it: its keys, then the strides that they make with this robot.

Each problem is one message with file, phase, key, value and bound. The currents are those that the forecast of depths
expects (control/depth/forecast.py): k_p Φ on the way down, half of k_e Φ, the peak of an extraction, on the way up; and
backward or forward k_s Ψ, or what moves a body against its drag if that is less, also on a fixed base, where a sweep at
its limit lags behind. Where no mud is known, the paper's of 49.5 % water is expected. A phase ends where its force
reaches `until_force_n` or its depth `until_depth_m`, and the stride goes on from there. The acceleration of body and
arms is not in it: it lasts tens of milliseconds.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, cos, degrees, floor, hypot, inf, sin
from typing import NamedTuple

from control.depth.depth_choice import path_depths
from control.gait.gait import smooth_progress
from control.gait.recovery import OUT_M, is_in_mud
from control.gait.stride_table import Begun, PhaseRow, crutching_parameters, stride_table
from control.geometry import FlipperGeometry
from control.mud_estimate import NOTHING_KNOWN, Coefficient, MudEstimate
from control.parameters.gait_path import GaitPath, GaitPhase
from control.plate_integrals import stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import Phase, Rig
from estimation.force_map import smallest_force_n
from firmware_host.configuration.configuration import Configuration

POINTS = 16  # of each row, equally far apart in time: the daemon checks a gait within a few ticks
FINE_POINTS = 64  # of a row that a force or a depth ends
ROUNDING_M = 1e-9  # of a depth on a path
PEAK_FRACTION = 0.5  # of k_e Φ
EXPECTED_N_M3 = {"k_p": 0.82e6, "k_s": 0.46e6, "k_e": 1.45e6}  # 49.5 % water, docs/results/loadcell.json
SHALLOWEST_M = 0.005  # of a walk, as of every depth in the configuration: a smaller one is a slip of the unit


class Pose(NamedTuple):
    """A point of a path, and the speeds there."""

    sweep_rad: float
    depth_m: float
    swept_rad_s: float
    sunk_m_s: float


def depth_problem(configuration: Configuration, depth_m: float) -> str:
    """Return why no stride may be as deep; empty if one may."""
    deepest_m = configuration.adaptation.max_depth_m
    if SHALLOWEST_M <= depth_m <= deepest_m:
        return ""
    return (
        f"depth {100.0 * depth_m:g} cm: must be from {100.0 * SHALLOWEST_M:g} to"
        f" {100.0 * deepest_m:g} cm, which is adaptation.max_depth_m in the configuration"
    )


def gait_problems(
    path: GaitPath, configuration: Configuration, depths_m: Sequence[float], mud: MudEstimate = NOTHING_KNOWN
) -> Iterator[str]:
    """Yield what is wrong with a gait: first with its keys, else with its deepest or its shallowest path.

    Else with the currents in this mud. Without depths the gait adapts to it: an insertion of the crutching gait ends
    early in firm mud, and of another path the currents are those of its first stride.
    """
    problems = list(key_problems(path))
    if not problems:
        first_m = configuration.adaptation.initial_depth_m
        walked_m = depths_m or _adaptive_depths_m(path, configuration)
        for depth_m in sorted({max(walked_m), min(walked_m)}, reverse=True):
            problems = problems or list(_path_problems(path, configuration, depth_m))
        if not problems and (depths_m or crutching_parameters(path) is None):
            problems = list(_current_problems(path, configuration, max(depths_m, default=first_m), mud))
    yield from (f"{path.name or 'gait'}: {problem}" for problem in problems)


def _adaptive_depths_m(path: GaitPath, configuration: Configuration) -> Sequence[float]:
    """Return the least and the greatest depth that the choice of depth may take, of a path also the first one."""
    adaptation, gait, geometry = configuration.adaptation, crutching_parameters(path), configuration.geometry
    if gait is None:
        depths_m = path_depths(adaptation, geometry, path)
        return *depths_m[:1], *depths_m[-1:], adaptation.initial_depth_m
    return adaptation.min_depth_m, min(adaptation.max_depth_m, geometry.deepest_m(gait.sweep_angle_deg))


def key_problems(path: GaitPath) -> Iterator[str]:
    names = [phase.name for phase in path.phase]
    if "swing" not in names or names.index("swing") != len(names) - 1 or len(names) < 2:
        yield f"phase = {', '.join(names) or 'none'}: the last of two or more must be a swing, and no other one"
    for number, phase in enumerate(path.phase):
        ahead = [name for name in names[number + 1 :] if name != "pause"]
        swings = "swing" in [phase.name, *ahead[:1]]
        whole = "of a swing and right before one, which would begin in the mud" if swings else ""
        if path.right_offset_fraction:
            whole = "where right_offset_fraction keeps the flippers apart"
        yield from (f"{_phase_key(path, number)}.{problem}" for problem in _phase_problems(phase, whole))


def _phase_problems(phase: GaitPhase, whole: str) -> Iterator[str]:
    """Yield what is wrong with a phase; `whole` says where it may not end early, if so."""
    for number, point in enumerate(phase.way_points, 1):
        if (point.depth_m is None) is (point.depth_fraction is None):
            yield f"way_points {number}: must have one of depth_m and depth_fraction"
    if (phase.speed_m_s is None) is (phase.duration_s is None):
        yield "duration_s: the phase must end, by either duration_s or speed_m_s"
    if (phase.name == "pause") is not (len(phase.way_points) == 0):
        yield f"way_points: {'must be left out of a pause' if phase.way_points else 'is missing'}"
    if phase.name == "pause" and phase.duration_s is None:
        yield "duration_s is missing: a pause has no path that a speed could end"
    if phase.curve == "half_ellipse" and len(phase.way_points) != 2:
        yield f"way_points: must be 2 for a half ellipse, its peak and its end, not {len(phase.way_points)}"
    for key in ("until_force_n", "until_depth_m"):
        if whole and getattr(phase, key) is not None:
            yield f"{key} = {getattr(phase, key):g}: must be left out {whole}"


def _phase_key(path: GaitPath, number: int) -> str:
    return f"phase {number % len(path.phase) + 1} ({path.phase[number].name})"


def _path_problems(path: GaitPath, configuration: Configuration, depth_m: float) -> Iterator[str]:
    """Yield the first problem of each row."""
    rows = stride_table(path, configuration.geometry, depth_m)
    if not any(row.phase is Phase.SWING for row in rows):
        yield f"{_phase_key(path, -1)}.duration_s is missing: a swing that stays where it is has no path to end it"
    yield from _depth_problems(path, rows)
    for row in rows:
        found = (problem for pose in _poses(row) for problem in _pose_problems(row, pose, configuration))
        if problem := next(found, ""):
            yield f"{_phase_key(path, row.number)}.{problem}"


def _depth_problems(path: GaitPath, rows: Sequence[PhaseRow]) -> Iterator[str]:
    """Yield phases that end as soon as they begin, because they begin at until_depth_m or below and go no deeper."""
    for number, phase in enumerate(path.phase):
        depths_m = [row.at(at)[1] for row in rows if row.number == number for at in (0.0, 0.5, 1.0)]
        if phase.until_depth_m is not None and depths_m and depths_m[0] == max(depths_m) >= phase.until_depth_m:
            least = f"must be more than {depths_m[0]:.4g}, the depth of its beginning, below which it does not go"
            yield f"{_phase_key(path, number)}.until_depth_m = {phase.until_depth_m:g}: {least}"


def _poses(row: PhaseRow, points: int = POINTS) -> Iterator[Pose]:
    for i in range(points + 1):
        fraction, rate = smooth_progress(row.duration_s * i / points, row.duration_s)
        sweep_rad, depth_m, sweep_rate, depth_rate = row.at(fraction)
        yield Pose(sweep_rad, depth_m, sweep_rate * rate, depth_rate * rate)


def _pose_problems(row: PhaseRow, pose: Pose, configuration: Configuration) -> Iterator[str]:
    geometry, limits = configuration.geometry, configuration.limits
    sweep_rad, depth_m, swept_rad_s, sunk_m_s = pose
    sweep_deg = degrees(sweep_rad)
    where = _where(pose)
    if not limits.sweep_min_deg <= sweep_deg <= limits.sweep_max_deg:
        low_deg, high_deg = limits.sweep_min_deg, limits.sweep_max_deg
        yield f"{where}: must be from {low_deg:g} to {high_deg:g} degrees, limits.sweep_min_deg and sweep_max_deg"
    if not geometry.is_reachable(sweep_rad, depth_m):
        deepest_m = geometry.deepest_m(sweep_deg)
        highest_m = -deepest_m - 2.0 * geometry.axis_height_m  # as far above the axis as the deepest is below it
        deepest_cm = floor(1e4 * deepest_m) / 100.0
        yield f"{where}: out of reach, must be from {ceil(1e4 * highest_m) / 100.0:g} to {deepest_cm:g} cm"
        return
    if depth_m > configuration.adaptation.max_depth_m + ROUNDING_M:  # a way-point in metres, or half an ellipse
        most_cm = 100.0 * configuration.adaptation.max_depth_m
        yield f"{where}: must be at most {most_cm:g} cm deep, adaptation.max_depth_m"
    lift_rad = geometry.adduction_rad(sweep_rad, depth_m)
    lift_deg, low_deg, high_deg = degrees(lift_rad), limits.adduction_min_deg, limits.adduction_max_deg
    if not low_deg <= lift_deg <= high_deg:
        bounds = f"from {low_deg:g} to {high_deg:g}, limits.adduction_min_deg and adduction_max_deg"
        yield f"{where}: adduction at {lift_deg:.1f} degrees must be {bounds}"
    inside_m = -_innermost_m(geometry, sweep_rad, lift_rad)
    if inside_m > 0.0:
        yield f"{where}: the plate crosses the body by {100.0 * inside_m:.2f} cm, must be at most 0"
    if row.phase is Phase.SWING and is_in_mud(geometry, sweep_rad, lift_rad):
        yield f"{where}: a swing must stay out of the mud, its plate at most {100.0 * OUT_M:g} cm deep"
    lift_rad_s = geometry.adduction_velocity_rad_s(sweep_rad, lift_rad, swept_rad_s, sunk_m_s)
    speed_rad_s = max(abs(swept_rad_s), abs(lift_rad_s))
    if speed_rad_s > limits.velocity_rad_s:
        fastest = f"limits.velocity_rad_s = {limits.velocity_rad_s:g}"
        yield f"{where}: a joint turns at {speed_rad_s:.1f} rad/s, must be at most {fastest}"


def _where(pose: Pose) -> str:
    return f"way_points: depth {100.0 * pose.depth_m:.2f} cm at a sweep of {degrees(pose.sweep_rad):.1f} degrees"


def _innermost_m(geometry: FlipperGeometry, sweep_rad: float, lift_rad: float) -> float:
    """Return how far outward of the adduction axis the innermost corner of the plate is."""
    return min(
        (geometry.flipper_length_m + outward_m) * cos(sweep_rad) * cos(lift_rad)
        + (geometry.drop_m - upward_m) * sin(lift_rad)
        for outward_m, upward_m in geometry.plate.corners
    )


def _current_problems(path: GaitPath, configuration: Configuration, depth_m: float, mud: MudEstimate) -> Iterator[str]:
    """Yield the phases in which mud that yields takes more current than the drives may have, with its first pose."""
    constants_nm_a = configuration.torque_constants_nm_a[:2]
    largest_nm = configuration.limits.torque_nm  # which every drive can exert: drive_consistency.py
    if path.right_offset_fraction:  # the flippers push in turn, each as a robot's only one
        configuration = replace(configuration, rig=Rig(configuration.rig.flippers[:1]))
    found: dict[int, str] = {}
    for number, pose, torques_nm in _loaded_poses(path, configuration, depth_m, mud):
        for axis, torque_nm, constant_nm_a in zip(("sweep", "adduction"), torques_nm, constants_nm_a, strict=True):
            if torque_nm > largest_nm:
                name = "k_s" if axis == "sweep" else "k_p" if pose.sunk_m_s > 0.0 else "k_e"
                expected = "the mud of the walk before" if getattr(mud, name) else "mud of 49.5 % water"
                taken = f"{expected} takes {torque_nm / constant_nm_a:.1f} A of the {axis} motor"
                most = f"{largest_nm / constant_nm_a:.1f} A ({largest_nm:.2f} N·m); a smaller depth takes less"
                found.setdefault(number, f"{_phase_key(path, number)}.{_where(pose)}: {taken}, must be at most {most}")
    yield from found.values()


def _loaded_poses(
    path: GaitPath, configuration: Configuration, depth_m: float, mud: MudEstimate
) -> Iterator[tuple[int, Pose, tuple[float, float]]]:
    """Yield phase, pose and torques along a stride in which phases end at their `until_force_n` or `until_depth_m`."""
    geometry, rows = configuration.geometry, stride_table(path, configuration.geometry, depth_m)
    for number, phase in enumerate(path.phase):
        points = POINTS if phase.until_force_n is phase.until_depth_m is None else FINE_POINTS
        for pose in [pose for row in rows if row.number == number for pose in _poses(row, points)]:
            reached_m = min(pose.depth_m, geometry.deepest_m(degrees(pose.sweep_rad)))  # as the gait does
            angles_rad = pose.sweep_rad, geometry.adduction_rad(pose.sweep_rad, reached_m)
            torques_nm = expected_torques_nm(pose, angles_rad[1], configuration, mud)
            if _ends(phase, hypot(*smallest_force_n(geometry, *angles_rad, *torques_nm)), reached_m):
                depth_m = pose.depth_m if phase.name == "insertion" else depth_m
                rows = stride_table(path, geometry, depth_m, Begun(number + 1, pose.sweep_rad, pose.depth_m))
                break
            yield number, pose, torques_nm


def _ends(phase: GaitPhase, force_n: float, depth_m: float) -> bool:
    until_n, until_m = (inf if each is None else each for each in (phase.until_force_n, phase.until_depth_m))
    return force_n >= until_n or depth_m >= until_m


def expected_torques_nm(
    pose: Pose, lift_rad: float, configuration: Configuration, mud: MudEstimate = NOTHING_KNOWN
) -> tuple[float, float]:
    """Return the torques on sweep and adduction, each by the part of its direction in the plate's motion."""
    geometry, adaptation = configuration.geometry, configuration.adaptation
    sweep_rad, depth_m, swept_rad_s, sunk_m_s = pose
    plate, along_m_s = submerged_plate(geometry, sweep_rad, lift_rad), geometry.flipper_length_m * abs(swept_rad_s)
    speed_m_s = hypot(along_m_s, sunk_m_s)
    if plate.area_m2 <= 0.0 or speed_m_s == 0.0:
        return 0.0, 0.0
    k = {name: _expected_n_m3(name, getattr(mud, name), depth_m) for name in EXPECTED_N_M3}
    drag_n = adaptation.body_drag_n + adaptation.body_damping_n_s_m * along_m_s
    body_nm = drag_n / len(configuration.rig.flippers) * geometry.flipper_length_m
    sweep_nm = min(k["k_s"] * stance_moment_m4(geometry, plate) * along_m_s / speed_m_s, body_nm)
    vertical = k["k_p"] if sunk_m_s > 0.0 else PEAK_FRACTION * k["k_e"]
    return sweep_nm, vertical * stroke_moment_m4(geometry, plate, sweep_rad) * abs(sunk_m_s) / speed_m_s


def _expected_n_m3(name: str, known: Coefficient | None, depth_m: float) -> float:
    return known.at(depth_m)[0] if known and depth_m > 0.0 else EXPECTED_N_M3[name]
