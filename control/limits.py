"""`apply_limits`, the last pure function before the wire.

Each torque that leaves is finite, within the torque limit, and at most one slew step from the torque sent before.
Torque that would push a joint past its position limit is cut; near the velocity limit and in a hot motor it fades. The
slew rate limits these reductions too. Only a torque that is not a number goes to zero at once.
"""

from math import isfinite
from typing import NamedTuple

from control.parameters.joint_limits import JointLimits
from control.records import DriveState, DriveStates, Joints, Torques

VELOCITY_FADE = 0.2  # torque that speeds a joint up fades out over this last part of the velocity limit


class JointRange(NamedTuple):
    """Position limits of one joint in radians."""

    min_rad: float
    max_rad: float


class LimitedTorques(NamedTuple):
    torques_nm: Torques
    limited: bool  # a torque differs from the wanted one
    finite: bool  # False: a torque was NaN or infinite, which is a bug; all torques are zero


def limited_torque_nm(
    wanted_nm: float, previous_nm: float, state: DriveState, limits: JointLimits, span: JointRange, dt_s: float
) -> float:
    """Return the torque of one joint, given the one sent `dt_s` ago. All values must be finite."""
    angle_rad, velocity_rad_s, largest_nm = state.angle_rad, state.velocity_rad_s, limits.torque_nm
    if state.temperature_c >= limits.temperature_warm_c:  # a drive without thermistor reports NaN or 0
        largest_nm *= _cool_fraction(state.temperature_c, limits)
    upward_nm = largest_nm if angle_rad < span.max_rad else 0.0
    downward_nm = largest_nm if angle_rad > span.min_rad else 0.0
    fade_rad_s = (1.0 - VELOCITY_FADE) * limits.velocity_rad_s
    if velocity_rad_s > fade_rad_s:
        upward_nm *= _slow_fraction(velocity_rad_s, limits.velocity_rad_s)
    elif velocity_rad_s < -fade_rad_s:
        downward_nm *= _slow_fraction(-velocity_rad_s, limits.velocity_rad_s)
    slew_nm = limits.torque_rate_nm_s * dt_s
    return clip(clip(wanted_nm, -downward_nm, upward_nm), previous_nm - slew_nm, previous_nm + slew_nm)


def clip(value: float, low: float, high: float) -> float:
    """Return the value, or the bound that it exceeds; in half the time of `min` and `max`."""
    if value < low:
        return low
    return high if value > high else value


def _cool_fraction(temperature_c: float, limits: JointLimits) -> float:
    """Return 1 for a warm motor, falling to 0 for a hot one."""
    span_c = max(limits.temperature_hot_c - limits.temperature_warm_c, 1e-9)
    return max(0.0, (limits.temperature_hot_c - temperature_c) / span_c)


def _slow_fraction(velocity_rad_s: float, limit_rad_s: float) -> float:
    """Return 1 where the fade begins and 0 from the limit on, for torque in the direction of `velocity_rad_s`."""
    if velocity_rad_s >= limit_rad_s:
        return 0.0
    return (limit_rad_s - velocity_rad_s) / (VELOCITY_FADE * limit_rad_s)


def apply_limits(
    wanted_nm: Torques,
    previous_nm: Torques,
    states: DriveStates,
    limits: JointLimits,
    ranges: Joints[JointRange],
    dt_s: float,
) -> LimitedTorques:
    """Limit the wanted torques. If one torque, angle or velocity is not finite, all torques are zero."""
    torques_nm = [
        limited_torque_nm(wanted, previous, state, limits, span, dt_s)
        if isfinite(wanted + state.angle_rad + state.velocity_rad_s)
        else float("nan")
        for wanted, previous, state, span in zip(wanted_nm, previous_nm, states, ranges, strict=True)
    ]
    if not isfinite(sum(torques_nm)):
        return LimitedTorques(Joints(*[0.0 for _ in torques_nm]), True, False)
    limited_nm = Joints(*torques_nm)
    return LimitedTorques(limited_nm, limited_nm != wanted_nm, True)
