"""Whether an encoder tells of a joint: positions that jump, and positions that stand still while the joint moves.

From one message to the next a joint goes as far as the speeds say that the drive tells with its angles; and what these
speeds sum up to must be seen in the angle. A magnet that slips or a cable that breaks shows in the first way, a sensor
that hangs in the second: with a made-up angle the position loop would drive the joint to its stop at full torque. Of a
sensor that hangs while the joint rests, its speed betrays it: a live one that is not zero does not stay the same to the
last bit.
"""

from __future__ import annotations

from math import degrees

from control.faults import Fault, FaultKind
from control.records import NEVER_S, UNKNOWN, DriveState

GONE_RAD = 0.03  # by the joint's own speed, while its angle stayed the same to the last bit
GONE_S = 0.02  # drives tell an old value once more, now and then
LONGEST_GAP_S = 0.03  # between two messages, over which two speeds say where a joint has gone
RESTS_RAD_S = 1e-9  # far below any encoder's noise: a speed that has died away may keep its last bit
FROZEN_S = 0.1  # in which not even the last bit of angle and of a speed that is not zero changes


class EncoderMonitor:
    """Owns the last message, and what the speed has summed up to since the angle last changed."""

    def __init__(self, joint: str, jump_rad: float) -> None:
        self._joint = joint
        self._jump_rad = jump_rad
        self.reset()

    def reset(self) -> None:
        self._angle_rad, self._velocity_rad_s, self._stamp_s = UNKNOWN, UNKNOWN, NEVER_S
        self._begin_count()

    def _begin_count(self) -> None:
        self._gone_s = self._gone_rad = self._frozen_s = 0.0

    def update(self, state: DriveState, dt_s: float) -> Fault | None:
        """The fault that a new position shows, if any. A stamp may be late by `dt_s`."""
        if state.angle_stamp_s == self._stamp_s:
            return None
        gap_s = max(state.angle_stamp_s - self._stamp_s, 0.0)
        if state.angle_rad == self._angle_rad:
            fault = self._count(state, gap_s)
        else:
            fault = self._measure(state, gap_s, dt_s)
            self._begin_count()
        self._angle_rad, self._velocity_rad_s, self._stamp_s = (
            state.angle_rad, state.velocity_rad_s, state.angle_stamp_s
        )  # fmt: skip
        return fault

    def _measure(self, state: DriveState, gap_s: float, dt_s: float) -> Fault | None:
        """By how much the way differs from that of the mean speed, beyond what a late stamp makes of the higher one."""
        if gap_s > LONGEST_GAP_S:  # also that before the first one
            return None
        step_rad = state.angle_rad - self._angle_rad
        odd_rad = abs(step_rad - (state.velocity_rad_s + self._velocity_rad_s) / 2.0 * gap_s)
        late_rad = max(abs(state.velocity_rad_s), abs(self._velocity_rad_s)) * dt_s
        if not odd_rad > self._jump_rad + late_rad:
            return None
        return FaultKind.ENCODER_JUMP.fault(self._joint, step_deg=degrees(abs(step_rad)), gap_ms=gap_s * 1e3)

    def _count(self, state: DriveState, gap_s: float) -> Fault | None:
        """With its sign, since a speed at rest is noise about zero."""
        self._gone_s += gap_s
        self._gone_rad += state.velocity_rad_s * gap_s
        frozen = state.velocity_rad_s == self._velocity_rad_s and abs(state.velocity_rad_s) > RESTS_RAD_S
        self._frozen_s = self._frozen_s + gap_s if frozen else 0.0
        moved = abs(self._gone_rad) > GONE_RAD and self._gone_s > GONE_S
        if not moved and self._frozen_s <= FROZEN_S:
            return None
        return FaultKind.ENCODER_STUCK.fault(self._joint)
