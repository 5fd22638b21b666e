"""Detects a joint whose motion neither its commanded torque nor its commanded path explains.

A drive that obeys late, weakly, in the wrong direction, or another program, reports currents that look healthy. Its
joint shows it. Four quantities are small in every healthy motion, in air and in mud:

    runaway      the energy that the joint has and was not given, by the commanded torque τ over its path:
                     E = ½ I ω² - ∫ τ dθ
                 Mud and friction only take energy, so E falls; what a joint returns while it is braked it received
                 before. E rises without end where the torque is inverted or another's. Here it leaks within 0.2 s and
                 never is below zero: a weight that the motor lowers at the speed of a path stays below the bound.
                 Where the target rests, and in damping, it leaks within 1 s, since a joint that a strong motor shakes
                 gains little in a cycle.
    oscillation  the path away from the target: |Δθ| - |Δθ*| + Δ|θ* - θ| is zero for a joint that approaches its
                 target, lags behind it or stands still, and twice the path of one that moves away. A loop that is not
                 stable moves away twice in each of its cycles. It leaks within 0.3 s. A joint that shoots past its
                 target, out of the mud or thrown by a stone, and comes to rest, moves as far in a few cycles. Each of
                 its excursions is clearly smaller than the one before on the other side, and does not count. One that
                 is smaller than the one before on its own side ends the count: only its own path remains.
                 A joint that a strong motor shakes swings faster than its inertia and its stiffness allow, π √(I / k)
                 from one side to the other, and moves little: so strong torques in turn count, while its excursions
                 do not fade. A recovery that rocks a joint gives such torques on purpose.
    following    the angle θ* - θ that remains after the PD has reached full torque, as LinuxCNC's FERROR: its bound
                 grows with the commanded speed. A flipper in the mud may lag behind by any angle, so this one counts
                 in air only.
    driven back  the path against a torque, where the target does not lead, in intervals in a row. Mud, friction and
                 stops yield to a torque or resist it, and a load that outweighs it moves the joint until both are
                 equal. A target that moves against a torque near the limit does not lead: the joint is far ahead.
                 An encoder that slips together with its speed, while the joint presses against its stop, shows just
                 the motion and torque of a weight that a hand lowers: the control law makes them equal. So such a
                 joint is probed: its torque is PROBE_NM less in one interval, and again as wanted in the next one.
                 Whatever drives a joint back, hand, weight, body or mud, then moves it faster, or slower again; an
                 encoder that slips goes on at its speed. (One that slips alone is found before: speed_monitor.py.)
                 A recovery that rocks a joint reverses its torque before an interval ends, and throws the joint off
                 its stop. From one reversal at which the joint is slow to the next is an interval there, in which the
                 path that remains counts against the mean torque.

Each sum is one of differences between two samples: none is added over a gap, and after a jump of the encoder all sums
begin again.

A joint that waits too long for its next command still follows the one before, and moves past its target although it
obeys. Oscillation and following therefore count only where samples and ticks were punctual for a while. On a robot,
such a gap is a fault of its own (`drive_quiet`, `loop_lagging`); a simulation in real time continues.
"""

from math import copysign, inf, pi, sqrt
from typing import NamedTuple

from control.faults import Fault, FaultKind
from control.records import NEVER_S, UNKNOWN, DriveState, JointTarget

RUNAWAY_RAD = 0.2  # path of full torque whose energy may remain unexplained: twice that of rocking in the stiffest mud
RUNAWAY_LEAK_S = 0.2  # full torque that lowers a weight at 1 rad/s, the speed of a path, stays within the bound
RESTING_LEAK_S = 1.0  # where no path lowers a weight: the target rests, or the joint is braked
RUNAWAY_FLOOR_J = 0.02  # noise of the speed, and a hand, where the torque limit is low
AWAY_RAD = 0.5  # twice that of a joint that catches up in its swing: 0.24 rad
AWAY_LEAK_S = 0.3
STABLE_FRACTION = 0.85  # of the excursion before, which fades: a loop with 0.09 of critical damping keeps 0.75 in 40 ms
FAST_SWING_FRACTION = 0.75  # of half a swing of a sound joint: its motor is at least 1.8 times as strong
SHAKEN = 8  # torques in turn; 4 in a quick swing, and 7 in stiff mud of a joint that a stone has thrown
SHAKING_FRACTION = 1.0 / 3.0  # of the torque limit, and at least PRESSING_NM
FOLLOWING_RAD = 0.2  # beyond the angle at which the PD reaches full torque
FOLLOWING_S = 0.05  # of the commanded speed: ten times the delay of the loop
PRESSING_NM = 0.25  # more than dry friction and cogging
SLOW_RAD_S = 3.0  # of a joint that is not on its way to or fro, and may slip at 1 rad/s
NEAR_LIMIT_FRACTION = 0.9  # of the torque limit
DRIVEN_BACK_S = 0.06
DRIVEN_BACK_RAD_S = 0.03  # five steps of a 14-bit encoder in an interval
PROBED = 3  # intervals in a row; a body that sinks pushes a swing back for as long
NOT_YIELDED = PROBED + 2  # the probe, and the interval after it
PROBE_NM = 0.125  # less torque moves a flipper that carries 1 kg by 11 mrad
PROBE_S = 0.05  # and after it
STEADY_RAD = 0.002  # within it and a fraction of the path the speed is that of the interval before; more than a
STEADY_FRACTION = 0.1  # stop of 100 N·m/rad yields to the probe
ROCKED_FRACTION = 0.5  # of both, in each rocking: mud that creeps shows no load
LONGEST_GAP_S = 0.03  # between two samples
PUNCTUAL_S = 0.012  # between two samples: four periods; a sound joint then moves away by 0.27 rad in all
SETTLING_S = 0.3  # after a longer gap: the joint returns to its path within a swing
FASTEST_RAD_S = 1000.0  # more is no measurement


class JointDynamics(NamedTuple):
    """The properties of a joint that relate its motion to its torque."""

    inertia_kg_m2: float = 0.0004
    stiffness_nm_rad: float = 8.0


def runaway_bound_j(torque_nm: float) -> float:
    """Return the energy that may remain unexplained, of a joint with this torque limit."""
    return max(RUNAWAY_RAD * torque_nm, RUNAWAY_FLOOR_J)


class MotionMonitor:
    """Owns the unexplained energy of one joint, its path away from the target, and the sample before."""

    def __init__(self, joint: str, dynamics: JointDynamics, torque_nm: float) -> None:
        self._joint = joint
        self._half_inertia = 0.5 * dynamics.inertia_kg_m2
        self._runaway_j = runaway_bound_j(torque_nm)
        self._near_limit_nm = NEAR_LIMIT_FRACTION * torque_nm
        stiffness_nm_rad = dynamics.stiffness_nm_rad
        self._following_rad = FOLLOWING_RAD + (torque_nm / stiffness_nm_rad if stiffness_nm_rad else inf)
        half_swing_s = pi * sqrt(dynamics.inertia_kg_m2 / stiffness_nm_rad) if stiffness_nm_rad else 0.0
        self._shaken_s = FAST_SWING_FRACTION * half_swing_s  # largest, between two torques
        self._shaking_nm = max(SHAKING_FRACTION * torque_nm, PRESSING_NM)
        self.reset()

    def reset(self) -> None:
        self.unexplained_j = self.away_rad = 0.0
        self._stamp_s, self._angle_rad, self._velocity_rad_s = NEVER_S, UNKNOWN, UNKNOWN
        self._target_rad = self._error_rad = UNKNOWN
        # largest errors: since the target was passed, before on the other side, and before that on the same side
        self._excursion_rad = self._excursion_before_rad = self._same_side_rad = 0.0
        self._impulse_nm_s = self._elapsed_s = 0.0  # since the sample before
        self._punctual_s = SETTLING_S  # since the last gap
        self._shaken, self._turned_nm, self._turned_s = 0, 0.0, NEVER_S  # torques in turn; the last one and its time
        self.driven_back = 0  # intervals in a row
        self._pressed_s = self._back_rad = self._pressing_nm = 0.0  # in the present interval
        self._back_rad_s = 0.0  # in the interval before
        self._rock_s = UNKNOWN  # since a recovery's last reversal at which the joint was slow
        self._rock_rad = self._rock_nm_s = 0.0

    @property
    def probed(self) -> bool:
        """Return whether the joint's torque is to be PROBE_NM less than wanted, so that a load shows."""
        return self.driven_back == PROBED

    def update(
        self,
        found: list[Fault],
        state: DriveState,
        dt_s: float,
        torque_nm: float,
        target: JointTarget | None,
        braked: bool = False,
    ) -> None:
        """Add the faults of a new sample. `torque_nm` was commanded for the last `dt_s`; no target: no stiffness.

        `braked`: every torque is against the motion.
        """
        self._impulse_nm_s += torque_nm * dt_s
        self._elapsed_s += dt_s
        stamp_s, elapsed_s = state.angle_stamp_s, self._elapsed_s
        if stamp_s == self._stamp_s:
            return
        angle_rad, velocity_rad_s = state.angle_rad, state.velocity_rad_s
        target_rad = UNKNOWN if target is None else target.angle_rad
        self._punctual_s = self._punctual_s + elapsed_s if elapsed_s < PUNCTUAL_S else 0.0
        step_rad, farthest_rad = angle_rad - self._angle_rad, FASTEST_RAD_S * elapsed_s
        measured = -FASTEST_RAD_S < velocity_rad_s < FASTEST_RAD_S and -farthest_rad < step_rad < farthest_rad
        if measured and elapsed_s < LONGEST_GAP_S:  # never true of the first sample, which follows on UNKNOWN
            lead_rad_s = UNKNOWN if target is None else target.velocity_rad_s
            self._add(elapsed_s, step_rad, velocity_rad_s, target_rad, lead_rad_s, braked)
        self._impulse_nm_s = self._elapsed_s = 0.0
        self._stamp_s, self._angle_rad, self._velocity_rad_s = stamp_s, angle_rad, velocity_rad_s
        self._target_rad, self._error_rad = target_rad, target_rad - angle_rad
        following = not abs(self._error_rad) > self._following_rad  # also without a target
        explained = self.unexplained_j <= self._runaway_j and self.driven_back < NOT_YIELDED
        if not following or not explained or self.away_rad > AWAY_RAD or self._shaken >= SHAKEN:
            self._report(found, target)

    def _add(
        self,
        elapsed_s: float,
        step_rad: float,
        velocity_rad_s: float,
        target_rad: float,
        lead_rad_s: float,
        braked: bool,
    ) -> None:
        """Add a sample to the energy, and to the path away where the joint had a target and still has one.

        `lead_rad_s`: the target's velocity. A target that jumps, as where another path begins, does not lead.
        """
        before_rad_s = self._velocity_rad_s
        kinetic_j = self._half_inertia * (velocity_rad_s * velocity_rad_s - before_rad_s * before_rad_s)
        torque_nm = self._impulse_nm_s / elapsed_s
        target_step_rad = target_rad - self._target_rad
        reverses = torque_nm * self._pressing_nm < 0.0
        self._pressing_nm = torque_nm
        pulls = target_rad != target_rad and not braked
        if pulls:
            self._watch_rocking(elapsed_s, step_rad, torque_nm, reverses)
        else:
            self._rock_s = UNKNOWN
        resting = braked or target_step_rad == 0.0
        if torque_nm * self._turned_nm <= 0.0 and abs(torque_nm) >= self._shaking_nm:
            shakes = not pulls and self._stamp_s - self._turned_s < self._shaken_s
            self._shaken = self._shaken + 1 if shakes else 1
            self._turned_nm, self._turned_s = torque_nm, self._stamp_s
        weak = -PRESSING_NM < torque_nm < PRESSING_NM and self.driven_back < PROBED
        if braked or reverses or weak or self._rock_s < DRIVEN_BACK_S:
            self._pressed_s = self._back_rad = 0.0
            self.driven_back = self.driven_back if pulls else 0
        else:
            self._watch_pressing(elapsed_s, step_rad, torque_nm, lead_rad_s * elapsed_s)
        work_j = torque_nm * step_rad
        leak_s = RESTING_LEAK_S if resting else RUNAWAY_LEAK_S
        unexplained_j = (1.0 - elapsed_s / leak_s) * self.unexplained_j + kinetic_j - work_j
        self.unexplained_j = unexplained_j if unexplained_j > 0.0 else 0.0
        if self._punctual_s < SETTLING_S:
            self.away_rad = self._excursion_rad = self._excursion_before_rad = self._same_side_rad = 0.0
            return
        self._watch_error(1.0 - elapsed_s / AWAY_LEAK_S, step_rad, target_rad, target_step_rad)

    def _watch_error(self, kept: float, step_rad: float, target_rad: float, target_step_rad: float) -> None:
        """Add to the path away, of which a part is kept, and to the present excursion. Without a target it is zero."""
        error_rad = target_rad - (self._angle_rad + step_rad)
        lag_rad = abs(error_rad)
        turned_rad = abs(step_rad) - abs(target_step_rad) + lag_rad - abs(self._error_rad)
        away_rad = kept * self.away_rad + turned_rad
        self.away_rad = away_rad if away_rad > 0.0 else 0.0
        self._excursion_before_rad *= kept
        if error_rad * self._error_rad < 0.0:
            if self._excursion_rad < STABLE_FRACTION * self._same_side_rad:
                self.away_rad = min(self.away_rad, 2.0 * self._excursion_rad)
            self._same_side_rad, self._excursion_before_rad = self._excursion_before_rad, self._excursion_rad
            self._excursion_rad = 0.0
        if lag_rad > self._excursion_rad:
            self._excursion_rad = lag_rad

    def _watch_pressing(self, elapsed_s: float, step_rad: float, torque_nm: float, lead_rad: float) -> None:
        """Count the intervals in a row in which the joint moved against a torque that lasts, and its target did not."""
        back_rad, target_back_rad = (-step_rad, -lead_rad) if torque_nm > 0.0 else (step_rad, lead_rad)
        near_limit_nm = self._near_limit_nm - PROBE_NM if self.probed else self._near_limit_nm
        leads = target_back_rad > 0.0 and abs(torque_nm) < near_limit_nm
        self._pressed_s += elapsed_s
        self._back_rad += back_rad - target_back_rad if leads else back_rad
        if self._back_rad < -STEADY_RAD and self.driven_back < PROBED:  # the interval begins where the joint turns back
            self._pressed_s = self._back_rad = 0.0
            self.driven_back = 0
        elif self._pressed_s >= (DRIVEN_BACK_S if self.driven_back < PROBED else PROBE_S):
            self._end_interval()

    def _watch_rocking(self, elapsed_s: float, step_rad: float, torque_nm: float, reverses: bool) -> None:
        """Count as an interval what is between two reversals at which the joint is slow."""
        if reverses and abs(step_rad) < SLOW_RAD_S * elapsed_s and not self._rock_s < PROBE_S:
            if abs(self._rock_nm_s) > PRESSING_NM * self._rock_s:  # never at the first reversal
                self._pressed_s, self._back_rad = self._rock_s, -copysign(1.0, self._rock_nm_s) * self._rock_rad
                self._end_interval(1, ROCKED_FRACTION)
            self._rock_s = self._rock_rad = self._rock_nm_s = 0.0
        self._rock_s += elapsed_s
        self._rock_rad += step_rad
        self._rock_nm_s += torque_nm * elapsed_s

    def _end_interval(self, steady_from: int = PROBED, tolerance: float = 1.0) -> None:
        """Count an interval. From the probe on the speed must be as before, or the count begins again."""
        counts = self._back_rad > DRIVEN_BACK_RAD_S * self._pressed_s
        if self.driven_back >= steady_from:
            as_before_rad = self._back_rad_s * self._pressed_s
            most_rad = tolerance * (STEADY_RAD + STEADY_FRACTION * as_before_rad)
            counts = abs(self._back_rad - as_before_rad) <= most_rad
        self.driven_back = self.driven_back + 1 if counts else 0
        self._back_rad_s = self._back_rad / self._pressed_s
        self._pressed_s = self._back_rad = 0.0

    def _report(self, found: list[Fault], target: JointTarget | None) -> None:
        if self.unexplained_j > self._runaway_j:
            kind = FaultKind.JOINT_RUNAWAY
            found.append(kind.fault(self._joint, energy_j=self.unexplained_j, limit_j=self._runaway_j))
        if self.driven_back >= NOT_YIELDED:
            found.append(FaultKind.JOINT_DRIVEN_BACK.fault(self._joint))
        lasts = self._excursion_rad >= STABLE_FRACTION * self._excursion_before_rad
        shaken = self._shaken >= SHAKEN and self._stamp_s - self._turned_s < self._shaken_s
        if lasts and (self.away_rad > AWAY_RAD or shaken):
            found.append(FaultKind.JOINT_OSCILLATING.fault(self._joint, away_rad=self.away_rad))
        if target is None or self._punctual_s < SETTLING_S:
            return
        error_rad = abs(self._error_rad)
        most_rad = self._following_rad + FOLLOWING_S * abs(target.velocity_rad_s)
        if error_rad > most_rad:
            found.append(FaultKind.FOLLOWING_ERROR.fault(self._joint, error_rad=error_rad, limit_rad=most_rad))
