"""Runs one scenario: its schedule, then the return to rest, with every promise checked after each tick."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from control.faults import FaultKind
from control.modes import Mode
from control.records import JOINTS, Phase
from tests.dst.log_check import log_problems
from tests.dst.operated_robot import OperatedRobot
from tests.dst.promises import PROMISES, Promise, StopInTime
from tests.dst.reachability import Reachability
from tests.dst.scenario import Call, Drift, Event, Failure, Scenario, Terminate
from tests.dst.starts import RecordedRobot, sound_walk

STEWARD = "steward"  # the client that brings the robot to rest and arms it again
LONGEST_SHUTDOWN_S = 5.5
LONGEST_CLEARING_S = 3.5  # a drive that restarts is silent for 1 s, then reports again what arming needs
CLEARING_TICKS = 120  # between two requests to clear, or to arm
LONGEST_ARMING_S = 1.5
RESTING_TICKS = 50  # after the torque is off
LONGEST_COASTING_S = 3.0  # of a joint that was disarmed in a fast swing, until it lies against its stop
STILL_RAD_S = 0.05
HELD_TICKS = 20
DISARMED_TICKS = 4
COOLING = (FaultKind.WINDING_HOT, FaultKind.WINDING_OVERHEATING)  # a winding cools for minutes


@dataclass
class Outcome:
    """The result of one scenario. `problem` is empty where every promise was kept."""

    seed: int
    problem: str = ""
    promise: str = ""
    at_s: float = 0.0
    ticks: int = 0
    covered: Counter[str] = field(default_factory=Counter)


class BrokenPromiseError(Exception):
    pass


class Run:
    """Owns the robot of one scenario and what was observed of it."""

    def __init__(self, scenario: Scenario, robot: OperatedRobot, promises: Sequence[type[Promise]]) -> None:
        self.outcome = Outcome(scenario.seed)
        self._scenario = scenario
        self._robot = robot
        self._loop = robot.loop
        self._reach = Reachability(robot)
        self._promises = [promise(robot, self._reach) for promise in promises]
        self._stop = StopInTime(robot, self._reach)
        self._begun_s = robot.now_s
        self._mode = robot.loop.mode

    def run(self) -> None:
        with suppress(BrokenPromiseError):
            self._run_schedule()
            self._end_failures()
            if self._robot.ended:
                self._check_end()
            else:
                self._come_to_rest()
                self._arm_again()

    def _run_schedule(self) -> None:
        self.outcome.covered[f"start {self._scenario.start}"] += 1
        self.outcome.covered[f"drives {self._scenario.surroundings.drive_type}"] += 1
        waiting = list(self._scenario.events)
        end_s = self._begun_s + self._scenario.for_s
        while waiting or self._robot.now_s < end_s:  # a process that was stopped may resume after the end
            while waiting and waiting[0].at_s <= self._robot.now_s - self._begun_s:
                event = waiting.pop(0)
                self._robot.apply(event)
                self._cover(event)
            self._step()
        terminated = any(isinstance(event, Terminate) for event in self._scenario.events)
        self._wait_until(lambda: self._robot.ended if terminated else self._stop.since_s is None, LONGEST_SHUTDOWN_S)
        if terminated and not self._robot.ended:
            self._break("Shutdown", f"the daemon has not ended {LONGEST_SHUTDOWN_S:g} s after SIGTERM")

    def _end_failures(self) -> None:
        self._robot.repair()
        self._robot.call("guest", "disarm")

    def _check_end(self) -> None:
        """Check that a daemon that has ended leaves its drives idle, but for those that others armed meanwhile."""
        drives = self._robot.lockstep.robot.drives
        own = [drive for index, drive in enumerate(drives) if not self._reach.is_energised_by_others(index)]
        self._run(DISARMED_TICKS)
        if any(drive.energised for drive in own):
            self._break("Shutdown", "a drive is in closed loop after the end of the daemon")

    def _come_to_rest(self) -> None:
        """Let the joints come to rest, moves them back by hand where they are out of range, and clears the faults."""
        self._run(RESTING_TICKS)
        self._wait_until(self._is_still, LONGEST_COASTING_S)
        if self._is_out_of_range():
            self._robot.lockstep.robot.request_put_back()
            self._run(RESTING_TICKS)
        for tick in range(round(LONGEST_CLEARING_S / self._loop.period_s)):
            if self._is_ready():
                return
            if tick == CLEARING_TICKS - 1:
                self._robot.power_cycle_failed_drives()
            if tick % CLEARING_TICKS == 0:
                self._robot.call(STEWARD, "clear", zero=tick > CLEARING_TICKS)
            self._step()
        names = ", ".join(sorted({str(fault.kind) for fault in self._loop.faults.present})) or "no fault"
        self._break("BackToIdle", f"after a clear the robot is {self._loop.mode.name.lower()} with {names}")

    def _is_still(self) -> bool:
        return all(abs(speed_rad_s) < STILL_RAD_S for speed_rad_s in self._robot.lockstep.robot.plant.velocities_rad_s)

    def _is_out_of_range(self) -> bool:
        ranges, angles_rad = self._loop.configuration.joint_ranges, self._robot.lockstep.robot.plant.angles_rad
        return not all(span.min_rad <= angle <= span.max_rad for span, angle in zip(ranges, angles_rad, strict=True))

    def _is_ready(self) -> bool:
        """Return whether the robot may be armed, or waits for its windings to cool."""
        faults, forced = self._loop.faults, self._robot.lockstep.forced
        return self._cools() or self._loop.mode is Mode.IDLE and not faults.blocking(forced)

    def _cools(self) -> bool:
        return any(fault.kind in COOLING for fault in self._loop.faults.present)

    def _arm_again(self) -> None:
        if self._cools():
            return
        self._robot.call(STEWARD, "release")
        for tick in range(round(LONGEST_ARMING_S / self._loop.period_s)):
            if self._loop.mode is Mode.HOLD:
                break
            if tick % CLEARING_TICKS == 0:  # a joint may have been moving
                self._robot.call(STEWARD, "arm", take_over=True, force=self._robot.lockstep.forced)
            self._step()
        else:
            names = ", ".join(fault.name for fault in self._loop.faults.present) or "no fault"
            self._break("BackToIdle", f"it does not arm again: {self._loop.mode.name.lower()}, {names}")
        self._run(HELD_TICKS)
        self._robot.call("guest", "disarm")
        self._run(DISARMED_TICKS)

    def _wait_until(self, done: Callable[[], bool], longest_s: float) -> bool:
        for _ in range(round(longest_s / self._loop.period_s)):
            if done():
                return True
            self._step()
        return done()

    def _run(self, ticks: int) -> None:
        for _ in range(ticks):
            self._step()

    def _step(self) -> None:
        self._robot.begin_tick()
        self._reach.update()
        self._robot.step()
        self._reach.update()
        self.outcome.ticks += 1
        if self._loop.mode is not self._mode:
            self._mode = self._loop.mode
            self.outcome.covered[f"mode {self._mode.name.lower()}"] += 1
        if self._loop.controller.target.phase is Phase.RECOVERY:
            self.outcome.covered["phase recovery"] += 1
        for fault in self._loop.faults.begun:
            self.outcome.covered[f"fault {fault.name}"] += 1
        for _ in self._stop.update():
            pass
        for promise in self._promises:
            for text in promise.update():
                self._break(type(promise).__name__, text)

    def _cover(self, event: Event) -> None:
        """Count the kind of an event."""
        match event:
            case Call(client=client, method=method):
                self.outcome.covered[f"call {method}"] += 1
                self.outcome.covered[f"client {client}"] += 1
            case Failure(component=component, kind=kind):
                for joint in JOINTS:
                    component = component.replace(joint, "JOINT")
                self.outcome.covered[f"failure {component} {kind}"] += 1
            case Drift(values=values):
                for name in values:
                    self.outcome.covered[f"drift {name}"] += 1
            case _:
                self.outcome.covered[f"event {type(event).__name__.lower()}"] += 1

    def check_log(self, folder: Path, lockstep: RecordedRobot) -> None:
        lockstep.loop.recorder.close(0.0)
        with suppress(BrokenPromiseError):
            for text in log_problems(folder, lockstep):
                self._break("WholeLog", text)

    def _break(self, promise: str, text: str) -> None:
        self.outcome.promise, self.outcome.problem = promise, text
        self.outcome.at_s = self._robot.now_s - self._begun_s
        raise BrokenPromiseError


def run_scenario(scenario: Scenario, promises: Sequence[type[Promise]] = PROMISES) -> Outcome:
    """Run a scenario from a copy of a sound robot; the same scenario gives the same outcome."""
    lockstep = sound_walk(scenario.surroundings).robot_at(scenario.start)
    lockstep.failures.random.seed(scenario.seed)
    with TemporaryDirectory(prefix="dst-", dir="/dev/shm") as name:
        folder = Path(name)
        robot = OperatedRobot(lockstep, folder)
        with closing(robot):
            run = Run(scenario, robot, promises)
            run.run()
        if not run.outcome.problem:
            run.check_log(folder, lockstep)
    return run.outcome
