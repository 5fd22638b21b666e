"""Detects an encoder that fails: angles that jump, freeze while the joint moves, or slip (speed_monitor.py).

Between two messages the angle must change by the mean of the two reported velocities times the interval, and the angle
must follow the integral of the velocity. A slipping magnet or a broken cable violates the first condition, a frozen
sensor the second: on a wrong angle the position loop would drive the joint to its stop at full torque. A sensor that
freezes while the joint rests shows in the velocity: a live velocity that is not zero does not repeat to the last bit,
unless the joint creeps through the codes of a coarse drive.
One that freezes at exactly zero velocity shows in the torque: every joint yields a little to a torque that changes, by
half a step of a 14-bit encoder at 1000 N·m/rad, ten times the stiffness of the arm in the stiffest mud. Where the body
moves, the load of a joint that dry friction holds may follow a torque that changes slowly, by 0.9 N·m in 0.1 s. It does
not follow a step, so such a joint is probed by one before it counts as frozen.
"""

from math import degrees, inf

from control.faults import Fault, FaultKind
from control.monitors.motion_monitor import PUNCTUAL_S
from control.monitors.speed_monitor import INTERVAL_S, SpeedMonitor
from control.records import NEVER_S, UNKNOWN, DriveState

MOVED_RAD = 0.03  # integral of the velocity while the angle stays the same to the last bit
MOVED_S = 0.02  # drives repeat an old value now and then
MOVED_LEAK_S = 1.0  # of that integral: a joint that has come to rest at the same angle again is sound
LONGEST_GAP_S = 0.03  # between two messages; over more, two velocities do not determine the path, nor equal angles rest
HIT_RAD_S2 = 2000.0  # more than full torque accelerates a whole joint: its rotor is in the play of a belt, or hits
RESTS_RAD_S = 1e-9  # far below any encoder's noise: a velocity that has decayed may keep its last bit
FROZEN_S = 0.1  # without a change of even the last bit of angle and non-zero velocity
SPEED_CODES, ANGLE_CODE_RAD = 4095, 0.0004  # of the coarsest drives: a joint may creep at half a code of its speed
UNCHANGED_S = 0.05  # without a change of even the last bit of angle and velocity, at any reported velocity
YIELDING_NM = 0.4  # change of the torque meanwhile: more than dry friction and shakes of the bench (±0.15 N·m)
STEP_NM = 0.25  # more than dry friction holds in both directions
YIELDS_S = 0.01  # after that: an answer is a tick older than its torque, and ten times the inertia starts in 3 ms


class EncoderMonitor:
    """Owns the last message, and the integral of the velocity since the angle last changed."""

    def __init__(self, joint: str, jump_rad: float, fastest_rad_s: float = inf) -> None:
        """`fastest_rad_s`: up to which the drive reports its speed."""
        self._joint = joint
        self._jump_rad = jump_rad
        self._fastest_rad_s = fastest_rad_s
        self._longest_frozen_s = max(FROZEN_S, SPEED_CODES * ANGLE_CODE_RAD / fastest_rad_s)
        self._speed = SpeedMonitor(joint)
        self.reset()

    def reset(self) -> None:
        self._angle_rad, self._velocity_rad_s, self._stamp_s = UNKNOWN, UNKNOWN, NEVER_S
        self._reset_frozen()
        self._speed.reset()
        self._begin_interval()

    def _begin_interval(self, after_s: float = 0.0) -> None:
        """Begin the sums of speed_monitor.py, after a time in which messages do not count."""
        self._interval_s, self._path_rad, self._turned_rad, self._jumps_rad = -after_s, 0.0, 0.0, 0.0

    def _reset_frozen(self) -> None:
        self._repeated = False  # the newest angle, since the sums below began
        self._moved_s = self._moved_rad = self._frozen_s = 0.0
        self.forget_torque()

    def forget_torque(self) -> None:
        """Begin the wait for a reaction to torque again."""
        self._unchanged_s = self._ignored_s = 0.0
        self._lowest_nm, self._highest_nm = inf, -inf
        self.probed = False  # the joint is to get a step of STEP_NM, since it has ignored a torque that changed

    def release(self) -> None:
        """Begin again without torque, where a joint rests exactly where it is, or a hand moves it."""
        if abs(self._velocity_rad_s) <= RESTS_RAD_S:
            self._reset_frozen()  # a speed that was reported at this angle is over
        else:
            self.forget_torque()
        self._speed.reset()
        self._begin_interval()

    def update(self, state: DriveState, dt_s: float, torque_nm: float = 0.0) -> Fault | None:
        """Return the fault that a new angle shows, if any. A stamp may be late by `dt_s`."""
        stamp_s, before_s = state.angle_stamp_s, self._stamp_s
        if stamp_s == before_s:
            return None
        gap_s = stamp_s - before_s if stamp_s > before_s else 0.0
        angle_rad, velocity_rad_s = state.angle_rad, state.velocity_rad_s
        step_rad = angle_rad - self._angle_rad
        path_rad = (velocity_rad_s + self._velocity_rad_s) / 2.0 * gap_s
        fault = None
        if gap_s > LONGEST_GAP_S:  # also that before the first message
            self._reset_frozen()
        elif angle_rad == self._angle_rad:
            self._repeated = True
            fault = self._check_frozen(state, gap_s, torque_nm)
        else:
            if not -self._jump_rad <= step_rad - path_rad <= self._jump_rad:
                fault = self._check_jump(velocity_rad_s, step_rad, path_rad, gap_s, dt_s)
            if self._repeated:
                self._reset_frozen()
        if gap_s > PUNCTUAL_S:
            self._begin_interval(after_s=INTERVAL_S)  # the messages that were held up come in a burst
        elif not -self._fastest_rad_s <= velocity_rad_s <= self._fastest_rad_s:
            self._begin_interval(after_s=PUNCTUAL_S)  # nor does this speed count in the mean with the next one
        elif not fault and gap_s > 0.0:
            self._interval_s += gap_s
            if self._interval_s > 0.0:
                self._path_rad += path_rad
                self._turned_rad += step_rad
                jump_rad_s = abs(velocity_rad_s - self._velocity_rad_s)
                if jump_rad_s > HIT_RAD_S2 * gap_s:
                    self._jumps_rad += jump_rad_s / 2.0 * gap_s
            if self._interval_s >= INTERVAL_S:
                fault = self._speed.update(self._interval_s, self._path_rad, self._turned_rad, self._jumps_rad)
                self._begin_interval()
        self._angle_rad, self._velocity_rad_s, self._stamp_s = angle_rad, velocity_rad_s, stamp_s
        return fault

    def _check_jump(
        self, velocity_rad_s: float, step_rad: float, path_rad: float, gap_s: float, dt_s: float
    ) -> Fault | None:
        """Return a fault if the step differs from the mean velocity's by more than a late stamp explains."""
        late_rad = max(abs(velocity_rad_s), abs(self._velocity_rad_s)) * dt_s
        if not abs(step_rad - path_rad) > self._jump_rad + late_rad:
            return None
        return FaultKind.ENCODER_JUMP.fault(self._joint, step_deg=degrees(abs(step_rad)), gap_ms=gap_s * 1e3)

    def _check_frozen(self, state: DriveState, gap_s: float, torque_nm: float) -> Fault | None:
        """Return a fault if the angle is frozen. The integral is signed: a velocity at rest is noise about zero."""
        self._moved_s += gap_s
        self._moved_rad += state.velocity_rad_s * gap_s - self._moved_rad * gap_s / MOVED_LEAK_S
        frozen = state.velocity_rad_s == self._velocity_rad_s and abs(state.velocity_rad_s) > RESTS_RAD_S
        self._frozen_s = self._frozen_s + gap_s if frozen else 0.0
        moved = abs(self._moved_rad) > MOVED_RAD and self._moved_s > MOVED_S
        if not moved and self._frozen_s <= self._longest_frozen_s and not self._ignores_torque(state, gap_s, torque_nm):
            return None
        return FaultKind.ENCODER_STUCK.fault(self._joint)

    def _ignores_torque(self, state: DriveState, gap_s: float, torque_nm: float) -> bool:
        """Return whether angle and velocity stay the same to the last bit while the torque changes."""
        if state.velocity_rad_s != self._velocity_rad_s:
            self.forget_torque()
            return False
        self._unchanged_s += gap_s
        if self._highest_nm - self._lowest_nm > YIELDING_NM:
            self._ignored_s += gap_s
        if torque_nm < self._lowest_nm:
            self._lowest_nm = torque_nm
        if torque_nm > self._highest_nm:
            self._highest_nm = torque_nm
        self.probed = self._unchanged_s > UNCHANGED_S - YIELDS_S and self._highest_nm - self._lowest_nm > YIELDING_NM
        return self._unchanged_s > UNCHANGED_S and self._ignored_s > YIELDS_S
