"""The control loop: one tick of the robot, from the bus to the bus.

`Loop.tick` is the whole control path and reads in the order in which it happens. The estimates at a stride's ends are
computed after the command, a bounded unit a tick (mud_learning.py). The same object runs in the daemon, in simulation
and in tests, with the drives, the pose source and the recorder that it is given. It owns the mode, the present faults
and the last command. Its parts are public for the daemon, for fault injection and for the reports to operators.
"""

import time
from collections.abc import Callable, Mapping

from control.controller import RESTING, Controller, WalkOrder
from control.depth.gait_choice import quickest
from control.fault_causes import AgedFault, group_by_cause
from control.fault_latch import FaultLatch
from control.faults import OVERRULED_BY_FORCE, Fault, Reaction
from control.gait.recovery import Recovery
from control.limits import LimitedTorques, apply_limits
from control.modes import ENERGISED, MOVING, Health, Mode, Request, next_mode, refusal
from control.parameters.gait_parameters import GaitParameters
from control.rate import PERIOD_S
from control.records import NEVER_S, BodyPose, DriveState, DriveStates, GaitTarget, Torques, same_for_all
from drivers.drives import Drives
from drivers.pose.pose_port import PoseSource
from drivers.power_switch import PowerSwitch
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_monitor import FaultMonitor, MonitorInput
from firmware_host.lease import Lease
from firmware_host.log.recorder import NullRecorder, Recording
from firmware_host.log.rows import TICK_KIND, tick_kind, tick_row
from firmware_host.loop_events import LoopEvents
from firmware_host.loop_timing import LoopTiming
from firmware_host.mud_learning import MudLearning
from firmware_host.ticker import Tick

CLEARING_S = 0.5  # for the drives to report that their errors are gone
LONGEST_STEP_TICKS = 3  # the longest step of the controller: after a longer gap the gait continues where it was


class Loop:
    def __init__(
        self,
        configuration: Configuration,
        drives: Drives,
        pose: PoseSource,
        recorder: Recording | None,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], float] = time.time,
        period_s: float = PERIOD_S,
        power_switch: PowerSwitch | None = None,
    ) -> None:
        """`recorder`: None where no program reads the rows, so that none is made."""
        self.period_s = period_s
        self.configuration = configuration
        self.drives = drives
        self.pose = pose
        self.power_switch = power_switch
        self.recorder: Recording = recorder or NullRecorder()
        self._makes_rows = recorder is not None
        self.lease = Lease()
        self.events = LoopEvents(self.recorder, configuration.motion.longest_hold_s, configuration.bus_of)
        self.timing = LoopTiming()
        self.learning = MudLearning(configuration)
        self.controller = _make_controller(configuration)
        self.fault_monitor = FaultMonitor(configuration, drives, period_s)
        self.faults = FaultLatch(period_s)
        self.mode = Mode.BOOT
        self.states: DriveStates = same_for_all(DriveState(), configuration.rig)
        self.body = BodyPose()
        self.target: GaitTarget = RESTING  # commanded while the states of this tick were measured
        no_torque: Torques = same_for_all(0.0, configuration.rig)
        self.nothing_sent = LimitedTorques(torques_nm=no_torque, limited=False, finite=True)
        self.sent = self.nothing_sent
        self.health = Health()
        self.missed_ticks = 0  # since the start
        self.ending = False  # the daemon is about to end: nothing is armed any more
        self.forced = ""  # the kinds of faults against which the robot was armed by force, with commas
        self.pending_request = Request.NONE  # for the next tick
        self._clearing_until_s = NEVER_S
        self._mode_since_s = 0.0
        self._clock, self._wall_clock = clock, wall_clock
        self._joint_ranges = configuration.joint_ranges
        self._tick_kind = tick_kind(configuration.rig)

    def tick(self, tick: Tick) -> None:
        """Read the drives, choose the mode, control the joints, send the torques, learn from the mud, and record."""
        now_s = tick.now_s
        self.missed_ticks += tick.missed
        self.target = self.controller.target
        self.states = self.drives.read(now_s)
        self.body = self.pose.read(now_s)
        self.learning.update(now_s, self.target.phase, self.states, self.body)
        self.learning.adapt(self.controller)
        self.health = self._examine(tick, self._end_lost_lease(now_s))
        self._enter(self._next_mode(now_s), now_s)
        if self.forced and self.mode not in ENERGISED:
            self.forced = ""
        if self.fault and self.controller.moving:
            self._end_move(now_s, self.fault.message)
        self.sent = self._limit(self._control(tick.missed))
        self._command(now_s)
        sent_after_s = self._clock() - now_s
        self.events.report_learning(now_s, self.learning.step(self.controller, LONGEST_STEP_TICKS * self.period_s))
        self._record(tick, sent_after_s)

    @property
    def fault(self) -> Fault | None:
        """Return the worst present fault that is more than a warning."""
        return self.faults.worst if self.faults.reaction >= Reaction.HOLD else None

    @property
    def aged_faults(self) -> list[AgedFault]:
        """Return every present fault with the time since it was first detected."""
        return [AgedFault(fault, self.faults.age_ticks(fault) * self.period_s) for fault in self.faults.present]

    @property
    def stride_depth_m(self) -> float:
        """Return the commanded depth of this stride."""
        return self.controller.gait.commanded_depth_m

    def _end_lost_lease(self, now_s: float) -> str:
        """Return the name of the program that lost the lease, if this is a fault; with torque off it just ends."""
        self.lease.update(now_s)
        if not self.lease.lost(now_s):
            return ""
        holder = str(self.lease.holder)
        if self.mode in ENERGISED:
            return holder
        self.events.report(now_s, f"lease of {holder} is over")
        self.lease.reset()
        arms = self.pending_request is Request.ARM  # the lost program may have sent it: the fault prevents it
        return holder if arms else ""

    def _examine(self, tick: Tick, lost_lease_holder: str) -> Health:
        """Detect and latch faults, and collect the facts that the mode depends on."""
        was_cut = self.fault_monitor.power_cut
        present = self.fault_monitor.update(tick, self._monitor_input(tick, lost_lease_holder))
        present += self.learning.pop_faults()
        if was_cut and not self.fault_monitor.power_cut:
            self.events.report(tick.now_s, "the motors' power is back")
        if self.controller.fault:
            present.append(self.controller.fault)
        clearing = tick.now_s <= self._clearing_until_s
        self.faults.update(present, self.mode in ENERGISED, clearing, 1 + tick.missed)
        if self.faults.begun and any(fault.kind.latches_idle for fault in self.faults.begun):
            self._clearing_until_s = NEVER_S  # the request to clear came before them
        self.events.report_faults(tick.now_s, self.faults.begun, self.faults.over)
        return Health(  # by position, twice as fast: it is built in every tick
            self.mode is not Mode.BOOT or self.drives.heard,
            self.mode is Mode.ARMING and self._all_in_closed_loop(),
            self.controller.walk_finished,
            self.controller.raised,
            self.controller.settled,
            self.controller.cut_short,
            self.controller.rested,
            self.faults.worst,
            tuple(self.faults.blocking(self.forced)),
        )

    def _monitor_input(self, tick: Tick, lost_lease_holder: str) -> MonitorInput:
        return MonitorInput(  # by position, as above
            self.mode,
            self._mode_since_s,
            self.states,
            self.body,
            self.sent,
            self.controller.recovery.attempt > 0,
            self._wall_clock() - self._clock(),
            self.recorder.report(),
            lost_lease_holder,
            self.power_switch.update(tick.now_s) if self.power_switch else "",
            self.controller.followed_targets,
            self.target.phase,
            self.target.stride,
        )

    def _all_in_closed_loop(self) -> bool:
        """Return whether all drives report closed loop, in heartbeats that are newer than the request to arm."""
        asked_s = self._mode_since_s
        return all(state.closed_loop and state.heartbeat_stamp_s > asked_s for state in self.states)

    def _next_mode(self, now_s: float) -> Mode:
        """Return the mode of this tick. A request was accepted before it, so a fault of this tick may prevent it."""
        request = self._pop_request()
        mode = next_mode(self.mode, request, self.health)
        if request is not Request.NONE and mode is self.mode and (prevented := refusal(mode, request, self.health)):
            self.events.report_prevented(now_s, request, prevented.text)
        return mode

    def _pop_request(self) -> Request:
        """Return the request to act on in this tick; none arms or walks while the daemon ends."""
        request, self.pending_request = self.pending_request, Request.NONE
        refused = self.ending and request in (Request.ARM, Request.WALK)
        return Request.NONE if refused else request

    def _enter(self, mode: Mode, now_s: float) -> None:
        """Change to this mode, if it is another one: log it, and arm or disarm the drives."""
        if mode is self.mode:
            return
        flippers_up = self.controller.is_up(self.states)
        self.events.report_mode_change(now_s, self.mode, mode, self.fault, self.health.rested, flippers_up)
        if mode is Mode.WALKING:
            self.events.report_learning(now_s, self.learning.finish())
            order = self.controller.order
            self.learning.reset(order.depth_m, order.gait if order.adaptive else None)
        if mode is Mode.ARMING:
            self._clearing_until_s = NEVER_S  # a request to clear does not apply to faults from here on
            self.drives.arm(now_s, at_once=True)
        elif self.mode in ENERGISED and mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)
        self.mode, self._mode_since_s = mode, now_s

    def _end_move(self, now_s: float, reason: str) -> None:
        """End a move in hold: the joints stay where they are. Any other mode has ended it already."""
        if self.mode is Mode.HOLD:
            self.controller.end_move()
            self.events.report_end_of_move(now_s, reason)

    def _control(self, missed_ticks: int) -> Torques:
        elapsed_s = (1 + missed_ticks) * self.period_s
        step_s = min(1 + missed_ticks, LONGEST_STEP_TICKS) * self.period_s if missed_ticks else elapsed_s
        trusted = self.fault_monitor.trusted if self.mode is Mode.DAMPING else None
        return self.controller.step(step_s, self.mode, self.states, trusted, elapsed_s, self.sent.torques_nm)

    def _limit(self, wanted: Torques) -> LimitedTorques:
        """Limit the torques; their slew to that of one tick, even after missed ticks."""
        if self.mode not in MOVING:
            return self.nothing_sent
        present, limits = self.controller.present or self.states, self.configuration.limits
        states = self.fault_monitor.with_winding_heat(present)
        wanted = self.fault_monitor.with_probes(wanted, limits.torque_nm)
        return apply_limits(wanted, self.sent.torques_nm, states, limits, self._joint_ranges, self.period_s)

    def _command(self, now_s: float) -> None:
        """Send the axis states that the mode needs, then the torques.

        Idle drives get zero torque, which feeds their watchdogs. In BOOT only disarming and requests are sent. Nothing
        is sent if this process stood still within the tick: watchdogs that do not latch would let old torques pass.
        """
        if self._clock() - now_s > self.configuration.faults.silence_s:
            self.sent = self.nothing_sent
            self.drives.gate.forget_torques()  # the next ones count from zero there too
            return
        if self.mode is Mode.ARMING:
            self.drives.arm(now_s)
        elif self.mode not in ENERGISED:
            self.drives.disarm(now_s)
        if self.mode is Mode.BOOT:
            self.drives.poll()
            return
        if self.mode is Mode.IDLE:
            self.drives.request_settings(now_s)
        self.drives.send(self.sent.torques_nm, self.period_s)
        self.drives.request_supply()

    def _record(self, tick: Tick, sent_after_s: float) -> None:
        tick_s = self._clock() - tick.now_s
        if self._makes_rows:
            self.recorder.put(TICK_KIND, self._row(tick, sent_after_s))
        if self.controller.recovery.events:
            self.events.report(tick.now_s, self.controller.recovery.events)
        self.timing.update(tick.now_s, tick.late_s, tick.missed, tick_s)

    def _row(self, tick: Tick, sent_after_s: float) -> bytes:
        return tick_row(
            self._tick_kind,
            tick,
            sent_after_s,
            states=self.states,
            sent=self.sent,
            loads=self.learning.loads,
            target=self.target,
            stride_depth_m=self.stride_depth_m,
            body=self.body,
            missed_ticks=self.missed_ticks,
            mode=self.mode,
            power_cut=self.fault_monitor.power_cut != "",
        )

    def request(
        self, request: Request, now_s: float, order: WalkOrder | None = None, forced: str = "", by: str = ""
    ) -> str | None:
        """Accept an operator's request for the next tick, or return why it is refused."""
        refused = self._refusal(request, order, forced)
        if refused:
            return refused
        if request in (Request.ARM, Request.WALK):
            self.events.forget_notice()
        changed = next_mode(self.mode, request, self.health) is not next_mode(self.mode, Request.NONE, self.health)
        changes = changed or request not in (Request.STOP, Request.DISARM)  # every user may send those at any time
        self.events.report_request(now_s, request, forced, by, changes)
        if request is Request.STOP and self.controller.moving:
            self._end_move(now_s, f"stop was requested{f' by {by}' if by else ''}.")
        if request is Request.DISARM and self.mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)  # also while not all drives are heard
        elif request is Request.CLEAR:
            self.drives.clear_errors()
            self._clearing_until_s = now_s + CLEARING_S
        elif request is Request.ARM:
            overruled = [fault for fault in self.faults.blocking() if fault.name in forced.split(",")]
            self.events.report_overruled(now_s, overruled)
            self.forced = forced if overruled else ""
        if order is not None:
            self.controller.order = order
        if self.pending_request is not Request.DISARM:  # no later request replaces it
            self.pending_request = request
        return None

    def change_strides(self, depth_m: float, gait: GaitParameters | None, now_s: float, by: str) -> None:
        """Fix depth and gait of the present walk, also of one that adapted; a stride that has begun keeps its own."""
        sweep = f", sweep {gait.sweep_angle_deg:g} degrees" if gait else ""
        self.events.report(now_s, f"depth {depth_m:.4f} m{sweep} by {by}")
        if gait:
            self.controller.gait.next_parameters = gait
        self.controller.order = self.controller.order._replace(depth_m=depth_m, adaptive=False, depths_m=())
        self.controller.gait.next_depth_m = depth_m
        self.learning.depth_reason = "fixed"

    def move(self, angles_rad: Mapping[str, float], speed_rad_s: float, now_s: float, by: str) -> None:
        """Move joints slowly to these angles, while the pose is held."""
        path = ", ".join(f"{joint} to {angle_rad:.4f} rad" for joint, angle_rad in angles_rad.items())
        self.events.report_move(now_s, path, by)
        self.controller.move([angles_rad.get(joint) for joint in self.configuration.rig.joints], speed_rad_s)

    def _refusal(self, request: Request, order: WalkOrder | None, forced: str) -> str | None:
        if request in (Request.ARM, Request.WALK) and (self.ending or self.pending_request is Request.DISARM):
            return (
                "the daemon is ending" if self.ending else "a disarm was requested just before; 'mudskipper arm' first"
            )
        if forced and not set(forced.split(",")) <= set(OVERRULED_BY_FORCE):
            return f"force = {forced!r}: must be one of {', '.join(OVERRULED_BY_FORCE)}"
        gait = (order and order.gait) or self.configuration.gait
        parameters = gait if isinstance(gait, GaitParameters) else self.configuration.gait
        deepest_m = self.configuration.geometry.deepest_m(parameters.sweep_angle_deg)
        for depth_m in () if order is None else order.depths_m or (order.depth_m,):
            if not 0.0 < depth_m <= deepest_m:
                return f"depth {100.0 * depth_m:g} cm: out of the flippers' reach over the sweep"
        health = self.health._replace(blocking=self._blocking_causes(forced))
        refused = refusal(self.mode, request, health)
        return refused.text if refused else None

    def _blocking_causes(self, forced: str) -> tuple[Fault, ...]:
        """Return the faults that prevent arming, without those that follow from another of them."""
        blocking = self.faults.blocking(forced)
        aged = [each for each in self.aged_faults if each.fault in blocking]
        causes = group_by_cause(aged, self.configuration.bus_of)
        return tuple(each.fault for cause in causes for each in cause.faults)


def _make_controller(configuration: Configuration) -> Controller:
    recovery = Recovery(
        configuration.recovery,
        configuration.geometry,
        quickest(configuration.adaptation, configuration.geometry, configuration.gait),
        configuration.joint_ranges,
        configuration.rig,
    )
    return Controller(
        configuration.gait,
        configuration.geometry,
        configuration.gains,
        configuration.arm,
        configuration.motion,
        recovery,
        configuration.rig,
        [configuration.drive[joint].answers_only for joint in configuration.rig.joints],
    )
