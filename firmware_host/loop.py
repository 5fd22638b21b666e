"""One tick of the robot, from the bus to the bus.

`Loop.tick` is the whole control path and reads in the order in which it happens; the same object runs in the daemon,
in simulation and in tests, on whatever ports it is given. It owns the mode, the faults that stand and the last command.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from control.controller import ALL_TRUSTED, RESTING, Controller, WalkOrder
from control.depth.gait_choice import quickest
from control.fault_latch import FaultLatch
from control.faults import Fault, Reaction
from control.gait.recovery import Recovery
from control.limits import LimitedTorques, apply_limits
from control.modes import ENERGISED, MOVING, Health, Mode, Request, next_mode, refusal
from control.records import (
    NEVER_S,
    NO_TORQUE,
    BodyPose,
    DriveState,
    DriveStates,
    GaitTarget,
    Joints,
    Torques,
    same_for_all,
)
from drivers.drive import Drives
from drivers.pose.pose_port import PoseSource
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_monitor import FaultMonitor, MonitorInput
from firmware_host.log.recorder import Recording
from firmware_host.log.row_packing import TickRecord, stride_row, tick_row
from firmware_host.log.rows import STRIDE_KIND, TICK_KIND
from firmware_host.loop_events import LoopEvents, ModeChange
from firmware_host.loop_timing import LoopTiming
from firmware_host.mud_learning import MudLearning
from firmware_host.operator.fault_texts import fault_message
from firmware_host.operator.lease import Lease
from firmware_host.operator.refusal_texts import refusal_text
from firmware_host.ticker import PERIOD_S, Tick

CLEARING_S = 0.5  # for the drives to report that their errors are gone
LONGEST_STEP_TICKS = 3  # what the controller may advance at once: after a longer gap the gait goes on where it was


class Loop:
    def __init__(
        self,
        configuration: Configuration,
        drives: Drives,
        pose: PoseSource,
        recorder: Recording,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        self.configuration = configuration
        self.drives = drives
        self.pose = pose
        self.recorder = recorder
        self.lease = Lease()
        self.events = LoopEvents(recorder, configuration.motion.longest_hold_s)
        self.timing = LoopTiming()
        self.learning = MudLearning(configuration)
        self.controller = controller_of(configuration)
        self.faults = FaultLatch()
        self._fault_monitor = FaultMonitor(configuration, drives)
        self._clock, self._wall_clock = clock, wall_clock
        self._ranges = configuration.joint_ranges
        self.mode = Mode.BOOT
        self.states: DriveStates = same_for_all(DriveState())
        self.body = BodyPose()
        self.sent = LimitedTorques(NO_TORQUE, False, True)
        self.health = Health()
        self.missed_ticks = 0  # since the start
        self.ending = False  # the daemon is about to end: nothing is armed any more
        self.forced = False  # armed against what may be overruled
        self.target_before: GaitTarget = RESTING  # commanded while the states of this tick came about
        self._request, self._clear_until_s = Request.NONE, NEVER_S
        self._mode_since_s = 0.0

    def tick(self, tick: Tick) -> None:
        """Everything that happens once in PERIOD_S."""
        self.missed_ticks += tick.missed
        self.target_before = self.controller.target
        self.states = self.drives.read(tick.now_s)
        self.body = self.pose.read(tick.now_s)
        self.learning.update(tick.now_s, self.target_before.phase, self.states, self.body)
        self._adapt(tick.now_s)
        self.health = self._examine(tick)
        self._change_mode(next_mode(self.mode, self._request_now(), self.health), tick.now_s)
        self.forced = self.forced and self.mode in ENERGISED
        if self.controller.moving and self.health.reaction >= Reaction.HOLD:
            self._end_move(tick.now_s, fault_message(self.fault) if self.fault else "a fault is present.")
        step_s = min(1 + tick.missed, LONGEST_STEP_TICKS) * PERIOD_S
        elapsed_s = (1 + tick.missed) * PERIOD_S
        wanted = self.controller.step(step_s, self.mode, self.states, self._trusted(), elapsed_s)
        self.sent = self._limit(wanted)
        self._command(tick.now_s)
        self._record(tick)

    @property
    def fault(self) -> Fault | None:
        """The worst that stands and is more than a warning."""
        return self.faults.worst if self.faults.reaction >= Reaction.HOLD else None

    @property
    def temperatures_c(self) -> tuple[float, ...]:
        """Of the motors, measured or reckoned."""
        return tuple(joint.winding.temperature_c for joint in self._fault_monitor.joints)

    def _adapt(self, now_s: float) -> None:
        """Once a stride, in swing, the gait changes; and where an insertion meets firm mud."""
        closed, messages = self.learning.step(self.controller)
        for message in messages:
            self.events.report(now_s, message)
        for stride in closed:
            self.recorder.put(STRIDE_KIND, stride_row(now_s, stride.estimate, stride.chosen_depth_m))

    def _examine(self, tick: Tick) -> Health:
        """Faults as data, and what else the mode depends on."""
        present = self._fault_monitor.update(tick, self._monitor_input(tick.now_s)) + self.learning.faults
        if self.controller.fault:
            present.append(self.controller.fault)
        clearing = tick.now_s <= self._clear_until_s
        self.faults.update(present, self.mode in ENERGISED, clearing, 1 + tick.missed)
        self.events.tell_faults(tick.now_s, self.faults.begun, self.faults.over)
        return Health(
            drives_heard=self.mode is not Mode.BOOT or self.drives.heard,
            closed_loop=self._all_in_closed_loop(),
            walk_finished=self.controller.walk_finished,
            raised=self.controller.raised,
            settled=self.controller.settled,
            cut_short=self.controller.cut_short,
            rested=self.controller.rested,
            worst=self.faults.worst,
            blocking=tuple(self.faults.blocking(self.forced)),
        )

    def _monitor_input(self, now_s: float) -> MonitorInput:
        lost_by = str(self.lease.holder) if self.lease.lost(now_s) else ""
        if lost_by and self.mode not in ENERGISED:  # nothing is left to attend to
            self.events.report(now_s, f"lease of {lost_by} is over")
            self.lease.reset()
            if self._request is not Request.ARM:  # which must not come true for somebody who is gone
                lost_by = ""
        return MonitorInput(
            self.mode,
            self._mode_since_s,
            self.states,
            self.body,
            self.sent,
            self.controller.recovery.attempt > 0,
            self._wall_clock() - self._clock(),
            self.recorder.report(),
            lost_by,
        )

    def _all_in_closed_loop(self) -> bool:
        """By heartbeats that are younger than the wish, while arming: an older one tells of before."""
        oldest_s = self._mode_since_s if self.mode is Mode.ARMING else NEVER_S
        return all(state.closed_loop and state.heartbeat_stamp_s > oldest_s for state in self.states)

    def request(
        self, request: Request, now_s: float, order: WalkOrder | None = None, forced: bool = False, by: str = ""
    ) -> str | None:
        """A person's wish, for the next tick. Returns why it is refused, or None."""
        refused = self._refusal(request, order, forced)
        if refused:
            return refused
        self._tell_request(request, now_s, forced, by)
        if request is Request.STOP and self.controller.moving:
            self._end_move(now_s, f"stop was asked for{f' by {by}' if by else ''}.")
        if request is Request.DISARM and self.mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)  # also while not all drives are heard
        elif request is Request.CLEAR:
            self.drives.clear_errors()
            self._clear_until_s = now_s + CLEARING_S
        elif request is Request.ARM:
            self._force(now_s, forced)
        if order is not None:
            self.controller.order = order
        if self._request is not Request.DISARM:  # which nothing may undo
            self._request = request
        return None

    def _tell_request(self, request: Request, now_s: float, forced: bool, by: str) -> None:
        """A stop or disarm that changes nothing is not told: whoever is let in may ask for those."""
        changes = request not in (Request.STOP, Request.DISARM) or self._next(request) is not self._next(Request.NONE)
        self.events.tell_request(now_s, request, forced, by, changes)

    def _next(self, request: Request) -> Mode:
        return next_mode(self.mode, request, self.health)

    def _force(self, now_s: float, forced: bool) -> None:
        overruled = self.faults.blocking() if forced else []
        self.events.tell_overruled(now_s, overruled)
        self.forced = bool(overruled)

    def _refusal(self, request: Request, order: WalkOrder | None, forced: bool) -> str | None:
        if self.ending and request in (Request.ARM, Request.WALK):
            return "the daemon is ending"
        if order is not None and not self._reaches(order.depth_m):
            return f"depth {order.depth_m:g} m: out of the flippers' reach over the sweep"
        health = self.health._replace(blocking=tuple(self.faults.blocking(forced)))
        refused = refusal(self.mode, request, health)
        return refusal_text(refused) if refused else None

    def _reaches(self, depth_m: float) -> bool:
        return 0.0 < depth_m <= self.configuration.geometry.deepest_m(self.configuration.gait.sweep_angle_deg)

    def _request_now(self) -> Request:
        """The request to act on in this tick."""
        request, self._request = self._request, Request.NONE
        refused = self.ending and request in (Request.ARM, Request.WALK)
        return Request.NONE if refused else request

    def _end_move(self, now_s: float, why: str) -> None:
        """In hold as in a walk: a fault that asks for a still pose has it, and so has whoever asks to stop."""
        if self.mode is Mode.HOLD:
            self.controller.end_move()
            self.events.tell_end_of_move(now_s, why)

    def _change_mode(self, mode: Mode, now_s: float) -> None:
        if mode is self.mode:
            return
        change = ModeChange(self.mode, mode, self.fault, self.health.rested, self.controller.is_up(self.states))
        self.events.tell_change(now_s, change)
        if mode is Mode.WALKING:
            self.learning.reset(self.controller.order.depth_m)
        if mode is Mode.ARMING:
            self._clear_until_s = NEVER_S  # what begins from here on was not meant
            self.drives.arm(now_s, at_once=True)
        elif self.mode in ENERGISED and mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)
        self.mode, self._mode_since_s = mode, now_s

    def _trusted(self) -> Joints[bool]:
        return self._fault_monitor.trusted if self.mode is Mode.DAMPING else ALL_TRUSTED

    def _limit(self, wanted: Torques) -> LimitedTorques:
        """One tick's slew, however long the last gap was."""
        if self.mode not in MOVING:
            return LimitedTorques(NO_TORQUE, False, True)
        states = self._fault_monitor.with_winding_heat(self.states)
        return apply_limits(wanted, self.sent.torques_nm, states, self.configuration.limits, self._ranges, PERIOD_S)

    def _command(self, now_s: float) -> None:
        """Before all drives are heard, those in closed loop are told to go idle, and nothing else is sent.

        Idle ones get zero torque, which feeds their watchdogs.
        """
        if self.mode is Mode.ARMING:
            self.drives.arm(now_s)
        elif self.mode not in ENERGISED:
            self.drives.disarm(now_s)
        if self.mode is Mode.BOOT:
            return
        if self.mode is Mode.IDLE:
            self.drives.request_settings(now_s)
        self.drives.send(self.sent.torques_nm, PERIOD_S)

    def _record(self, tick: Tick) -> None:
        tick_s = self._clock() - tick.now_s
        record = TickRecord(
            tick,
            tick_s,
            self.missed_ticks,
            self.mode,
            self.target_before,
            self.controller.gait.commanded_depth_m,
            self.states,
            self.learning.reading,
            self.body,
            self.sent,
        )
        self.recorder.put(TICK_KIND, tick_row(record))
        if self.controller.recovery.events:
            self.events.report(tick.now_s, self.controller.recovery.events)
        self.timing.update(tick.now_s, tick.late_s, tick.missed, tick_s)


def controller_of(configuration: Configuration) -> Controller:
    recovery = Recovery(
        configuration.recovery,
        configuration.geometry,
        quickest(configuration.adaptation, configuration.geometry, configuration.gait),
        configuration.joint_ranges,
    )
    return Controller(
        configuration.gait,
        configuration.geometry,
        configuration.gains,
        configuration.arm,
        configuration.motion,
        recovery,
    )
