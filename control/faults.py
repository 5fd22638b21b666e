"""Faults as data: what the last states of the drives say against having torque on.

`find_fault` is pure and runs every tick: a silent drive, a drive's own error, a drive that left closed loop, a joint
out of its range, a hot motor. What the loop sees of itself (a stall, a bus that takes no commands, a torque that is
no number, slow arming, wrong firmware) it reports by the same record, and so does a walk that cannot go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, inf, isfinite
from typing import NamedTuple

from control.limits import JointLimits, JointRange
from control.records import JOINTS, DriveState, DriveStates


class Fault(NamedTuple):
    name: str
    sentence: str


HEARTBEAT_SILENCE_S = 0.5  # drives send one every 100 ms: five in a row are missing
TEMPERATURE_SILENCE_S = 1.0  # of a drive that has told its temperature before


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
            or _hot(joint, state, limits)
        )
        if fault:
            return fault
        if closed_loop_expected and not state.closed_loop:
            return Fault("drive_disarmed", f"The {joint} drive left closed loop by itself.")
    return None


def silent_signals(state: DriveState, silence_s: float, now_s: float) -> list[tuple[str, float]]:
    """(signal, age in s) of what a drive should have sent by now; infinite age: never heard."""
    told_temperature = isfinite(state.temperature_stamp_s)
    return [
        (signal, now_s - stamp_s)
        for signal, stamp_s, longest_s in (
            ("position", state.angle_stamp_s, silence_s),
            ("current", state.current_stamp_s, silence_s),
            ("heartbeat", state.heartbeat_stamp_s, HEARTBEAT_SILENCE_S),
            ("temperature", state.temperature_stamp_s, TEMPERATURE_SILENCE_S if told_temperature else inf),
        )
        if now_s - stamp_s > longest_s
    ]


def _silence(joint: str, state: DriveState, silence_s: float, now_s: float) -> Fault | None:
    silent = silent_signals(state, silence_s, now_s)
    if not silent:
        return None
    signal, age_s = silent[0]
    ago = f"for {age_s * 1e3:.0f} ms" if isfinite(age_s) else "at all"
    return Fault("drive_silent", f"No {signal} came from the {joint} drive {ago}.")


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
    return None


def _hot(joint: str, state: DriveState, limits: JointLimits) -> Fault | None:
    if state.temperature_c >= limits.temperature_hot_c:
        return Fault("motor_hot", f"The {joint} motor has {state.temperature_c:.0f} degrees C.")
    return None


def held_by_the_mud(flippers: Sequence[str], attempts: int) -> Fault:
    """Of flippers that a recovery has given up."""
    one = len(flippers) == 1
    held = f"The {flippers[0]} flipper is" if one else "Both flippers are"
    return Fault(
        "flipper_stuck",
        f"{held} stuck in the mud after {attempts} attempt{'s' if attempts > 1 else ''}:"
        f" free {'it' if one else 'them'} by hand, and walk less deep.",
    )
