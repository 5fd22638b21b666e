"""The test rig: arms, moves and switches off the robot on a rig, and returns a sample of every tick.

Torque comes from the daemon's own loop in its own modes, so limits, gate and faults protect the bench like a walk. Only
the held pose in HOLD may be replaced: by another path, or by a hold law of the bench.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import compress
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from control.controller import HoldLaw, measured_angles
from control.faults import Fault, FaultKind, Reaction
from control.modes import ENERGISED, Mode, Request
from control.rate import PERIOD_S
from control.records import DriveStates, JointAngles, Joints, JointTargets, Torques, same_for_all
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from experiments.bench.lateness import Lateness
from experiments.bench.operator import BenchOperator
from experiments.bench.rig import Rig
from experiments.robot.bench_errors import BenchError
from firmware_host.ticker import Tick

ARMING_S = 5.0  # longest time for earlier faults to end, and for the drives to enter closed loop
IDLING_S = 2.0
POLL_S = 0.1  # interval at which a prompt is checked for an answer
IDLE_COMMANDS = 5  # to each drive, in case some are lost


class TickSample(NamedTuple):
    """One tick."""

    tick: Tick
    mode: Mode
    states: DriveStates
    aim: JointTargets | None  # commanded before the states were measured
    sent_nm: Torques  # in this tick
    limited: bool  # a limit cut the torque of this tick


def signals(samples: Sequence[TickSample], name: str) -> NDArray[np.float64]:
    """Return one signal of the states: a row for each tick, a column for each joint."""
    return np.array([[getattr(state, name) for state in sample.states] for sample in samples])


class TestRig:
    """Owns the rig and whether its drives have torque."""

    __test__ = False  # pytest must not collect it for its name

    def __init__(self, rig: Rig, bench_operator: BenchOperator) -> None:
        self.rig = rig
        self.operator = bench_operator
        self.configuration = rig.configuration
        self.loop = rig.loop
        self.drives = rig.loop.drives
        self.controller = rig.loop.controller
        self.level: JointAngles = same_for_all(0.0, self.configuration.rig)
        self._rest = self.level  # joint angles in which the flippers lie without torque
        self.lateness = Lateness()  # of one measurement, while torque is on
        self.lateness_so_far = Lateness()  # of all measurements
        self._unreadable = [joint for joint, drive in self.configuration.drive.items() if not drive.knows_watchdog]
        self.forced = ""  # the operator allows torque without a known watchdog

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.force_idle()
        self.rig.close()

    def tick(self) -> TickSample:
        aim, loop = self.controller.joint_targets, self.loop
        tick, torque_on = self.rig.wait(), self._torque_on()
        loop.tick(tick)
        self._update_lateness(torque_on, tick, loop.states)
        return TickSample(tick, loop.mode, loop.states, aim, loop.sent.torques_nm, loop.sent.limited)

    def run_for(self, duration_s: float) -> list[TickSample]:
        """Raises BenchError where a fault removes or limits the torque."""
        return [self.tick_checked() for _ in range(round(duration_s / PERIOD_S))]

    def tick_checked(self) -> TickSample:
        sample, fault = self.tick(), self.loop.faults.worst
        if sample.mode in (*ENERGISED, Mode.FAULT) and fault and fault.kind.reaction >= Reaction.HOLD:
            raise BenchError(f"{fault.name}: {_advice([fault])}")
        return sample

    def run_until(self, done: Callable[[TickSample], bool], longest_s: float, what: str) -> list[TickSample]:
        """Run until `done` accepts a sample. Raises BenchError after the longest time, and for a fault."""
        samples: list[TickSample] = []
        for _ in range(round(longest_s / PERIOD_S)):
            samples.append(self.tick_checked())
            if done(samples[-1]):
                return samples
        raise BenchError(f"{what} did not occur within {longest_s:g} s: the robot is in {self.loop.mode.name.lower()}.")

    def run_during_prompt(self) -> None:
        """Run the loop while the operator is asked, so that no frame waits and the drives stay idle."""
        self.run_for(POLL_S)

    def tick_silently(self, others: Sequence[tuple[CanPort, Frame]] = ()) -> TickSample:
        """Read the drives for one tick and send nothing but the frames of `others`, as another program would.

        Drives that answer only when asked are asked, where that commands nothing and feeds no watchdog.
        """
        tick = self.rig.wait()
        for port, frame in others:
            port.send(frame)
        states = self.drives.read(tick.now_s)
        asked = [axis for axis in self.drives.axes if not axis.parameters.asking_ends_torque]
        for axis in asked:
            axis.poll()
        self._update_lateness(self._torque_on() and len(asked) == len(states), tick, states)
        return TickSample(tick, self.loop.mode, states, None, self.loop.sent.torques_nm, False)

    def _torque_on(self) -> bool:
        """Return whether a drive reported closed loop before this tick, in any mode of the loop."""
        return any(state.closed_loop for state in self.loop.states)

    def _update_lateness(self, counts: bool, tick: Tick, states: DriveStates) -> None:
        for lateness in (self.lateness, self.lateness_so_far) if counts else ():
            lateness.update(tick, states)

    def arm(self, law: HoldLaw | None = None) -> None:
        """Arm the robot into HOLD, with a hold law from the first torque on. Raises BenchError."""
        self._ask_about_watchdogs()
        self._wait_until_armable()
        self.controller.hold_law = law
        last_blocking: Sequence[Fault] = ()
        for _ in range(round(ARMING_S / PERIOD_S)):
            blocking = self.loop.faults.blocking(self.forced)
            if self.loop.mode is Mode.IDLE and not blocking:
                self._ask_for_torque()  # again, where a fault such as a sinking joint began in the tick of the request
            if self.tick_checked().mode is Mode.HOLD:
                return
            last_blocking = blocking or last_blocking
        raise BenchError(f"Not all drives entered closed loop within {ARMING_S:g} s. {_advice(last_blocking)}".rstrip())

    def _ask_for_torque(self) -> None:
        self._rest = measured_angles(self.loop.states)
        refused = self.loop.request(Request.ARM, self.rig.now_s, forced=self.forced)
        if refused:
            raise BenchError(f"The robot cannot be armed: {refused}")

    def _ask_about_watchdogs(self) -> None:
        """Ask once whether to arm by force. Raises BenchError where the operator does not allow it."""
        if self.forced or not self._unreadable:
            return
        what = f"{', '.join(self._unreadable)}: no watchdog can be read; stage 5 measures whether it ends the torque."
        if not self.operator.allows_unknown_watchdogs(what, self._tick_during_prompt):
            raise BenchError(f"The robot cannot be armed: {what} An operator at a terminal must allow it.")
        self.forced = FaultKind.WATCHDOG_UNKNOWN.value

    def _wait_until_armable(self) -> None:
        if self._is_armable_soon():
            return
        faults = _advice(self.loop.faults.blocking(self.forced))
        if faults and self.operator.allows_clearing(faults, self._tick_during_prompt):
            self.loop.request(Request.CLEAR, self.rig.now_s)
            if self._is_armable_soon():
                return
        silent = self._joints_with([not state.heard for state in self.loop.states])
        unheard = f"{silent}: nothing is heard; check power, wiring and node ids."
        mode = f"it is in {self.loop.mode.name.lower()}."
        raise BenchError(f"The robot cannot be armed: {faults or (unheard if silent else mode)}")

    def _is_armable_soon(self) -> bool:
        for _ in range(round(ARMING_S / PERIOD_S)):
            if self.tick().mode is Mode.IDLE and not self.loop.faults.blocking(self.forced):
                return True
        return False

    def _tick_during_prompt(self) -> None:
        """Run the loop while the operator is asked about a fault."""
        for _ in range(round(POLL_S / PERIOD_S)):
            self.tick()

    def move(self, way_points: Sequence[JointAngles], speed_rad_s: float | None = None) -> list[TickSample]:
        """Move in HOLD along a smooth path to its end."""
        self.controller.hold_law = None
        self.controller.follow_path(way_points, speed_rad_s or self.configuration.motion.path_speed_rad_s)
        return self.run_until(lambda sample: not self.controller.moving, 60.0, "The end of a path")

    def index_of(self, joint: str) -> int:
        """Return the place of a joint in the records of this rig."""
        return self.configuration.rig.joints.index(joint)

    def raise_flippers(self) -> None:
        """Arm, and raise the flippers until they are level and straight out."""
        self.arm()
        self.run_for(self.configuration.motion.fade_in_s)
        self.move([self.level])
        self.run_for(0.3)

    @contextmanager
    def flippers_raised(self) -> Iterator[None]:
        """Hold the flippers level within this context; lower them after it, or switch off at once after an error.

        Measurements are evaluated after the context, because long computations would miss ticks with torque on.
        """
        self.raise_flippers()
        try:
            yield
        except BaseException:
            self.switch_off()
            raise
        self.move([self.level, self._rest])
        self.switch_off()

    def hold_present_pose(self) -> None:
        """Hold the present pose of the joints, without a hold law."""
        self.controller.hold_pose(measured_angles(self.loop.states))
        self.controller.hold_law = None

    def switch_off(self) -> None:
        """Switch torque off and wait until every drive reports it. Raises BenchError where one does not."""
        self.controller.hold_law = None
        self.loop.request(Request.DISARM, self.rig.now_s)
        for _ in range(round(IDLING_S / PERIOD_S)):
            sample = self.tick()
            if sample.mode not in ENERGISED and not any(state.closed_loop for state in sample.states):
                return
        busy = self._joints_with([state.closed_loop for state in self.loop.states])
        raise BenchError(f"{busy}: still in closed loop {IDLING_S:g} s after the command to go idle: cut the power.")

    def _joints_with(self, flags: Sequence[bool]) -> str:
        return ", ".join(compress(self.configuration.rig.joints, flags))

    def clear_fault(self) -> None:
        """Clear a fault that a check has caused."""
        self.loop.request(Request.CLEAR, self.rig.now_s)
        self._wait_until_armable()

    def force_idle(self) -> None:
        """Command the drives idle in any state, without the loop. Never raises."""
        self.controller.hold_law = None
        self.drives.force_idle(IDLE_COMMANDS)


def first_lasting(
    samples: Sequence[TickSample], flags: Sequence[bool] | NDArray[np.bool_], ticks: int
) -> TickSample | None:
    """Return the first of `ticks` samples in a row whose flag is true; a single one may be noise or a turning point."""
    return next(
        (sample for first, sample in enumerate(samples[: 1 - ticks]) if all(flags[first : first + ticks])), None
    )


def torque_on(held: Torques, index: int, torque_nm: float) -> Torques:
    """Return a torque for one joint of those that are `held`, and none for the others."""
    return Joints(*(torque_nm if other == index else 0.0 for other in range(len(held))))


def idle(held: Torques, states: DriveStates) -> Torques:
    """A hold law: no torque, in closed loop."""
    return held.map(lambda _: 0.0)


def _advice(faults: Sequence[Fault]) -> str:
    return " ".join(fault.advice for fault in faults)
