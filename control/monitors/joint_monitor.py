"""Detects the faults of one joint and its drive: silence, errors, positions, velocities, currents and temperatures.

`JointMonitor.update` runs every tick for each joint and returns all faults that it detects. It owns the durations that
a single sample cannot show. Bounds that depend on the machine are in FaultBounds, all others are constants here.
"""

from math import copysign, degrees, inf, isfinite, radians
from typing import NamedTuple

from control.faults import Fault, FaultKind
from control.limits import JointRange
from control.monitors.encoder_monitor import STEP_NM, EncoderMonitor
from control.monitors.motion_monitor import PROBE_NM, JointDynamics, MotionMonitor
from control.monitors.stillness import Stillness
from control.monitors.winding import Winding
from control.parameters.fault_bounds import FaultBounds
from control.parameters.joint_limits import JointLimits
from control.parameters.winding_parameters import WindingParameters
from control.rate import PERIOD_S
from control.records import NEVER_S, UNKNOWN, DriveState, JointTarget

MOST_SEEN_S = 0.03  # largest time that one tick adds to a duration: the joint was not observed during a longer gap
MISSING_HEARTBEATS = 5  # in a row
SLOW_SILENCE_S = 1.0  # of temperature and bus voltage, once they were reported
HEAT_S = 0.02  # between two checks of the heat
ENERGISED_S = 0.2  # two heartbeats, within which a drive may still report closed loop after a command to idle
FAST_FRACTION = 1.25  # of the velocity limit, above which the limits allow no driving torque
CURRENT_FRACTION = 1.25  # of the drive's current limit
CURRENT_TICKS = 3
STILL_RAD = 0.03
REST_S = 0.1  # within STILL_RAD: the joint is at rest
SATURATED_FRACTION = 0.95  # of the torque limit
STALLED_S = 2.0  # longer than an insertion, a stance or an extraction of the paper's gait takes
RETURNING_FRACTION = 0.3  # of the torque limit, on a joint at rest beyond its range
RETURNING_S = 0.3  # then: a motor that turns the wrong way presses against the stop there
MISSING_FRACTION = 0.3  # of the torque limit: difference between commanded and measured torque
MISSING_S = 0.1
TWO_MESSAGES_S = 0.15  # two messages at an interval of 0.1 s: a single outlier is no fault


class TickFacts(NamedTuple):
    """The state of the loop in one tick, which is the same for all joints."""

    now_s: float
    dt_s: float
    energised: bool  # torque is or may be on
    moving: bool  # closed loop is expected of the drives
    may_stand_still: bool  # at any torque: without stiffness, or in a recovery that pulls on purpose
    damping: bool = False


class JointMonitor:
    def __init__(
        self,
        joint: str,
        limits: JointLimits,
        span: JointRange,
        bounds: FaultBounds,
        winding: WindingParameters,
        current_limit_a: float,
        torque_constant_nm_a: float,
        heartbeat_period_s: float = 0.1,
        dynamics: JointDynamics = JointDynamics(),  # noqa: B008 - immutable
        answers_only: bool = False,
        fastest_rad_s: float = inf,
    ) -> None:
        """`answers_only`: the drive sends nothing unless it is asked, so it is not silent while no tick asks.

        `fastest_rad_s`: up to which the motor can give the commanded torque, and the drive reports its speed.
        """
        self.joint = joint
        self._answers_only = answers_only
        self.winding = Winding(winding)
        self._heat: Fault | None = None  # of the last check
        self._unchecked_s = HEAT_S  # since then
        self._limits = limits
        self._bounds = bounds
        self._span = span
        self._low_rad = span.min_rad - radians(limits.position_margin_deg)
        self._high_rad = span.max_rad + radians(limits.position_margin_deg)
        self._fast_rad_s = FAST_FRACTION * limits.velocity_rad_s
        self._fastest_rad_s = fastest_rad_s
        self._encoder = EncoderMonitor(joint, bounds.jump_rad, fastest_rad_s)
        self.motion = MotionMonitor(joint, dynamics, limits.torque_nm)
        self._stillness = Stillness(STILL_RAD)
        self._most_a = CURRENT_FRACTION * current_limit_a
        self._constant_nm_a = torque_constant_nm_a
        self._heartbeat_silence_s = MISSING_HEARTBEATS * heartbeat_period_s
        self._missing_nm = MISSING_FRACTION * limits.torque_nm
        self._returning_nm = RETURNING_FRACTION * limits.torque_nm
        self._saturated_nm = SATURATED_FRACTION * limits.torque_nm
        self._nearly_hot_c = (limits.temperature_warm_c + limits.temperature_hot_c) / 2.0  # half of the torque is left
        self.reset()

    def reset(self) -> None:
        """Clear all durations, but not the winding's temperature nor its fault."""
        self._current_ticks = 0
        self._fast_s = self._stalled_s = self._energised_s = self._missing_s = 0.0
        self._low_s = self._under_s = self._hot_s = 0.0
        self._unasked_s, self._answer_stamp_s = 0.0, NEVER_S
        self._encoder.reset()
        self.motion.reset()
        self._stillness.reset()
        self.probed = False  # its torque is that of `probe`

    def update(
        self, facts: TickFacts, state: DriveState, torque_nm: float, target: JointTarget | None = None
    ) -> list[Fault]:
        """Return all faults of a tick. Torque and target are those of the tick before; no target: no stiffness."""
        found: list[Fault] = []
        # One sample after a gap does not show the state during the gap.
        seen_s = facts.dt_s if facts.dt_s <= MOST_SEEN_S else MOST_SEEN_S
        self._watch_signals(found, facts, state)
        self._watch_drive(found, facts, seen_s, state)
        self._watch_range(found, seen_s, state)
        self._watch_motion(found, facts, seen_s, state, torque_nm, target)
        self._watch_load(found, facts, seen_s, state, torque_nm)
        self._watch_heat(found, facts, state, torque_nm)
        return found

    def update_load(self, facts: TickFacts, state: DriveState, torque_nm: float) -> list[Fault]:
        """Return the faults of a tick that mud causes where drive, encoder and wires cannot fail."""
        found: list[Fault] = []
        self._watch_range(found, facts.dt_s, state)
        self._watch_load(found, facts, facts.dt_s, state, torque_nm)
        self._watch_heat(found, facts, state, torque_nm)
        return found

    def probe(self, torque_nm: float, largest_nm: float) -> float:
        """Return the wanted torque, or that of a probe: without motion or its load, the joint has a fault."""
        limited_nm, sign = min(abs(torque_nm), largest_nm), copysign(1.0, torque_nm)
        if self._encoder.probed:
            return sign * max(limited_nm - STEP_NM, -largest_nm)
        return sign * max(limited_nm - PROBE_NM, 0.0) if self.motion.probed else torque_nm

    def _fault(self, kind: FaultKind, **values: float | str) -> Fault:
        return kind.fault(self.joint, **values)

    # signals

    def _watch_signals(self, found: list[Fault], facts: TickFacts, state: DriveState) -> None:
        bounds, now_s = self._bounds, facts.now_s
        if self._answers_only:
            now_s -= self._unasked(facts.dt_s, state.heartbeat_stamp_s)
        position_s, current_s = now_s - state.angle_stamp_s, now_s - state.current_stamp_s
        if position_s > bounds.late_s or current_s > bounds.late_s:
            found.append(self._late(position_s, current_s))
            if current_s > bounds.silence_s and found[-1].kind in (FaultKind.DRIVE_QUIET, FaultKind.POSITION_STALE):
                found.append(self._fault(FaultKind.CURRENT_SILENT, age_s=current_s))
        if now_s - state.heartbeat_stamp_s > self._heartbeat_silence_s:
            found.append(self._fault(FaultKind.HEARTBEAT_SILENT, age_s=now_s - state.heartbeat_stamp_s))
        if now_s - state.temperature_stamp_s > SLOW_SILENCE_S and isfinite(state.temperature_stamp_s):
            found.append(self._fault(FaultKind.TEMPERATURE_SILENT, age_s=now_s - state.temperature_stamp_s))
        if now_s - state.bus_voltage_stamp_s > SLOW_SILENCE_S and isfinite(state.bus_voltage_stamp_s):
            found.append(self._fault(FaultKind.VOLTAGE_SILENT, age_s=now_s - state.bus_voltage_stamp_s))

    def _unasked(self, dt_s: float, answer_stamp_s: float) -> float:
        """Return for how long of the time since the drive's newest answer the loop has missed its ticks.

        The answer to the last question before a gap is read after it, as old as the gap.
        """
        missed_s = dt_s - PERIOD_S if dt_s > PERIOD_S else 0.0
        self._unasked_s = missed_s + (self._unasked_s if answer_stamp_s == self._answer_stamp_s else 0.0)
        self._answer_stamp_s = answer_stamp_s
        return self._unasked_s

    def _late(self, position_s: float, current_s: float) -> Fault:
        """Return the most severe fault of two ages: both signals silent, one of them, or a late frame."""
        bounds = self._bounds
        both_s = min(position_s, current_s)
        if both_s > bounds.silence_s:
            return self._fault(FaultKind.DRIVE_SILENT, age_s=both_s)
        if position_s > bounds.silence_s:
            return self._fault(FaultKind.POSITION_SILENT, age_s=position_s)
        if both_s > bounds.quiet_s:
            return self._fault(FaultKind.DRIVE_QUIET, age_s=both_s)
        if position_s > bounds.quiet_s:
            return self._fault(FaultKind.POSITION_STALE, age_s=position_s)
        if current_s > bounds.silence_s:
            return self._fault(FaultKind.CURRENT_SILENT, age_s=current_s)
        if current_s > bounds.quiet_s:
            return self._fault(FaultKind.CURRENT_STALE, age_s=current_s)
        signal = "position" if position_s > current_s else "current"
        return self._fault(FaultKind.DRIVE_LATE, signal=signal, age_s=max(position_s, current_s))

    # the drive's own state

    def _watch_drive(self, found: list[Fault], facts: TickFacts, seen_s: float, state: DriveState) -> None:
        if state.error_flags:
            found.append(self._fault(FaultKind.DRIVE_ERROR, flags=f"0x{state.error_flags:x}"))
        if facts.moving and not state.closed_loop:
            found.append(self._fault(FaultKind.DRIVE_DISARMED))
        if facts.energised or not state.closed_loop:
            self._energised_s = 0.0
        else:
            self._energised_s += seen_s
            if self._energised_s > ENERGISED_S:
                found.append(self._fault(FaultKind.DRIVE_ENERGISED, activity="in closed loop"))
        if state.bus_voltage_v < self._bounds.voltage_low_v or self._low_s:
            self._watch_voltage(found, seen_s, state.bus_voltage_v)

    def _watch_voltage(self, found: list[Fault], seen_s: float, voltage_v: float) -> None:
        bounds = self._bounds
        self._low_s = self._low_s + seen_s if voltage_v < bounds.voltage_low_v else 0.0
        self._under_s = self._under_s + seen_s if voltage_v < bounds.voltage_min_v else 0.0
        if self._under_s > TWO_MESSAGES_S:
            found.append(self._fault(FaultKind.VOLTAGE_UNDER, voltage_v=voltage_v, least_v=bounds.voltage_min_v))
        elif self._low_s > TWO_MESSAGES_S:
            found.append(self._fault(FaultKind.VOLTAGE_LOW, voltage_v=voltage_v))

    # motion

    def _watch_range(self, found: list[Fault], seen_s: float, state: DriveState) -> None:
        angle_rad, velocity_rad_s = state.angle_rad, abs(state.velocity_rad_s)
        if not self._low_rad <= angle_rad <= self._high_rad:
            found.append(self._out_of_range(angle_rad, self._low_rad, self._high_rad))
        elif self._stalled_s > RETURNING_S and not self._span.min_rad <= angle_rad <= self._span.max_rad:
            found.append(self._out_of_range(angle_rad, *self._span))
        if velocity_rad_s > self._fast_rad_s:
            self._fast_s += seen_s
            if self._fast_s > self._bounds.fast_s - seen_s / 2.0:
                limit_rad_s = self._limits.velocity_rad_s
                kind = FaultKind.JOINT_VELOCITY
                found.append(self._fault(kind, velocity_rad_s=velocity_rad_s, limit_rad_s=limit_rad_s))
        else:
            self._fast_s = 0.0
        if not self._stillness.update(angle_rad, seen_s):
            self._stalled_s = 0.0

    def _watch_motion(
        self,
        found: list[Fault],
        facts: TickFacts,
        seen_s: float,
        state: DriveState,
        torque_nm: float,
        target: JointTarget | None,
    ) -> None:
        if not facts.energised:
            self._encoder.release()
            if self._stillness.still_s < REST_S:
                found.append(self._fault(FaultKind.JOINT_MOVING))
        encoder_fault = self._encoder.update(state, seen_s, torque_nm)
        if encoder_fault:
            found.append(encoder_fault)
        if encoder_fault or not facts.moving:
            self.motion.reset()
        else:
            self.motion.update(found, state, seen_s, torque_nm, target, facts.damping)
        self.probed = self._encoder.probed or self.motion.probed

    def _out_of_range(self, angle_rad: float, low_rad: float, high_rad: float) -> Fault:
        low_deg, high_deg = degrees(low_rad), degrees(high_rad)
        return self._fault(FaultKind.JOINT_POSITION, angle_deg=degrees(angle_rad), low_deg=low_deg, high_deg=high_deg)

    # load

    def _watch_load(
        self, found: list[Fault], facts: TickFacts, seen_s: float, state: DriveState, torque_nm: float
    ) -> None:
        current_a = state.current_a
        if abs(current_a) > self._most_a:
            self._current_ticks += 1
            if self._current_ticks >= CURRENT_TICKS:
                found.append(self._fault(FaultKind.JOINT_CURRENT, current_a=abs(current_a), limit_a=self._most_a))
        else:
            self._current_ticks = 0
        measured_nm = current_a * self._constant_nm_a
        differs = abs(torque_nm - measured_nm) > self._missing_nm
        if differs and facts.moving and not abs(state.velocity_rad_s) > self._fastest_rad_s:
            self._missing_s += seen_s
            if self._missing_s > MISSING_S:  # a frozen current, lost commands, a silent clamp
                kinds = [FaultKind.TORQUE_MISSING] + facts.damping * [FaultKind.DAMPING_FAILED]
                found += [self._fault(kind, measured_nm=measured_nm, commanded_nm=torque_nm) for kind in kinds]
        else:
            self._missing_s = 0.0
        pushing_nm = abs(torque_nm)
        if (
            pushing_nm >= self._returning_nm > 0.0
            and not facts.may_stand_still
            and (pushing_nm >= self._saturated_nm or not self._span.min_rad <= state.angle_rad <= self._span.max_rad)
        ):
            self._stalled_s += seen_s
            if self._stalled_s > STALLED_S:
                found.append(self._fault(FaultKind.JOINT_NOT_FOLLOWING, stalled_s=self._stalled_s))
        else:
            self._stalled_s = 0.0

    # heat

    def _watch_heat(self, found: list[Fault], facts: TickFacts, state: DriveState, torque_nm: float) -> None:
        """Add what the last check of the heat found; heat changes slowly, so it is checked every HEAT_S."""
        self._unchecked_s += facts.dt_s
        if self._unchecked_s > HEAT_S:
            self._heat = self._check_heat(facts, state, torque_nm)
            self._unchecked_s = 0.0
        if self._heat:
            found.append(self._heat)

    def _check_heat(self, facts: TickFacts, state: DriveState, torque_nm: float) -> Fault | None:
        measured_c = state.temperature_c
        if measured_c >= self._nearly_hot_c:
            self._hot_s += min(self._unchecked_s, MOST_SEEN_S)
            if self._hot_s <= TWO_MESSAGES_S:
                measured_c = UNKNOWN
        else:
            self._hot_s = 0.0
        current_a = state.current_a if abs(state.current_a) < 2.0 * self._most_a else UNKNOWN  # more is no measurement
        if facts.now_s - state.current_stamp_s > self._bounds.silence_s:  # an old current does not heat for ever
            current_a = torque_nm / self._constant_nm_a
        winding_c = self.winding.update(self._unchecked_s, current_a, measured_c)
        if winding_c < self._nearly_hot_c:
            return None
        hot = winding_c >= self._limits.temperature_hot_c
        by_sensor = measured_c >= (self._limits.temperature_hot_c if hot else self._nearly_hot_c)
        if by_sensor:
            kind = FaultKind.MOTOR_HOT if hot else FaultKind.MOTOR_OVERHEATING
        else:
            kind = FaultKind.WINDING_HOT if hot else FaultKind.WINDING_OVERHEATING
        return self._fault(kind, temperature_c=measured_c if by_sensor else winding_c)
