"""Friction of a joint in motion, from the work of the current while the empty arm swings to and fro.

At rest dry friction has any value up to its maximum, and the held joint comes to rest before that: its spring pulls in
steps of one encoder count (0.4 mrad of 10 N·m/rad are 4 mN·m), and a step sets the arm free, which then moves on a
little. A reading at rest shows too little friction, 11 of 13 mN·m in simulation. So friction is measured in motion.
Over a closed loop, weight, magnets and inertia do no net work, and the rest is friction's:

    k_t ∮ I dθ = c ∮ |dθ| + d ∮ ω dθ         dry c, viscous d

Loops at two speeds separate the two: slow ones in short moves, quick ones in a single move each way. A joint that stops
between two short moves does no work meanwhile, so the stops do not count.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import degrees, fsum, hypot, nan, radians, sqrt
from statistics import fmean, variance
from typing import NamedTuple

from estimation.strokes.origin_fit import student_factor
from experiments.actuator.reading import QUIET_S, HeldJoint, HeldSample, MovedError

SWING_RAD = radians(5.0)  # to either side: four and a half periods of the R60's cogging, and the arm stays near level
SLOW_STEP_RAD = radians(0.6)  # of one move, which takes a tenth of a second
SLOW, QUICK = 2, 4  # loops of each kind
SPEED_RATIO = 3.0  # least ratio of quick to slow loops for viscous friction
FEWEST = 3  # loops of a kind for a standard error


class Loop(NamedTuple):
    """One swing there and back."""

    spent_a: float  # mean over the travel
    speed_rad_s: float  # the same mean
    quick: bool
    held_a: float = nan  # mean over the travel, both ways: the weight alone, without friction and cogging


def swing_arm(held: HeldJoint) -> list[Loop]:
    """Make loops of both speeds about the held angle. Raises MovedError, BenchError, WarmError."""
    middle_rad = held.held_rad
    low_rad, high_rad = middle_rad - SWING_RAD, middle_rad + SWING_RAD
    held.stroke(low_rad, SLOW_STEP_RAD)
    loops = []
    for quick in [False] * SLOW + [True] * QUICK:
        step_rad = 2.0 * SWING_RAD if quick else SLOW_STEP_RAD
        loops.append(loop_of(held.stroke(high_rad, step_rad), held.stroke(low_rad, step_rad), quick))
    held.stroke(middle_rad, SLOW_STEP_RAD)
    return loops


def loop_of(up: Sequence[HeldSample], down: Sequence[HeldSample], quick: bool) -> Loop:
    """Evaluate a stroke and the one back, each until it rests. Raises MovedError for a short one."""
    samples, stroke_rad = [*up, *down], _end_rad(up) - _end_rad(down)
    if stroke_rad < SWING_RAD:
        raise MovedError(f"the empty arm swings by {degrees(stroke_rad):.1f} degrees only: is it blocked?")
    spent_rad_a = fsum(
        (a.current_a + b.current_a) / 2.0 * (b.angle_rad - a.angle_rad)
        for a, b in pairwise([*samples, samples[0]])  # closed by a line to its beginning
    )
    brisk_rad2_s = fsum(
        (b.angle_rad - a.angle_rad) ** 2 / (b.now_s - a.now_s) for a, b in pairwise(samples) if b.now_s > a.now_s
    )
    parts = [(abs(b.angle_rad - a.angle_rad), (a.current_a + b.current_a) / 2.0) for a, b in pairwise(samples)]
    held_a = fsum(path_rad * current_a for path_rad, current_a in parts) / fsum(path_rad for path_rad, _ in parts)
    return Loop(spent_rad_a / (2.0 * stroke_rad), brisk_rad2_s / (2.0 * stroke_rad), quick, held_a)


def _end_rad(stroke: Sequence[HeldSample]) -> float:
    """Return the angle at rest."""
    from_s = stroke[-1].now_s - QUIET_S
    return fmean(sample.angle_rad for sample in stroke if sample.now_s >= from_s)


def friction_of(loops: Sequence[Loop]) -> tuple[float, float, float, float]:
    """Fit dry friction in A and viscous friction in A s, each with its standard error; NaN where it was not measured.

    All friction counts as dry where the quick loops are hardly quicker. The errors are those of the loops' scatter,
    with Student's factor.
    """
    slow, quick = ([loop for loop in loops if loop.quick == kind] for kind in (False, True))
    if len(slow) < FEWEST:
        return nan, nan, nan, nan
    slow_a, slow_error_a, slow_rad_s = _mean(slow)
    if len(quick) < FEWEST:
        return slow_a, slow_error_a, nan, nan
    quick_a, quick_error_a, quick_rad_s = _mean(quick)
    if quick_rad_s < SPEED_RATIO * slow_rad_s:
        return slow_a, slow_error_a, nan, nan
    between_rad_s = quick_rad_s - slow_rad_s
    viscous_a_s = (quick_a - slow_a) / between_rad_s
    dry_error_a = hypot(quick_rad_s * slow_error_a, slow_rad_s * quick_error_a) / between_rad_s
    viscous_error_a_s = hypot(slow_error_a, quick_error_a) / between_rad_s
    return slow_a - viscous_a_s * slow_rad_s, dry_error_a, viscous_a_s, viscous_error_a_s


def _mean(loops: Sequence[Loop]) -> tuple[float, float, float]:
    """Return current, its standard error, and speed."""
    currents_a = [loop.spent_a for loop in loops]
    error_a = student_factor(len(loops) - 1) * sqrt(variance(currents_a) / len(loops))
    return fmean(currents_a), error_a, fmean(loop.speed_rad_s for loop in loops)
