"""One tick of the robot, from the bus to the bus.

`Loop.tick` is the whole control path and reads in the order in which it happens; the same object runs in the daemon,
in simulation and in tests, on whatever ports it is given. It owns the mode, the latched fault and the last command.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from control.controller import RESTING, Controller, WalkOrder
from control.faults import Fault
from control.gait_adaptation import quickest
from control.limits import LimitedTorques, apply_limits
from control.modes import ACCEPTED_IN, ENERGISED, MOVING, Health, Mode, Request, next_mode, refusal
from control.records import (
    NEVER_S,
    NO_TORQUE,
    BodyPose,
    DriveState,
    DriveStates,
    GaitTarget,
    Phase,
    StrideEstimate,
    Torques,
)
from control.recovery import Recovery
from drivers.odrive_drives import OdriveDrives
from drivers.pose_port import PoseSource
from estimation.mud import MudEstimator, MudReading
from firmware_host.adaptation_methods import adaptation_of, choice_text
from firmware_host.configuration import Configuration
from firmware_host.fault_watch import FaultWatch
from firmware_host.log_rows import EVENT, ROW_KINDS, STRIDE, TICK
from firmware_host.recorder import Recording
from firmware_host.row_packing import Moment, stride_row, tick_row
from firmware_host.ticker import PERIOD_S, Beat
from firmware_host.timing import LoopTiming

FIRM_TICKS = 3  # of a load that ends an insertion
CLEARING_S = 0.5  # for the drives to report that their errors are gone
LONGEST_STEP_TICKS = 3  # what the controller may advance at once: after a longer gap the gait goes on where it was
KEPT_STRIDES = 200  # for clients that ask what happened
TICK_KIND, STRIDE_KIND, EVENT_KIND = ROW_KINDS.index(TICK), ROW_KINDS.index(STRIDE), ROW_KINDS.index(EVENT)


class ClosedStride(NamedTuple):
    """A stride of one flipper with the depth that was chosen from it."""

    number: int  # counts all of both flippers since the start
    estimate: StrideEstimate
    chosen_depth_m: float


class Loop:
    def __init__(
        self,
        configuration: Configuration,
        drives: OdriveDrives,
        pose: PoseSource,
        recorder: Recording,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.configuration = configuration
        self.drives = drives
        self.pose = pose
        self.recorder = recorder
        self.timing = LoopTiming()
        self.estimator = MudEstimator(
            configuration.geometry,
            configuration.flipper_drives,
            configuration.estimation,
            configuration.adaptation.body_drag_n,
        )
        self.adaptation = adaptation_of(configuration)
        self.controller = Controller(
            configuration.gait,
            configuration.geometry,
            configuration.gains,
            configuration.arm,
            configuration.motion,
            Recovery(
                configuration.recovery,
                configuration.geometry,
                quickest(configuration.adaptation, configuration.geometry, configuration.gait),
                configuration.joint_ranges,
            ),
        )
        self._clock = clock
        self._ranges = configuration.joint_ranges
        self.mode = Mode.BOOT
        self.fault: Fault | None = None
        self.states: DriveStates = (DriveState(), DriveState(), DriveState(), DriveState())
        self.reading = MudReading()
        self.body = BodyPose()
        self.sent = LimitedTorques(NO_TORQUE, False, True)
        self.strides: list[ClosedStride] = []
        self.strides_closed = 0
        self.health = Health()
        self.missed_ticks = 0  # since the start
        self.notice = ""  # the last thing that a person should know and that is no fault
        self.ending = False  # the daemon is about to end: nothing is armed any more
        self.target_before: GaitTarget = RESTING  # commanded while the states of this tick came about
        self._request, self._clear_until_s = Request.NONE, NEVER_S
        self._mode_since_s = 0.0
        self._firm_ticks = 0
        self._fault_watch = FaultWatch(configuration, drives)

    def tick(self, beat: Beat) -> None:
        """Everything that happens once in PERIOD_S."""
        self.missed_ticks += beat.missed
        self.target_before = self.controller.target
        self.states = self.drives.read(beat.now_s)
        self.body = self.pose.read(beat.now_s)
        self.reading = self._estimate(beat.now_s)
        self._adapt(beat.now_s)
        self._heed_insertion(beat.now_s)
        self.health = self._examine(beat)
        self._change_mode(next_mode(self.mode, self._request_now(beat.now_s), self.health), beat.now_s)
        step_s = min(1 + beat.missed, LONGEST_STEP_TICKS) * PERIOD_S
        wanted = self.controller.step(step_s, self.mode, self.states)
        self.sent = self._limit(wanted)
        self._command(beat.now_s)
        self._record(beat)

    def _estimate(self, now_s: float) -> MudReading:
        """Feed the estimator with the phase that the measured motion was commanded in, as the log records it."""
        a, b, c, d = self.states
        angles_rad = (a.angle_rad, b.angle_rad, c.angle_rad, d.angle_rad)
        velocities_rad_s = (a.velocity_rad_s, b.velocity_rad_s, c.velocity_rad_s, d.velocity_rad_s)
        currents_a = (a.current_a, b.current_a, c.current_a, d.current_a)
        return self.estimator.update(
            now_s,
            self.target_before.phase,
            angles_rad,
            velocities_rad_s,
            currents_a,
            self.body.x_m,
            (now_s - a.angle_stamp_s, now_s - b.angle_stamp_s, now_s - c.angle_stamp_s, now_s - d.angle_stamp_s),
            (
                now_s - a.current_stamp_s,
                now_s - b.current_stamp_s,
                now_s - c.current_stamp_s,
                now_s - d.current_stamp_s,
            ),
        )

    def _adapt(self, now_s: float) -> None:
        """Once a stride, in swing: choose the depth of the next one."""
        if not self.reading.strides:
            return
        if self.estimator.belief.boundary:
            self.event(now_s, "another mud")
        gait, depth_m = self.controller.gait, self.controller.order.depth_m
        if self.controller.order.adaptive:
            choice = self.adaptation.step(self.estimator.belief, self.reading.strides, gait.commanded_depth_m)
            depth_m, parameters = choice.depth_m, choice.gait or gait.parameters
            if (depth_m, parameters) != (gait.next_depth_m, gait.next_parameters):
                self.event(now_s, choice_text(choice))
            gait.next_parameters = parameters
        gait.next_depth_m = depth_m
        for estimate in self.reading.strides:
            self.strides.append(ClosedStride(self.strides_closed, estimate, depth_m))
            self.strides_closed += 1
            self.recorder.put(STRIDE_KIND, stride_row(now_s, estimate, depth_m))
        del self.strides[:-KEPT_STRIDES]

    def _heed_insertion(self, now_s: float) -> None:
        """Where a depth is chosen: mud that might hold a flipper is entered no deeper. One odd sample says nothing."""
        order, gait, reading = self.controller.order, self.controller.gait, self.reading
        limit_nm = self.adaptation.largest_insertion_nm
        firm = reading.left.adduction_torque_nm > limit_nm or reading.right.adduction_torque_nm > limit_nm
        inserting = order.adaptive and self.controller.target.phase is Phase.INSERTION
        self._firm_ticks = self._firm_ticks + 1 if firm and inserting else 0
        if self._firm_ticks >= FIRM_TICKS and gait.end_insertion():
            self.event(now_s, f"insertion ended at {gait.commanded_depth_m:.4f} m: firm mud")

    def _examine(self, beat: Beat) -> Health:
        heard = self.mode is not Mode.BOOT or self.drives.heard
        fault = None
        if heard:
            fault = self._fault_watch.update(beat, self.mode, self._mode_since_s, self.states, self.sent)
            fault = fault or self.controller.fault
        return Health(
            drives_heard=heard,
            closed_loop=self._all_in_closed_loop(),
            walk_finished=self.controller.walk_finished,
            raised=self.controller.raised,
            fault=fault,
        )

    def _all_in_closed_loop(self) -> bool:
        """By heartbeats that are younger than the wish, while arming: an older one tells of before."""
        oldest_s = self._mode_since_s if self.mode is Mode.ARMING else NEVER_S
        return all(state.closed_loop and state.heartbeat_stamp_s > oldest_s for state in self.states)

    def request(self, request: Request, now_s: float, order: WalkOrder | None = None) -> str | None:
        """A person's wish, for the next tick. Returns why it is refused, or None."""
        refused = self._refusal(request, order)
        if refused:
            return refused
        self.event(now_s, f"request {request.name.lower()}")
        if request is Request.DISARM and self.mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)  # also while not all drives are heard
        elif request is Request.CLEAR:
            self.drives.clear_errors()
            self._clear_until_s = now_s + CLEARING_S
        if order is not None:
            self.controller.order = order
        if request is not Request.CLEAR and self._request is not Request.DISARM:  # which nothing may undo
            self._request = request
        return None

    def _refusal(self, request: Request, order: WalkOrder | None) -> str | None:
        if self.ending and request in (Request.ARM, Request.WALK):
            return "the daemon is ending"
        if order is not None and not self._reaches(order.depth_m):
            return f"depth {order.depth_m:g} m: out of the flippers' reach over the sweep"
        if request is Request.CLEAR and self.mode in ACCEPTED_IN[request]:
            return None  # whether the cause persists is known once the drives have answered
        return refusal(self.mode, request, self.health)

    def _reaches(self, depth_m: float) -> bool:
        return 0.0 < depth_m <= self.configuration.geometry.deepest_m(self.configuration.gait.sweep_angle_deg)

    def _request_now(self, now_s: float) -> Request:
        """The request to act on in this tick. A clear lasts until the drives had time to report no errors."""
        request, self._request = self._request, Request.NONE
        if self.ending and request in (Request.ARM, Request.WALK):
            request = Request.NONE
        if request is Request.NONE and now_s <= self._clear_until_s:
            return Request.CLEAR
        return request

    def _change_mode(self, mode: Mode, now_s: float) -> None:
        if mode is self.mode:
            return
        if mode is Mode.FAULT:
            self.fault = self.health.fault
        elif mode is Mode.IDLE:
            self.fault = None
        if mode in (Mode.ARMING, Mode.WALKING):
            self.notice = ""
        if mode is Mode.WALKING:
            self.estimator.reset()
            self.adaptation.reset(self.controller.order.depth_m)
        if self.mode is Mode.STOPPING and mode is Mode.HOLD and not self.controller.is_up(self.states):
            self._tell(now_s, "the flippers did not come out of the mud")
        because = f": {self.fault.sentence}" if self.fault else ""
        self.event(now_s, f"mode {self.mode.name.lower()} to {mode.name.lower()}{because}")
        if mode is Mode.ARMING:
            self.drives.arm(now_s, at_once=True)
        elif self.mode in ENERGISED and mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)
        self.mode, self._mode_since_s = mode, now_s

    def _limit(self, wanted: Torques) -> LimitedTorques:
        """One tick's slew, however long the last gap was."""
        if self.mode not in MOVING:
            return LimitedTorques(NO_TORQUE, False, True)
        return apply_limits(
            wanted, self.sent.torques_nm, self.states, self.configuration.limits, self._ranges, PERIOD_S
        )

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
            self.drives.request_versions(now_s)
        self.drives.send(self.sent.torques_nm)

    def _record(self, beat: Beat) -> None:
        tick_s = self._clock() - beat.now_s
        moment = Moment(
            beat,
            tick_s,
            self.missed_ticks,
            self.mode,
            self.target_before,
            self.controller.gait.commanded_depth_m,
            self.states,
            self.reading,
            self.body,
            self.sent,
        )
        self.recorder.put(TICK_KIND, tick_row(moment))
        if self.controller.recovery.news:
            self.event(beat.now_s, self.controller.recovery.news)
        self.timing.update(beat.now_s, beat.late_s, beat.missed, tick_s)

    def _tell(self, now_s: float, notice: str) -> None:
        self.notice = notice
        self.event(now_s, notice)

    def event(self, now_s: float, text: str) -> None:
        """A sentence into the log."""
        self.recorder.put(EVENT_KIND, EVENT.encode(now_s, text))
