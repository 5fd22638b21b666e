"""The body's step in one stride: its equation of motion through the stance until it stands again.

The arms sweep y(t) backward while the body, which they push, goes forward by x. Mud and servo give way like a spring
of the stiffness k until the mud yields at the thrust F, from where on the plates shear through it; then the body
continues to slide against the drag f_r + b v of its rail or belly:

    m x'' = f - (f_r + b x')     f = min(k (y - x - slip), F_m), slip so that |f| ≤ F     y(t) = 2 l sin α · progress(t)

Motors that reach their limit F_m first do not slip: the joints lag behind their targets and make up for it later, also
in the extraction, while the mud holds the plates. So in firm mud a deeper stride is longer, although the motors push
no harder. Mud holds a plate at rest with less than it resists a moving one with: in the authors' logs a plate that
stops keeps 85 to 90 % of its load. So the plates creep by all of the lag where F is F_m, by none of it where CREEP F
is, and by a part of it between. In the extraction F falls with the depth at which the plates still are; the energy left
in the spring throws the body ahead until they are out. Afterwards it coasts (m/b) (v - (f_r/b) ln(1 + b v/f_r)).

The authors' optimiser has S = 2 l min(α, √(1 - ((f_r + f_a)/2 f_s)²)) instead, with one inertial force for the whole
stance. That balance of forces at one angle has no step at all where thrust is less than drag and inertia together,
though a body that speeds up slowly still gets somewhere, and no spring, which in firm mud throws the body ahead. In
the authors' logs the sweep's force reaches its plateau with 300 to 700 N/m, the servo's give included.

A path of a gait file goes through all depths, and F with them.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, fsum, log1p, radians, sin
from typing import NamedTuple

from control.gait.gait import smooth_progress
from control.gait.stride_table import PhaseRow
from control.geometry import FlipperGeometry
from control.limits import clip
from control.parameters.gait_parameters import GaitParameters
from control.records import Phase

LONGEST_S = 1.0  # of a stance or an extraction: in a slower one inertia is negligible
STEP_S = 0.01  # 1 kg on 500 N/m swings in 0.28 s
THRUST_POWER = 1.5  # of depth: k_s times the depth squared, with k_s falling as its root
SINKING = 0.6  # of the thrust of plates that push on their way down: in firm mud they are less deep than commanded
CREEP = 0.87  # of the yield force: mud withstands so much for long
NEGLIGIBLE = 1e-6


class BodyDrag(NamedTuple):
    """The body's dry friction, viscous damping and mass."""

    dry_n: float
    damping_n_s_m: float
    mass_kg: float


class Traction(NamedTuple):
    """The thrust and stiffness of all flippers together."""

    yield_n: float  # at which the mud yields
    motor_n: float  # that the motors can give
    stiffness_n_m: float  # until either


Motion = tuple[
    tuple[float, float], ...
]  # for each time step: the plates' swept distance, and their depth as a fraction of the stance's


@lru_cache(maxsize=256)
def motion_of(gait: GaitParameters, geometry: FlipperGeometry, depth_m: float) -> Motion:
    """Return the motion of the plates from the start of the stance until they are out."""
    front_rad = radians(gait.sweep_angle_deg)
    stance_s = min(2.0 * front_rad * geometry.flipper_length_m / gait.stance_speed_m_s, LONGEST_S)
    raised_m = geometry.clearance_m + depth_m
    extraction_s = min(raised_m / gait.extraction_speed_m_s, LONGEST_S)
    motion, time_s = list[tuple[float, float]](), 0.0
    while time_s < stance_s + extraction_s:
        time_s += STEP_S
        swept_m = 2.0 * geometry.flipper_length_m * sin(front_rad) * smooth_progress(time_s, stance_s)[0]
        submerged_m = depth_m - raised_m * smooth_progress(time_s - stance_s, extraction_s)[0]
        motion.append((swept_m, max(0.0, submerged_m / depth_m)))
    return tuple(motion)


def motion_of_path(stride: Sequence[PhaseRow], geometry: FlipperGeometry, depth_m: float) -> Motion:
    """Return the motion of the plates from the end of a swing to the next one, counted in the direction of the push."""
    rows = [row for row in stride if row.phase is not Phase.SWING]
    if not rows:
        return ()  # the path only swings
    hastened = min(1.0, 2.0 * LONGEST_S / fsum(row.duration_s for row in rows))
    before_rad, before_m = rows[0].sweep_start_rad, rows[0].depth_start_m
    motion, pushed_m = list[tuple[float, float]](), 0.0
    for row in rows:
        steps = ceil(hastened * row.duration_s / STEP_S)
        for step in range(1, steps + 1):
            sweep_rad, submerged_m, *_ = row.at(smooth_progress(row.duration_s * step / steps, row.duration_s)[0])
            swept_m = geometry.flipper_length_m * (sin(rows[0].sweep_start_rad) - sin(sweep_rad))
            fraction = max(0.0, submerged_m / depth_m) ** THRUST_POWER
            if submerged_m > before_m and sweep_rad != before_rad:
                fraction *= SINKING
            pushed_m += fraction * (sin(before_rad) - sin(sweep_rad))
            motion.append((swept_m, fraction))
            before_rad, before_m = sweep_rad, submerged_m
    return tuple(motion) if pushed_m >= 0.0 else tuple((-swept_m, fraction) for swept_m, fraction in motion)


def carried_m(motion: Motion, drag: BodyDrag, traction: Traction) -> float:
    """Integrate the body's motion over a stride; dry friction keeps the body from sliding back."""
    dry_n, damping_n_s_m, mass_kg = drag
    stiffness_n_m, damped = traction.stiffness_n_m, 1.0 + STEP_S * damping_n_s_m / mass_kg
    yield_n, motor_n = traction.yield_n, traction.motor_n
    if min(yield_n, motor_n) <= dry_n:
        return 0.0
    creeping = clip((motor_n / yield_n - CREEP) / (1.0 - CREEP), 0.0, 1.0)
    body_m = body_m_s = slip_m = lag_m = 0.0
    for swept_m, fraction in motion:
        held_n = fraction * yield_n
        stretch_m = swept_m - body_m - slip_m
        excess_m = stretch_m - motor_n / stiffness_n_m  # lag of the joints, where the motors are at F_m
        if excess_m > lag_m:
            crept_m = creeping * (excess_m - lag_m)
            slip_m, excess_m = slip_m + crept_m, excess_m - crept_m
        lag_m = excess_m if excess_m > 0.0 else 0.0
        force_n = motor_n if excess_m > 0.0 else stiffness_n_m * stretch_m
        if abs(force_n) > held_n:
            force_n = held_n if force_n > 0.0 else -held_n
            slip_m = swept_m - body_m - force_n / stiffness_n_m
        body_m_s = (body_m_s + STEP_S * (force_n - dry_n) / mass_kg) / damped
        body_m_s = body_m_s if body_m_s > 0.0 else 0.0
        body_m += STEP_S * body_m_s
    return body_m + coast_m(drag, body_m_s)


def coast_m(drag: BodyDrag, speed_m_s: float) -> float:
    """Return the coasting distance; with negligible damping the logarithm would lose its digits."""
    viscous_n = drag.damping_n_s_m * speed_m_s
    if viscous_n < NEGLIGIBLE * drag.dry_n:
        return drag.mass_kg * speed_m_s * speed_m_s / (2.0 * drag.dry_n)
    lag_s = drag.mass_kg / drag.damping_n_s_m
    if drag.dry_n <= 0.0:
        return lag_s * speed_m_s
    return lag_s * (speed_m_s - drag.dry_n / drag.damping_n_s_m * log1p(viscous_n / drag.dry_n))
