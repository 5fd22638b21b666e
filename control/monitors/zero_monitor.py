"""Detects a zero that may have shifted: another angle after a drive's restart or silence.

A drive that starts again may count from elsewhere. The angle after a silence is compared with the one before. A joint can have turned by its speed within LONGEST_GAP_S; over a longer
silence it may fall or be moved by hand, which nothing reports, so a larger difference waits for an operator. Steps add
up: an encoder that jumps back has the same zero as before.
"""

from math import degrees

from control.faults import Fault, FaultKind
from control.monitors.encoder_monitor import LONGEST_GAP_S
from control.records import NEVER_S, UNKNOWN, DriveState

SILENCE_S = 0.012  # four periods: no drive starts again within it; a jump between two messages is encoder_jump
LARGEST_STEP_RAD = 100.0  # more is no measurement


class ZeroMonitor:
    """Owns the newest angle of one joint, and the sum of its unexplained steps since the zero was confirmed."""

    def __init__(self, joint: str, jump_rad: float) -> None:
        self.joint = joint
        self._jump_rad = jump_rad
        self.shift_rad = 0.0
        self._angle_rad, self._velocity_rad_s, self._stamp_s = UNKNOWN, UNKNOWN, NEVER_S

    def update(self, state: DriveState) -> Fault | None:
        """Return the fault of a zero that nobody has confirmed since it may have shifted."""
        stamp_s = state.angle_stamp_s
        if stamp_s != self._stamp_s:
            step_rad = state.angle_rad - self._angle_rad
            if not -self._jump_rad <= step_rad <= self._jump_rad and self._is_unexplained(state, step_rad):
                self.shift_rad += step_rad
            if not abs(step_rad) > LARGEST_STEP_RAD:  # also the first angle, or one after a gap of ours
                self._angle_rad, self._velocity_rad_s, self._stamp_s = state.angle_rad, state.velocity_rad_s, stamp_s
        if -self._jump_rad <= self.shift_rad <= self._jump_rad:
            return None
        now_rad = self._angle_rad
        before_deg, now_deg = degrees(now_rad - self.shift_rad), degrees(now_rad)
        return FaultKind.ZERO_SHIFTED.fault(self.joint, before_deg=before_deg, now_deg=now_deg)

    def _is_unexplained(self, state: DriveState, step_rad: float) -> bool:
        silence_s = state.angle_stamp_s - self._stamp_s
        if silence_s < SILENCE_S:
            return False
        gap_s = min(silence_s, LONGEST_GAP_S)
        fastest_rad_s = max(abs(self._velocity_rad_s), abs(state.velocity_rad_s))
        return self._jump_rad + fastest_rad_s * gap_s < abs(step_rad) <= LARGEST_STEP_RAD

    def skip_gap(self) -> None:
        """Accept the next angle: this program missed ticks, and a drive that is not asked does not answer."""
        self._angle_rad = UNKNOWN

    def confirm(self) -> float:
        """Accept the present angle; return the shift that was accepted."""
        shift_rad, self.shift_rad = self.shift_rad, 0.0
        return shift_rad
