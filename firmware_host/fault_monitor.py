"""Detects the faults of one tick: of joints and drives, buses, loop, pose and log.

It only detects. The latch decides how long a fault is present, and the modes decide how the robot reacts.
"""

from math import isnan
from typing import NamedTuple

from control.faults import Fault, FaultKind
from control.gait.recovery import is_in_mud
from control.joint_friction import NO_FRICTION
from control.limits import LimitedTorques
from control.modes import ENERGISED, HELD, MOVING, Mode
from control.monitors.joint_monitor import JointMonitor, TickFacts
from control.monitors.torque_gain_monitor import FlipperStrokes, TorqueGainMonitor, WatchedJoint
from control.monitors.zero_monitor import ZeroMonitor
from control.rate import PERIOD_S
from control.records import (
    NEVER_S,
    BodyPose,
    DriveStates,
    Joints,
    JointTarget,
    JointTargets,
    Phase,
    Torques,
    same_for_all,
)
from drivers.can.port_health import BusState
from drivers.drive import DriveHealth
from drivers.drives import Drives
from firmware_host.bus_monitor import BusMonitor
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import LogReport
from firmware_host.loop_monitor import LogMonitor, LoopMonitor
from firmware_host.ticker import Tick

LATE_S = 0.1  # beyond it, a computer without real time: a simulated robot next to other programs
PUNCTUAL_FRACTION = 0.5  # of a period: a tick that is later gives its torque a much longer or shorter time
STALL_S = 0.02  # of this program, in which a drive that answers only when asked was silent
CUT_S = 0.1  # of the silence of all drives, which began within this time: the motors' power is cut
ARMING_S = 2.0  # the longest time that a drive may take to go into closed loop
POSE_FORGOTTEN_S = 10.0  # a pose source that is silent for longer counts as switched off on purpose
BROKEN = frozenset(
    {FaultKind.ENCODER_JUMP, FaultKind.ENCODER_STUCK}
)  # detected in single ticks, but lasting until torque is off
NO_STRIDE = -9
CATCH_UP_S = 0.3  # a sweep that the mud held at the far end of a stance needs 0.15 s for its 1 rad
IN_MUD = frozenset({Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.PAUSE, Phase.RECOVERY, Phase.STROKE})
BLIND = frozenset({FaultKind.POSITION_STALE, FaultKind.POSITION_SILENT, FaultKind.DRIVE_QUIET, FaultKind.DRIVE_SILENT})
EXPLAINED = frozenset({FaultKind.DRIVE_ERROR, FaultKind.DRIVE_DISARMED})  # by the drive's own error text


class MonitorInput(NamedTuple):
    """The state of the loop in one tick, before the mode changes."""

    mode: Mode
    mode_since_s: float
    states: DriveStates
    body: BodyPose
    sent: LimitedTorques  # in the tick before
    freeing: bool  # a recovery pulls a stuck flipper at full torque
    wall_minus_monotonic_s: float
    log: LogReport
    lost_lease_holder: str  # the program that has lost the lease; empty: none
    power_cut: str = ""  # why the motors' power counts as cut, by its input; empty: it does not
    targets: JointTargets | None = None  # of the joints in the tick before; None without stiffness
    phase: Phase = Phase.REST  # of the gait in the tick before
    stride: int = -1  # of the walk in the tick before


class FaultMonitor:
    """Owns the monitors of joints, loop and log, and the last counts, whose increase is a fault."""

    def __init__(self, configuration: Configuration, drives: Drives, period_s: float = PERIOD_S) -> None:
        self._period_s = period_s
        self._drives = drives
        self._rig = configuration.rig
        joints = configuration.rig.joints
        self._no_targets: Joints[JointTarget | None] = same_for_all(None, configuration.rig)
        self._all_trusted = same_for_all(True, configuration.rig)
        self.joints = _joint_monitors(configuration)
        self._geometry = configuration.geometry
        self._gains = _gain_monitor(configuration)
        self.zeros = tuple(ZeroMonitor(joint, configuration.faults.jump_rad) for joint in joints)
        self._loop = LoopMonitor(configuration.faults, period_s)
        self._log = LogMonitor(configuration.faults)
        uncalibrated = ", ".join(joint for joint in joints if not configuration.drive[joint].calibrated.date)
        self._uncalibrated = [FaultKind.UNCALIBRATED.fault(joints=uncalibrated)] if uncalibrated else []
        self._longest_watchdog_s = configuration.faults.longest_watchdog_s
        self._warm_c = configuration.limits.temperature_warm_c
        self._buses = [BusMonitor(name, port) for name, port in drives.ports.items()]
        self._restarts = {health.joint: health.restarts for health in drives.health}
        self._foreign_commands = {health.joint: health.foreign_commands for health in drives.health}
        self._refused_commands = drives.refused_commands
        self._held_back_s = dict.fromkeys(joints, NEVER_S)  # by the mud
        # when the walk began, and its last two strides in which a joint lagged in its swing
        self._lagging_strides = dict.fromkeys(joints, (NEVER_S, NO_STRIDE, NO_STRIDE))
        self._sound: dict[str, DriveHealth | None] = dict.fromkeys(joints)  # the last report in which nothing was wrong
        self._pose_stamp_s: float | None = None
        self._asks_drives = configuration.emergency_stop.source == "drives"
        self.power_cut = ""  # why the motors' power counts as cut in this tick
        self._broken: set[str] = set()  # joints with an invalid encoder, until torque is off
        self.trusted: Joints[bool] = self._all_trusted  # of the joints' encoders

    def with_winding_heat(self, states: DriveStates) -> DriveStates:
        """Return the states with the estimated winding temperatures, if one is warm enough to matter for the limits."""
        warm_c = self._warm_c
        for joint, state in zip(self.joints, states, strict=True):
            if state.temperature_c > warm_c or not joint.winding.temperature_c <= warm_c:
                break
        else:
            return states
        return Joints(
            *(
                state._replace(temperature_c=joint.winding.temperature_c)
                for joint, state in zip(self.joints, states, strict=True)
            )
        )

    def with_probes(self, wanted: Torques, largest_nm: float) -> Torques:
        """Return the wanted torques; with a step for each joint that is probed."""
        for joint in self.joints:
            if joint.probed:
                break
        else:
            return wanted
        return Joints(*(joint.probe(nm, largest_nm) for joint, nm in zip(self.joints, wanted, strict=True)))

    def update(self, tick: Tick, monitor_input: MonitorInput) -> list[Fault]:
        """Return all faults of this tick."""
        found = self._loop.update(tick, monitor_input.wall_minus_monotonic_s)
        found += self._log.update(monitor_input.log)
        for bus in self._buses:
            bus.update(found, tick.now_s)
        self.power_cut = monitor_input.power_cut
        if self.power_cut:
            found.append(FaultKind.POWER_CUT.fault(reason=self.power_cut))
        if monitor_input.lost_lease_holder:
            found.append(FaultKind.LEASE_LOST.fault(holder=monitor_input.lost_lease_holder))
        if monitor_input.mode is Mode.BOOT and not self._drives.heard:
            return found
        health = self._drives.health
        self._check_joints(found, tick, monitor_input, health)
        if not self.power_cut and (found or self._asks_drives):
            self._check_power(found, health)
        sent_nm = monitor_input.sent.torques_nm
        punctual = tick.late_s < PUNCTUAL_FRACTION * self._period_s
        self._gains.update(found, punctual, monitor_input.states, sent_nm, monitor_input.phase)
        self._check_trust(found, monitor_input.mode)
        if not monitor_input.sent.finite:
            found.append(FaultKind.TORQUE_NOT_FINITE.fault())
        if monitor_input.mode is Mode.ARMING and tick.now_s - monitor_input.mode_since_s > ARMING_S:
            self._check_arming(found, monitor_input.states)
        if self._drives.refused_commands > self._refused_commands:
            self._refused_commands = self._drives.refused_commands
            found.append(FaultKind.COMMAND_REFUSED.fault(reason=self._drives.last_refusal))
        self._check_drives(found, health, monitor_input.mode)
        found += self._uncalibrated
        self._check_pose(found, tick.now_s, monitor_input.body)
        return found

    def _check_power(self, found: list[Fault], drives: Joints[DriveHealth]) -> None:
        """Find a cut of the motors' power: a drive reports it, or all drives of all buses fall silent at once."""
        if self._asks_drives:
            cut = [health for health in drives if health.power_cut]
            self.power_cut = f"the {cut[0].joint} drive reports {cut[0].active_errors}" if cut else ""
        silent_s = [float(dict(each.values)["age_s"]) for each in found if each.kind is FaultKind.DRIVE_SILENT]
        at_once = len(silent_s) == len(self.joints) and CUT_S < max(silent_s) < min(silent_s) + CUT_S
        if at_once and all(port.state is not BusState.OFF for port in self._drives.ports.values()):
            self.power_cut = "all drives fell silent at once"
        if self.power_cut:
            found.insert(0, FaultKind.POWER_CUT.fault(reason=self.power_cut))  # the first of one reaction is shown

    def _check_joints(
        self, found: list[Fault], tick: Tick, monitor_input: MonitorInput, drives: Joints[DriveHealth]
    ) -> None:
        followed = None if monitor_input.freeing else monitor_input.targets  # those of a pull lead
        targets = followed or self._no_targets
        facts = self._facts(tick, monitor_input)
        stalled = tick.missed * self._period_s > STALL_S
        for joint, zero, health, state, torque_nm, target in zip(
            self.joints,
            self.zeros,
            drives,
            monitor_input.states,
            monitor_input.sent.torques_nm,
            targets,
            strict=True,
        ):
            if stalled and health.restarts == self._restarts[health.joint]:
                zero.skip_gap(tick.now_s)
            shifted = zero.update(state)
            if shifted:
                found.append(shifted)
            for fault in joint.update(facts, state, torque_nm, target):
                if fault.kind is FaultKind.FOLLOWING_ERROR and self._is_held_back(fault.subject, tick, monitor_input):
                    continue
                explained = fault.kind in EXPLAINED and health.errors
                found.append(fault.with_values(reason=health.errors) if explained else fault)

    def _facts(self, tick: Tick, monitor_input: MonitorInput) -> TickFacts:
        mode = monitor_input.mode
        return TickFacts(  # by position: it is built in every tick
            tick.now_s,
            (1 + tick.missed) * self._period_s,
            mode in ENERGISED,
            mode in MOVING,
            monitor_input.freeing or mode not in HELD,
            mode is Mode.DAMPING,
        )

    def _is_held_back(self, joint: str, tick: Tick, monitor_input: MonitorInput) -> bool:
        """Return whether mud may hold a joint that lags behind, or held it until CATCH_UP_S ago.

        A body that sinks swings its flippers through the mud, so in a walk one swing is no proof, but two in a row are.
        """
        if not self._moves_in_air(joint, monitor_input):
            self._held_back_s[joint] = tick.now_s
        if tick.now_s - self._held_back_s[joint] < CATCH_UP_S:
            return True
        since_s, before, last = self._lagging_strides[joint]
        if monitor_input.mode_since_s != since_s:
            last = NO_STRIDE
        if monitor_input.stride != last:
            before, last = last, monitor_input.stride
        self._lagging_strides[joint] = monitor_input.mode_since_s, before, last
        return monitor_input.stride >= 0 and before != last - 1

    def _moves_in_air(self, joint: str, monitor_input: MonitorInput) -> bool:
        """Return whether no mud may hold a joint back: by the phase of the gait, and by the flipper's own angles."""
        sweep, adduction = monitor_input.states[self._rig.joints_of(joint.split("_")[0])]
        in_mud = is_in_mud(self._geometry, sweep.angle_rad, adduction.angle_rad)
        return not in_mud and monitor_input.phase not in IN_MUD

    def _check_trust(self, found: list[Fault], mode: Mode) -> None:
        """Update the trust in the encoders: a broken one stays untrusted, a silent one only while it is silent."""
        if mode not in ENERGISED:
            self._broken.clear()
        if not (found or self._broken):
            self.trusted = self._all_trusted
            return
        self._broken.update(fault.subject for fault in found if fault.kind in BROKEN)
        blind = self._broken.union(fault.subject for fault in found if fault.kind in BLIND)
        self.trusted = Joints(*(joint not in blind for joint in self._rig.joints)) if blind else self._all_trusted

    def _check_arming(self, found: list[Fault], states: DriveStates) -> None:
        idle = (joint for joint, state in zip(self._rig.joints, states, strict=True) if not state.closed_loop)
        found += [FaultKind.ARMING_FAILED.fault(joint, longest_s=ARMING_S) for joint in idle]

    def _check_drives(self, found: list[Fault], drives: Joints[DriveHealth], mode: Mode) -> None:
        """Check the drives' reports about themselves. A report in which nothing was wrong is not read again."""
        for health in drives:
            if health is not self._sound[health.joint]:
                before = len(found)
                self._check_drive(found, health)
                self._sound[health.joint] = health if len(found) == before else None
            if health.busy_state and mode not in ENERGISED:
                found.append(FaultKind.DRIVE_ENERGISED.fault(health.joint, activity=f"in {health.busy_state}"))

    def _check_drive(self, found: list[Fault], health: DriveHealth) -> None:
        """Check what a drive reports about itself."""
        joint = health.joint
        if health.restarts != self._restarts[joint]:
            self._restarts[joint] = health.restarts
            found.append(FaultKind.DRIVE_RESTARTED.fault(joint))
        if health.duplicate_id:
            found.append(FaultKind.DUPLICATE_NODE_ID.fault(joint))
        self._check_obedience(found, health)
        if health.serial_number != health.expected_serial_number and health.expected_serial_number:
            serial, expected = health.serial_number or "unknown", health.expected_serial_number
            found.append(FaultKind.WRONG_DRIVE.fault(joint, serial=serial, expected=expected))
        if not health.firmware_supported:
            version = health.firmware or "unknown"
            found.append(FaultKind.DRIVE_VERSION.fault(joint, version=version, supported=health.supported_firmware))
        if health.setting_problem:
            found.append(FaultKind.DRIVE_SETTINGS.fault(joint, reason=health.setting_problem))
        self._check_watchdog(found, joint, health.watchdog_s)

    def _check_obedience(self, found: list[Fault], health: DriveHealth) -> None:
        """Check that the drive follows this program's commands only."""
        commands = health.foreign_commands - self._foreign_commands[health.joint]
        if commands:
            self._foreign_commands[health.joint] = health.foreign_commands
            found.append(FaultKind.FOREIGN_COMMANDS.fault(health.joint, commands=commands))
        if health.setpoint_problem:
            found.append(FaultKind.SETPOINT_MISMATCH.fault(health.joint, reason=health.setpoint_problem))

    def _check_watchdog(self, found: list[Fault], joint: str, watchdog_s: float) -> None:
        """Check the drive's watchdog, the only protection if this program dies."""
        if isnan(watchdog_s):
            found.append(FaultKind.WATCHDOG_UNKNOWN.fault(joint))
        elif not 0.0 < watchdog_s <= self._longest_watchdog_s:
            setting = f"set to {watchdog_s:g} s" if watchdog_s else "off"
            found.append(FaultKind.WATCHDOG_OFF.fault(joint, setting=setting, longest_s=self._longest_watchdog_s))

    def _check_pose(self, found: list[Fault], now_s: float, body: BodyPose) -> None:
        if body.stamp_s > NEVER_S:
            self._pose_stamp_s = now_s
        elif self._pose_stamp_s is not None:
            found.append(FaultKind.POSE_LOST.fault())
            if now_s - self._pose_stamp_s > POSE_FORGOTTEN_S:
                self._pose_stamp_s = None


def _joint_monitors(configuration: Configuration) -> tuple[JointMonitor, ...]:
    ranges, dynamics, drives = configuration.joint_ranges, configuration.joint_dynamics, configuration.drive
    return tuple(
        JointMonitor(
            joint,
            configuration.limits,
            joint_range,
            configuration.faults,
            configuration.winding,
            drives[joint].current_limit_a,
            drives[joint].torque_constant_nm_a,
            drives[joint].heartbeat_period_s,
            own_dynamics,
            drives[joint].answers_only,
            drives[joint].fastest_rad_s,
        )
        for joint, joint_range, own_dynamics in zip(configuration.rig.joints, ranges, dynamics, strict=True)
    )


def _gain_monitor(configuration: Configuration) -> TorqueGainMonitor:
    if configuration.faults.late_s > LATE_S:
        return TorqueGainMonitor([])  # late commands have other accelerations
    rig, drives, frictions = configuration.rig, configuration.drive, configuration.friction
    flippers = []
    for flipper in rig.flippers:
        own = rig.joints_of(flipper)
        joints = [
            WatchedJoint(
                name=joint,
                friction=frictions.get(joint, NO_FRICTION),
                answers_only=drives[joint].answers_only,
                fastest_rad_s=drives[joint].fastest_rad_s,
                torque_step_nm=drives[joint].torque_step_nm,
            )
            for joint in rig.joints[own]
        ]
        flippers.append(FlipperStrokes(own.start, joints, configuration.geometry, configuration.arm))
    return TorqueGainMonitor(flippers)
