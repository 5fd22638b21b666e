"""The mud's load on a flipper's two joints, from motor currents.

In a direct-drive joint the motor torque k_t I, gravity, friction and the mud's load together accelerate the arm's
inertia J: the load is J ω' - k_t I - τ_gravity + τ_friction. (The paper neglects all terms but -k_t I; with inertia,
gravity and friction configured as zero the load is the paper's.) Messages arrive more slowly than ticks: a sample that
repeats the one before adds nothing.

In a quick stroke the inertial torque exceeds the mud's load, so all terms must belong to the same time. Two velocities
give the mean acceleration between their measurements; the angle is taken half-way, and the current as its mean over
that interval. A drive holds each command until the next, so its current is a staircase with a step at each command; if
the last two samples answer two successive commands, that mean is known: the last two, or, of drives that answer before
they execute a command, those before. If messages come more slowly than commands, or
the times of the commands are unknown, the current is taken along the line through both samples. (Across a step the line
errs by up to half of it: in a walk's quick extraction from soft mud, by a seventh of k_e.) Drives send angle and
current separately, and faster or slower than the loop, so each has its own stamp.
"""

from collections.abc import Callable
from math import cos, isfinite, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.joint_friction import NO_FRICTION, JointFriction
from control.parameters.arm_mass import GRAVITY_M_S2, ArmMass
from control.records import UNKNOWN, DriveState

SATURATION = 0.98  # of the current limit: clipped currents stay slightly below it
CLINGING_M = 0.015  # above the lower edge: the middle of the part that a stroke of 3 cm wets
LONGEST_GAP_S = 0.03  # between two samples of one motion
SHORTEST_GAP_S = 0.0005  # two frames delivered together by an adapter have no usable stamps
CommandTimes = tuple[float, float]  # when the drives were given the last two commands that a sample may answer
NO_COMMANDS: CommandTimes = (UNKNOWN, UNKNOWN)


class FlipperDrive(NamedTuple):
    """The properties of one flipper's drives that turn currents into loads."""

    mass: ArmMass
    sweep_constant_nm_a: float
    adduction_constant_nm_a: float
    sweep_friction: JointFriction = NO_FRICTION
    adduction_friction: JointFriction = NO_FRICTION
    current_limit_a: float = float("inf")  # at which the sweep's drive clips


class JointLoad(NamedTuple):
    """The pose of one flipper and the mud's load on its joints."""

    sweep_rad: float
    adduction_rad: float
    depth_m: float  # of the lower edge below the nominal surface
    rise_sweep_m: float  # of the lower edge per radian of sweep: lever of an upward force
    rise_clinging_m: float  # of the clinging mud's centre per radian of adduction
    sweep_nm: float
    adduction_nm: float
    saturated: bool  # the sweep motor is at its limit: the mud may withstand more


JointMotion = tuple[float, float, float, float]  # of one joint at one moment: rad, rad/s, rad/s², A


def motion_at(before: DriveState, now: DriveState, commands_s: CommandTimes = NO_COMMANDS) -> JointMotion:
    """Return the motion at the newest sample, with the acceleration since the one before; zero without velocities."""
    dt_s = now.angle_stamp_s - before.angle_stamp_s
    change_rad_s = now.velocity_rad_s - before.velocity_rad_s
    acceleration_rad_s2 = change_rad_s / dt_s if dt_s > 0.0 and isfinite(change_rad_s) else 0.0
    return now.angle_rad, now.velocity_rad_s, acceleration_rad_s2, now.current_a


def motion_between(before: DriveState, now: DriveState, commands_s: CommandTimes = NO_COMMANDS) -> JointMotion:
    """Return the motion half-way between two samples; at the newest, without acceleration, if their gap is unusable."""
    angle_before_rad, before_rad_s, angle_before_s, current_before_a, current_before_s = before[:5]
    angle_rad, now_rad_s, angle_s, current_a, current_s = now[:5]
    earlier_s, later_s = commands_s
    dt_s, change_rad_s = angle_s - angle_before_s, now_rad_s - before_rad_s
    if not (SHORTEST_GAP_S < dt_s < LONGEST_GAP_S and isfinite(change_rad_s)):
        return angle_rad, now_rad_s, 0.0, current_a
    stepped_s = later_s if later_s < current_s else earlier_s  # the newest command that this current follows
    if earlier_s < current_before_s <= later_s < current_s or current_before_s <= earlier_s < current_s <= later_s:
        fraction = (stepped_s - angle_before_s) / dt_s
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
        """The newest angles of sweep and adduction; a load belongs to a slightly earlier time."""
        return self._sweep[1].angle_rad, self._adduction[1].angle_rad

    def update(
        self, sweep: DriveState, adduction: DriveState, commands_s: CommandTimes = NO_COMMANDS
    ) -> JointLoad | None:
        """Return the load; None for samples that repeat the ones before. Velocities may be unknown (NaN)."""
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
        saturated = abs(sweep.current_a) >= self._clip_a
        return self._without_gravity(sweep_rad, adduction_rad, sweep_nm, adduction_nm, saturated)

    def _without_gravity(
        self, sweep_rad: float, adduction_rad: float, sweep_nm: float, adduction_nm: float, saturated: bool
    ) -> JointLoad:
        """Subtract gravity as in ArmMass.gravity_torques_nm, sharing its sines with depth and levers."""
        sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
        length_m, drop_m, moment_nm = self._length_m, self._drop_m, self._moment_nm
        return JointLoad(
            sweep_rad,
            adduction_rad,
            drop_m * cb - length_m * ca * sb - self._axis_height_m,
            -length_m * sa * sb,
            drop_m * sb + length_m * ca * cb - CLINGING_M * sb,
            sweep_nm - moment_nm * sa * sb,
            adduction_nm + moment_nm * ca * cb,
            saturated,
        )


def _repeats(before: DriveState, now: DriveState) -> bool:
    return now.current_a == before.current_a and now.angle_rad == before.angle_rad


def _paired(pair: tuple[DriveState, DriveState], now: DriveState) -> tuple[DriveState, DriveState]:
    """Pair a sample with the last one of another angle: a new current alone leaves the acceleration unchanged."""
    before, last = pair
    return (before if now.angle_stamp_s == last.angle_stamp_s else last), now


def _friction_nm(friction: JointFriction, angle_rad: float, velocity_rad_s: float) -> float:
    return friction.torque_nm(angle_rad, velocity_rad_s if isfinite(velocity_rad_s) else 0.0)
