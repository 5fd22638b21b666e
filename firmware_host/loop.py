"""One tick of the robot, from the bus to the bus.

`Loop.tick` is the whole control path and reads in the order in which it happens; the same object runs in the daemon,
in simulation and in tests, on whatever ports it is given. It owns the mode, the latched fault and the last command.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from control.adaptation import DepthAdaptation
from control.controller import RESTING, Controller, WalkOrder
from control.faults import Fault, find_fault
from control.limits import LimitedTorques, apply_limits
from control.modes import ENERGISED, MOVING, Health, Mode, Request, next_mode, refusal
from control.records import (
    JOINTS,
    NO_TORQUE,
    BodyPose,
    DriveState,
    DriveStates,
    GaitTarget,
    StrideEstimate,
    Torques,
)
from drivers.odrive_codec import error_text
from drivers.odrive_drives import OdriveDrives
from drivers.pose_port import PosePort
from estimation.mud import MudEstimator, MudReading
from firmware_host.configuration import Configuration
from firmware_host.log_rows import EVENT, ROW_KINDS, STRIDE, TICK
from firmware_host.recorder import Recording
from firmware_host.ticker import PERIOD_S, Beat
from firmware_host.timing import LoopTiming

ARMING_S = 2.0  # a drive that takes longer to go into closed loop does not mean to
CLEARING_S = 0.5  # for the drives to report that their errors are gone
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
        pose: PosePort,
        recorder: Recording,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.configuration = configuration
        self.drives = drives
        self.pose = pose
        self.recorder = recorder
        self.timing = LoopTiming()
        self.estimator = MudEstimator(
            configuration.geometry, configuration.arm, configuration.torque_constants_nm_a
        )
        self.adaptation = DepthAdaptation(configuration.adaptation, configuration.geometry, configuration.gait)
        self.controller = Controller(
            configuration.gait,
            configuration.geometry,
            configuration.gains,
            configuration.arm,
            configuration.motion,
        )
        self._clock = clock
        self._ranges = configuration.joint_ranges
        self.reset()

    def reset(self) -> None:
        """As after the start: nothing is armed, nothing is known."""
        self.mode = Mode.BOOT
        self.fault: Fault | None = None
        self.states: DriveStates = (DriveState(), DriveState(), DriveState(), DriveState())
        self.reading = MudReading()
        self.body = BodyPose()
        self.sent = LimitedTorques(NO_TORQUE, False, True)
        self.strides: list[ClosedStride] = []
        self.strides_closed = 0
        self.health = Health()
        self._request, self._request_until_s = Request.NONE, 0.0
        self._mode_since_s = 0.0
        self.target: GaitTarget = RESTING
        self.estimator.reset()
        self.controller.reset()

    def tick(self, beat: Beat) -> None:
        """Everything that happens once in PERIOD_S."""
        dt_s = (1 + beat.missed) * PERIOD_S
        self.target = self.controller.target  # what was commanded while the states below came about
        self.states = self.drives.read(beat.now_s)
        self.body = self.pose.read(beat.now_s)
        self.reading = self._estimate(beat.now_s)
        self._adapt(beat.now_s)
        self.health = self._examine(beat.now_s)
        self._change_mode(next_mode(self.mode, self._request_now(beat.now_s), self.health), beat.now_s)
        wanted = self.controller.step(dt_s, self.mode, self.states)
        self.sent = self._limit(wanted, dt_s)
        self._command(beat.now_s)
        self._record(beat)

    def _estimate(self, now_s: float) -> MudReading:
        """Feed the estimator with the phase that the measured motion was commanded in, as the log records it."""
        a, b, c, d = self.states
        angles_rad = (a.angle_rad, b.angle_rad, c.angle_rad, d.angle_rad)
        velocities_rad_s = (a.velocity_rad_s, b.velocity_rad_s, c.velocity_rad_s, d.velocity_rad_s)
        currents_a = (a.current_a, b.current_a, c.current_a, d.current_a)
        return self.estimator.update(
            now_s, self.target.phase, angles_rad, velocities_rad_s, currents_a, self.body.x_m
        )

    def _adapt(self, now_s: float) -> None:
        """Once a stride, in swing: choose the depth of the next one."""
        if not self.reading.strides:
            return
        depth_m = self.controller.order.depth_m
        if self.controller.order.adaptive:
            depth_m = self.adaptation.step(self.reading.strides).depth_m
        self.controller.gait.next_depth_m = depth_m
        for estimate in self.reading.strides:
            self.strides.append(ClosedStride(self.strides_closed, estimate, depth_m))
            self.strides_closed += 1
            self.recorder.put(STRIDE_KIND, stride_row(now_s, estimate, depth_m))
        del self.strides[:-KEPT_STRIDES]

    def _examine(self, now_s: float) -> Health:
        heard = self.mode is not Mode.BOOT or self.drives.heard
        return Health(
            drives_heard=heard,
            closed_loop=all(state.closed_loop for state in self.states),
            walk_finished=self.controller.walk_finished,
            raised=self.controller.raised,
            fault=self._find_fault(now_s) if heard else None,
        )

    def _find_fault(self, now_s: float) -> Fault | None:
        if not self.sent.finite:
            return Fault("not_finite", "A torque was not a finite number: this is a bug, please report it.")
        if self.mode is Mode.ARMING and now_s - self._mode_since_s > ARMING_S:
            return Fault("arming", f"Not every drive went into closed loop: {self._slow_to_arm()}.")
        limits, silence_s = self.configuration.limits, self.configuration.loop.silence_s
        fault = find_fault(self.states, self._ranges, limits, silence_s, self.mode in MOVING, now_s)
        if fault and fault.name in ("drive_error", "drive_disarmed"):
            return fault._replace(sentence=f"{fault.sentence} {self._drives_say()}".rstrip())
        return fault or self._wrong_version()

    def _slow_to_arm(self) -> str:
        return ", ".join(joint for joint, state in zip(JOINTS, self.states, strict=True) if not state.closed_loop)

    def _drives_say(self) -> str:
        said = [
            f"{axis.joint}: {error_text(axis.state.error_flags | axis.disarm_reason)}"
            for axis in self.drives.axes
            if axis.state.error_flags | axis.disarm_reason
        ]
        return f"({'; '.join(said)})" if said else ""

    def _wrong_version(self) -> Fault | None:
        """Asked for once every drive was heard; messages mean other things in other firmware."""
        for axis in self.drives.axes:
            if axis.version is None:
                return Fault("drive_version", f"The {axis.joint} drive did not tell its firmware version yet.")
            if (axis.version.major, axis.version.minor) != (0, 6):
                version = ".".join(map(str, axis.version))
                return Fault("drive_version", f"The {axis.joint} drive runs firmware {version}; 0.6 is supported.")
        return None

    def request(self, request: Request, now_s: float, order: WalkOrder | None = None) -> str | None:
        """A person's wish, for the next tick. Returns why it is refused, or None."""
        if request is Request.CLEAR and self.mode not in ENERGISED:
            self.drives.clear_errors()
            self._request_until_s = now_s + CLEARING_S
        else:
            refused = refusal(self.mode, request, self.health)
            if refused:
                return refused
            self._request_until_s = now_s + PERIOD_S
        if order is not None:
            self.controller.order = order
            self.adaptation.reset(order.depth_m)
        self._request = request
        self.event(now_s, f"request {request.name.lower()}")
        return None

    def _request_now(self, now_s: float) -> Request:
        """The request to act on in this tick; it lapses once it is obeyed or its time is over."""
        request = self._request
        if request is not Request.CLEAR or now_s > self._request_until_s:
            self._request = Request.NONE
        return request

    def _change_mode(self, mode: Mode, now_s: float) -> None:
        if mode is self.mode:
            return
        if mode is Mode.FAULT:
            self.fault = self.health.fault
        elif mode is Mode.IDLE:
            self.fault = None
        if mode is Mode.WALKING:
            self.estimator.reset()
        because = f": {self.fault.sentence}" if self.fault else ""
        self.event(now_s, f"mode {self.mode.name.lower()} to {mode.name.lower()}{because}")
        if self.mode in ENERGISED and mode not in ENERGISED:
            self.drives.disarm(now_s, at_once=True)
        self.mode, self._mode_since_s = mode, now_s

    def _limit(self, wanted: Torques, dt_s: float) -> LimitedTorques:
        if self.mode not in MOVING:
            return LimitedTorques(NO_TORQUE, False, True)
        return apply_limits(
            wanted, self.sent.torques_nm, self.states, self.configuration.limits, self._ranges, dt_s
        )

    def _command(self, now_s: float) -> None:
        """Before all drives are heard, nothing is sent. Idle ones get zero torque, which feeds their watchdogs."""
        if self.mode is Mode.BOOT:
            return
        if self.mode is Mode.ARMING:
            self.drives.arm(now_s)
        elif self.mode not in ENERGISED:
            self.drives.disarm(now_s)
            self.drives.request_versions(now_s)
        self.drives.send(self.sent.torques_nm)

    def _record(self, beat: Beat) -> None:
        tick_s = self._clock() - beat.now_s
        self.recorder.put(TICK_KIND, self._tick_row(beat, tick_s))
        self.timing.update(beat.now_s, beat.late_s, beat.missed, tick_s)

    def _tick_row(self, beat: Beat, tick_s: float) -> bytes:
        a, b, c, d = self.states
        left, right = self.reading.left, self.reading.right
        target, now_s = self.target, beat.now_s
        return TICK.encode(
            now_s, beat.late_s, tick_s,
            a.angle_rad, b.angle_rad, c.angle_rad, d.angle_rad,
            a.velocity_rad_s, b.velocity_rad_s, c.velocity_rad_s, d.velocity_rad_s,
            a.current_a, b.current_a, c.current_a, d.current_a,
            now_s - a.angle_stamp_s, now_s - b.angle_stamp_s, now_s - c.angle_stamp_s, now_s - d.angle_stamp_s,
            now_s - a.current_stamp_s, now_s - b.current_stamp_s,
            now_s - c.current_stamp_s, now_s - d.current_stamp_s,
            *self.sent.torques_nm,
            left.sweep_torque_nm, right.sweep_torque_nm, left.adduction_torque_nm, right.adduction_torque_nm,
            left.force_x_n, right.force_x_n, left.force_z_n, right.force_z_n, left.depth_m, right.depth_m,
            target.depth_m, self.controller.gait.commanded_depth_m, self.body.x_m,
            a.temperature_c, b.temperature_c, c.temperature_c, d.temperature_c,
            beat.number, self.timing.missed_ticks, target.stride, self.mode, target.phase, self.sent.limited,
        )  # fmt: skip

    def event(self, now_s: float, text: str) -> None:
        """A sentence into the log."""
        self.recorder.put(EVENT_KIND, EVENT.encode(now_s, text))


def stride_row(now_s: float, stride: StrideEstimate, chosen_depth_m: float) -> bytes:
    k_p, k_s, k_e = stride.k_p, stride.k_s, stride.k_e
    values: tuple[Any, ...] = (
        now_s, stride.t_start_s, stride.insertion_s, stride.stance_s, stride.extraction_s,
        k_p.value, k_p.std_error, k_s.value, k_s.std_error, k_e.value, k_e.std_error,
        stride.surface_m, stride.depth_m,
        stride.insertion_force_n, stride.stance_force_n, stride.extraction_force_n,
        stride.step_m, chosen_depth_m,
        stride.index, k_p.samples, k_s.samples, k_e.samples,
        0 if stride.flipper == "left" else 1,
        k_p.valid, k_s.valid, k_e.valid, stride.released,
    )  # fmt: skip
    return STRIDE.encode(*values)
