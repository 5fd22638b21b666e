"""From motor currents to what the mud does to a flipper's two joints.

Of a direct-drive joint the motor's torque k_t I, gravity, friction and the mud's load together make the arm's inertia
J turn faster: the load is J ω' - k_t I - τ_gravity + τ_friction. (The paper leaves out all but -k_t I; with inertia,
gravity and friction configured as zero this is the paper's.) Messages come slower than ticks: a sample that repeats
the one before says nothing new.

In a quick stroke inertia is larger than the mud's load, so both must be of the same time. Two velocities tell the mean
acceleration between the moments at which they were measured; the angle is taken half-way, and the current as its mean
over that time. A drive holds each command until the next, so its current is a stair with a step at each command; where
the last two samples answer the last two commands, that mean is known. Where messages come more slowly than commands,
or nothing is known of these, it is taken along the line through both samples. (Across a step the line errs by up to
half of it: in a walk's quick extraction from soft mud, by a seventh of k_e.) Drives send angle and current separately,
and slower or faster than the loop ticks, so each has its age.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, isfinite, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.joint_friction import NO_FRICTION, JointFriction
from control.joint_pd import GRAVITY_M_S2, ArmMass
from control.records import UNKNOWN, DriveState

SATURATION = 0.98  # of the limit: clipped currents stay a little under it
LONGEST_GAP_S = 0.03  # between two samples that still tell of one motion
SHORTEST_GAP_S = 0.0005  # two frames that an adapter delivered together do not tell when they were made
CommandTimes = tuple[float, float]  # when the drives were given the last two commands that a sample may answer
NO_COMMANDS: CommandTimes = (UNKNOWN, UNKNOWN)


class FlipperDrive(NamedTuple):
    """What turns the currents of one flipper's joints into torques."""

    mass: ArmMass
    sweep_constant_nm_a: float
    adduction_constant_nm_a: float
    sweep_friction: JointFriction = NO_FRICTION
    adduction_friction: JointFriction = NO_FRICTION
    current_limit_a: float = float("inf")  # at which the drives clip


class JointLoad(NamedTuple):
    """Of one moment: the pose, and what the mud does to the joints there."""

    sweep_rad: float
    adduction_rad: float
    depth_m: float  # of the lower edge below the nominal surface
    rise_sweep_m: float  # of the lower edge per radian of sweep: lever of an upward force
    rise_adduction_m: float
    sweep_nm: float
    adduction_nm: float
    saturated: bool  # a motor gives all it can: the mud may hold on to more


JointMotion = tuple[float, float, float, float]  # of one joint at one moment: rad, rad/s, rad/s², A


def motion_at(before: DriveState, now: DriveState, commands_s: CommandTimes = NO_COMMANDS) -> JointMotion:
    """At the newest sample, with the acceleration since the one before; zero where velocities are not known."""
    dt_s = now.angle_stamp_s - before.angle_stamp_s
    change_rad_s = now.velocity_rad_s - before.velocity_rad_s
    acceleration_rad_s2 = change_rad_s / dt_s if dt_s > 0.0 and isfinite(change_rad_s) else 0.0
    return now.angle_rad, now.velocity_rad_s, acceleration_rad_s2, now.current_a


def motion_between(before: DriveState, now: DriveState, commands_s: CommandTimes = NO_COMMANDS) -> JointMotion:
    """Half-way between two samples; at the newest, without acceleration, where they do not tell of one motion."""
    angle_before_rad, before_rad_s, angle_before_s, current_before_a, current_before_s = before[:5]
    angle_rad, now_rad_s, angle_s, current_a, current_s = now[:5]
    earlier_s, later_s = commands_s
    dt_s, change_rad_s = angle_s - angle_before_s, now_rad_s - before_rad_s
    if not (SHORTEST_GAP_S < dt_s < LONGEST_GAP_S and isfinite(change_rad_s)):
        return angle_rad, now_rad_s, 0.0, current_a
    if earlier_s < current_before_s <= later_s < current_s:
        fraction = (later_s - angle_before_s) / dt_s
        current_a += (current_before_a - current_a) * (
            fraction if 0.0 < fraction < 1.0 else 1.0 if fraction > 0.0 else 0.0
        )
    elif current_s > current_before_s:
        fraction = (current_s - angle_s + dt_s / 2.0) / (current_s - current_before_s)
        current_a -= (current_a - current_before_a) * (
            fraction if -1.0 < fraction < 2.0 else 2.0 if fraction > 0.0 else -1.0
        )
    return (angle_rad + angle_before_rad) / 2.0, before_rad_s + change_rad_s / 2.0, change_rad_s / dt_s, current_a


class JointLoads:
    """Owns the last distinct samples of one flipper."""

    def __init__(
        self,
        geometry: FlipperGeometry,
        drive: FlipperDrive,
        motion: Callable[[DriveState, DriveState, CommandTimes], JointMotion] = motion_between,
    ) -> None:
        self.drive = drive
        self._motion = motion
        self._length_m, self._drop_m = geometry.flipper_length_m, geometry.drop_m
        self._axis_height_m = geometry.axis_height_m
        self._moment_nm = drive.mass.arm_mass_kg * GRAVITY_M_S2 * drive.mass.center_of_mass_m
        self._clip_a = SATURATION * drive.current_limit_a
        self._is_smooth = drive.sweep_friction == NO_FRICTION == drive.adduction_friction
        self.reset()

    def reset(self) -> None:
        self._sweep = self._adduction = (DriveState(), DriveState())

    @property
    def angles_rad(self) -> tuple[float, float]:
        """The newest of sweep and adduction; a load belongs to a moment a little earlier."""
        return self._sweep[1].angle_rad, self._adduction[1].angle_rad

    def update(
        self, sweep: DriveState, adduction: DriveState, commands_s: CommandTimes = NO_COMMANDS
    ) -> JointLoad | None:
        """None for samples that repeat the ones before. Velocities may be unknown (NaN)."""
        if _repeats(self._sweep[1], sweep) and _repeats(self._adduction[1], adduction):
            return None
        self._sweep, self._adduction = _paired(self._sweep, sweep), _paired(self._adduction, adduction)
        drive, mass = self.drive, self.drive.mass
        sweep_rad, sweep_rad_s, sweep_rad_s2, sweep_a = self._motion(*self._sweep, commands_s)
        adduction_rad, adduction_rad_s, adduction_rad_s2, adduction_a = self._motion(*self._adduction, commands_s)
        sweep_nm = mass.sweep_inertia_kg_m2 * sweep_rad_s2 - drive.sweep_constant_nm_a * sweep_a
        adduction_nm = mass.adduction_inertia_kg_m2 * adduction_rad_s2 - drive.adduction_constant_nm_a * adduction_a
        if not self._is_smooth:
            sweep_nm += _friction_nm(drive.sweep_friction, sweep_rad, sweep_rad_s)
            adduction_nm += _friction_nm(drive.adduction_friction, adduction_rad, adduction_rad_s)
        saturated = abs(sweep.current_a) >= self._clip_a or abs(adduction.current_a) >= self._clip_a
        return self._without_gravity(sweep_rad, adduction_rad, sweep_nm, adduction_nm, saturated)

    def _without_gravity(
        self, sweep_rad: float, adduction_rad: float, sweep_nm: float, adduction_nm: float, saturated: bool
    ) -> JointLoad:
        """The arm's weight as in ArmMass.gravity_torques_nm, with the sines that depth and levers need too."""
        sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
        length_m, drop_m, moment_nm = self._length_m, self._drop_m, self._moment_nm
        return JointLoad(
            sweep_rad,
            adduction_rad,
            drop_m * cb - length_m * ca * sb - self._axis_height_m,
            -length_m * sa * sb,
            drop_m * sb + length_m * ca * cb,
            sweep_nm - moment_nm * sa * sb,
            adduction_nm + moment_nm * ca * cb,
            saturated,
        )


def _repeats(before: DriveState, now: DriveState) -> bool:
    return now.current_a == before.current_a and now.angle_rad == before.angle_rad


def _paired(pair: tuple[DriveState, DriveState], now: DriveState) -> tuple[DriveState, DriveState]:
    """With the last sample of another angle: where the current alone is new, the acceleration is still the last one."""
    before, last = pair
    return (before if now.angle_stamp_s == last.angle_stamp_s else last), now


def _friction_nm(friction: JointFriction, angle_rad: float, velocity_rad_s: float) -> float:
    return friction.torque_nm(angle_rad, velocity_rad_s if isfinite(velocity_rad_s) else 0.0)
