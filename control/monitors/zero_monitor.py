"""Detects a zero that may have shifted: another angle after a drive's restart or silence.

A drive that starts again may count from elsewhere. The angle after a silence is compared with the one before. A joint
can have turned by its speed within LONGEST_GAP_S; over a longer silence it may fall or be moved by hand, which nothing
reports, so a larger difference waits for an operator. Steps add up: a joint that falls and is put back has the same
zero as before. No drive starts again within PUNCTUAL_S: a jump between two punctual messages is encoder_jump.
"""

from math import degrees

from control.faults import Fault, FaultKind
from control.monitors.encoder_monitor import LONGEST_GAP_S
from control.monitors.motion_monitor import PUNCTUAL_S
from control.records import NEVER_S, UNKNOWN, DriveState

LARGEST_STEP_RAD = 100.0  # more is no measurement


class ZeroMonitor:
    """Owns the newest angle of one joint, and the sum of its unexplained steps since the zero was confirmed."""

    def __init__(self, joint: str, jump_rad: float) -> None:
        self.joint = joint
        self._jump_rad = jump_rad
        self.shift_rad = 0.0
        self._before = DriveState()
        self._gap_end_s = NEVER_S

    def update(self, state: DriveState) -> Fault | None:
        """Return the fault of a zero that nobody has confirmed since it may have shifted."""
        step_rad, jump_rad = state.angle_rad - self._before.angle_rad, self._jump_rad
        if -jump_rad <= step_rad <= jump_rad:
            self._before = state
        elif state.angle_stamp_s != self._before.angle_stamp_s:
            self._add_step(state, step_rad)
        if -jump_rad <= self.shift_rad <= jump_rad:
            return None
        now_rad = self._before.angle_rad
        before_deg, now_deg = degrees(now_rad - self.shift_rad), degrees(now_rad)
        return FaultKind.ZERO_SHIFTED.fault(self.joint, before_deg=before_deg, now_deg=now_deg)

    def _add_step(self, state: DriveState, step_rad: float) -> None:
        """Add a step that the speed does not explain. No step is known to the first angle, and after a gap of ours."""
        silence_s = state.angle_stamp_s - self._before.angle_stamp_s
        fastest_rad_s = max(abs(self._before.velocity_rad_s), abs(state.velocity_rad_s))
        if abs(step_rad) > LARGEST_STEP_RAD:
            return
        if silence_s >= PUNCTUAL_S and abs(step_rad) > self._jump_rad + fastest_rad_s * min(silence_s, LONGEST_GAP_S):
            self.shift_rad += step_rad
        self._before = state if state.angle_stamp_s >= self._gap_end_s else state._replace(angle_rad=UNKNOWN)

    def skip_gap(self, now_s: float) -> None:
        """Accept the first angle since now: this program missed ticks, and a drive that is not asked does not answer.

        The answer to the last question before the gap is read after it.
        """
        self._gap_end_s = now_s
        self._before = self._before._replace(angle_rad=UNKNOWN)

    def confirm(self) -> float:
        """Accept the present angle; return the shift that was accepted."""
        shift_rad, self.shift_rad = self.shift_rad, 0.0
        return shift_rad
