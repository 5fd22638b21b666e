"""Faults as data: what the last states of the drives say against having torque on.

`find_fault` is pure and runs every tick. It looks at the drives only; bugs and the bus report theirs by the same
record.
"""

from __future__ import annotations

from math import degrees, isfinite
from typing import NamedTuple

from control.limits import JointLimits, JointRange
from control.records import JOINTS, DriveState, DriveStates


class Fault(NamedTuple):
    name: str
    sentence: str


HEARTBEAT_SILENCE_S = 0.5  # drives send one every 100 ms: five in a row are missing


def find_fault(
    states: DriveStates,
    ranges: tuple[JointRange, JointRange, JointRange, JointRange],
    limits: JointLimits,
    silence_s: float,
    closed_loop_expected: bool,
    now_s: float,
) -> Fault | None:
    """The first fault found, joint by joint; None when all is well. `silence_s` bounds the age of both signals."""
    for joint, state, span in zip(JOINTS, states, ranges, strict=True):
        fault = (
            _silence(joint, state, silence_s, now_s)
            or _drive_error(joint, state)
            or _out_of_range(joint, state, span, limits)
        )
        if fault:
            return fault
        if closed_loop_expected and not state.closed_loop:
            return Fault("drive_disarmed", f"The {joint} drive left closed loop by itself.")
    return None


def _silence(joint: str, state: DriveState, silence_s: float, now_s: float) -> Fault | None:
    for signal, stamp_s, longest_s in (
        ("position", state.angle_stamp_s, silence_s),
        ("current", state.current_stamp_s, silence_s),
        ("heartbeat", state.heartbeat_stamp_s, HEARTBEAT_SILENCE_S),
    ):
        age_s = now_s - stamp_s
        if age_s > longest_s:
            ago = f"for {age_s * 1e3:.0f} ms" if isfinite(age_s) else "at all"
            return Fault("drive_silent", f"No {signal} came from the {joint} drive {ago}.")
    return None


def _drive_error(joint: str, state: DriveState) -> Fault | None:
    if state.error_flags == 0:
        return None
    return Fault("drive_error", f"The {joint} drive reports error 0x{state.error_flags:x}.")


def _out_of_range(joint: str, state: DriveState, span: JointRange, limits: JointLimits) -> Fault | None:
    angle_deg, margin_deg = degrees(state.angle_rad), limits.position_margin_deg
    low_deg, high_deg = degrees(span.min_rad) - margin_deg, degrees(span.max_rad) + margin_deg
    if not low_deg <= angle_deg <= high_deg:
        return Fault(
            "joint_position",
            f"The {joint} joint is at {angle_deg:.1f} degrees, outside of {low_deg:.0f} to {high_deg:.0f}.",
        )
    if state.temperature_c >= limits.temperature_hot_c:
        return Fault("motor_hot", f"The {joint} motor has {state.temperature_c:.0f} degrees C.")
    return None
