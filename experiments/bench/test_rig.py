"""A rig under the hands of the bench: armed, moved, made idle, and every tick of it looked at.

Torque comes from the daemon's own loop in its own modes, so limits, gate and faults guard the bench as they guard a
walk. Only the pose that is held in HOLD may be replaced: by another path, or by a law of the bench.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from control.controller import HoldLaw, measured_angles
from control.faults import Fault, Reaction
from control.modes import ENERGISED, Mode, Request
from control.rate import PERIOD_S
from control.records import JOINTS, DriveStates, JointAngles, JointTargets, Torques, same_for_all
from experiments.bench.lateness import Lateness
from experiments.bench.operator import Attendant
from experiments.bench.rig import Rig
from experiments.robot.bench_robot import BenchError
from firmware_host.operator.fault_texts import fault_advice
from firmware_host.ticker import Tick

ARMING_S = 5.0  # for faults of before to be over, and for the drives to go into closed loop
IDLING_S = 2.0
LOOK_S = 0.1  # while a person does something
GOODBYE_FRAMES = 5  # to each drive, where nothing else helps
LEVEL: JointAngles = same_for_all(0.0)


class Sample(NamedTuple):
    """One tick."""

    tick: Tick
    mode: Mode
    states: DriveStates
    aim: JointTargets | None  # commanded while the states came about
    sent_nm: Torques
    limited: bool


class Stand:
    """Owns the rig and whether it is energised."""

    def __init__(self, rig: Rig, attendant: Attendant) -> None:
        self.rig = rig
        self.attendant = attendant
        self.configuration = rig.configuration
        self.loop = rig.loop
        self.drives = rig.loop.drives
        self.controller = rig.loop.controller
        self._rest: JointAngles = LEVEL  # where the flippers lie without torque
        self.lateness = Lateness()  # of one measurement, while a drive tells that torque is on
        self.lateness_so_far = Lateness()  # of all

    def tick(self) -> Sample:
        aim, loop = self.controller.joint_targets, self.loop
        tick, torque_on = self.rig.wait(), self._torque_on()
        loop.tick(tick)
        if torque_on:
            self._on_lateness(tick, loop.states)
        return Sample(tick, loop.mode, loop.states, aim, loop.sent.torques_nm, loop.sent.limited)

    def run_for(self, duration_s: float) -> list[Sample]:
        """Raises BenchError where a fault takes or hinders the torque."""
        return [self.tick_soundly() for _ in range(round(duration_s / PERIOD_S))]

    def tick_soundly(self) -> Sample:
        return self._sound(self.tick())

    def run_until(self, done: Callable[[Sample], bool], longest_s: float, what: str) -> list[Sample]:
        """Raises BenchError as well where it does not come to that."""
        samples: list[Sample] = []
        for _ in range(round(longest_s / PERIOD_S)):
            samples.append(self.tick_soundly())
            if done(samples[-1]):
                return samples
        raise BenchError(f"{what} did not come within {longest_s:g} s: the robot is in {self.loop.mode.name.lower()}.")

    def look_on(self) -> None:
        """While a person is asked: so that no frame waits for long, and the drives stay idle."""
        self.run_for(LOOK_S)

    def listen(self) -> Sample:
        """A tick in which nothing is sent."""
        tick = self.rig.wait()
        states = self.drives.read(tick.now_s)
        if self._torque_on():
            self._on_lateness(tick, states)
        return Sample(tick, self.loop.mode, states, None, self.loop.sent.torques_nm, False)

    def _torque_on(self) -> bool:
        """As a drive told before this tick: it may have a fault, and a drive that is told to go idle need not obey."""
        return any(state.closed_loop for state in self.loop.states)

    def _on_lateness(self, tick: Tick, states: DriveStates) -> None:
        self.lateness.update(tick, states)
        self.lateness_so_far.update(tick, states)

    def _sound(self, sample: Sample) -> Sample:
        fault = self.loop.faults.worst
        if sample.mode in (*ENERGISED, Mode.FAULT) and fault and fault.kind.reaction >= Reaction.HOLD:
            raise BenchError(f"{fault.name}: {_reported([fault])}")
        return sample

    def arm(self, law: HoldLaw | None = None) -> None:
        """Into hold, with a law from the first torque on."""
        self._wait_until_armable()
        self.controller.hold_law = law
        against: Sequence[Fault] = ()
        for _ in range(round(ARMING_S / PERIOD_S)):
            blocking = self.loop.faults.blocking()
            if self.loop.mode is Mode.IDLE and not blocking:
                self._ask_for_torque()  # again, where a fault began in the very tick of the wish: a joint that sinks
            if self.tick_soundly().mode is Mode.HOLD:
                return
            against = blocking or against
        raise BenchError(f"Closed loop of all drives did not come within {ARMING_S:g} s. {_reported(against)}".rstrip())

    def _ask_for_torque(self) -> None:
        self._rest = measured_angles(self.loop.states)
        refused = self.loop.request(Request.ARM, self.rig.now_s)
        if refused:
            raise BenchError(f"The robot cannot be armed: {refused}")

    def _wait_until_armable(self) -> None:
        if self._becomes_armable():
            return
        reported = _reported(self.loop.faults.blocking())
        if reported and self.attendant.clears(reported, self._idle_on):
            self.loop.request(Request.CLEAR, self.rig.now_s)
            if self._becomes_armable():
                return
        silent = ", ".join(joint for joint, state in zip(JOINTS, self.loop.states, strict=True) if not state.heard)
        unheard = f"{silent}: nothing is heard; check power, wiring and node ids."
        mode = f"it is in {self.loop.mode.name.lower()}."
        raise BenchError(f"The robot cannot be armed: {reported or (unheard if silent else mode)}")

    def _becomes_armable(self) -> bool:
        for _ in range(round(ARMING_S / PERIOD_S)):
            if self.tick().mode is Mode.IDLE and not self.loop.faults.blocking():
                return True
        return False

    def _idle_on(self) -> None:
        """While a person is asked about a fault that stands."""
        for _ in range(round(LOOK_S / PERIOD_S)):
            self.tick()

    def move(
        self, way_points: Sequence[JointAngles], speed_rad_s: float | None = None, law: HoldLaw | None = None
    ) -> list[Sample]:
        """In hold, along a smooth path, until its end."""
        self.controller.hold_law = law
        self.controller.follow_path(way_points, speed_rad_s or self.configuration.motion.path_speed_rad_s)
        return self.run_until(lambda sample: not self.controller.moving, 60.0, "The end of a path")

    def rise(self) -> None:
        """From rest to flippers level and straight out."""
        self.arm()
        self.run_for(self.configuration.motion.fade_in_s)
        self.move([LEVEL])
        self.run_for(0.3)

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Flippers level and held; laid down again where all went well, else without torque at once.

        What is measured meanwhile is reckoned up after it: long sums would be missed ticks, with torque on.
        """
        self.rise()
        try:
            yield
        except BaseException:
            self.let_go()
            raise
        self.lie_down()

    def hold_here(self) -> None:
        """The pose that the joints have by now, in place of what was held and of any law."""
        self.controller.hold_pose(measured_angles(self.loop.states))
        self.controller.hold_law = None

    def lower(self) -> None:
        """Flippers back to where they lay."""
        self.move([LEVEL, self._rest])

    def lie_down(self) -> None:
        self.lower()
        self.let_go()

    def let_go(self) -> None:
        """Torque off at once, and wait until every drive says so. Raises BenchError where one does not."""
        self.controller.hold_law = None
        self.loop.request(Request.DISARM, self.rig.now_s)
        for _ in range(round(IDLING_S / PERIOD_S)):
            sample = self.tick()
            if sample.mode not in ENERGISED and not any(state.closed_loop for state in sample.states):
                return
        busy = ", ".join(joint for joint, state in zip(JOINTS, self.loop.states, strict=True) if state.closed_loop)
        raise BenchError(f"{busy}: still in closed loop {IDLING_S:g} s after it was told to go idle: cut the power.")

    def clear(self) -> None:
        """After a fault that was made on purpose."""
        self.loop.request(Request.CLEAR, self.rig.now_s)
        self._wait_until_armable()

    def end(self) -> None:
        """However things stand: drives idle. Never raises, and needs nothing but the drives."""
        self.controller.hold_law = None
        self.drives.force_idle(GOODBYE_FRAMES)


def first_lasting(flags: Sequence[bool], ticks: int) -> int | None:
    """From which tick on so many in a row are true: a single one may be noise, or a turning point."""
    return next((first for first in range(len(flags) - ticks + 1) if all(flags[first : first + ticks])), None)


def joint_place(joint: str) -> int:
    return JOINTS.index(joint)


def _reported(faults: Sequence[Fault]) -> str:
    return " ".join(fault_advice(fault) for fault in faults)
