"""The calibration of one joint (the paper's section II-B): a motor holds a weight level, again and again.

Each reading is in the notebook before the next weight is asked for, so the same plan continues after any interruption.
A robot that lets go, after a fault or after ten idle minutes, is reported with its own message and armed again, and the
weight is read again. The empty arm waits until the winding is cool enough for the next weight; where it gets warm while
a weight hangs, the operator takes the weight off.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import degrees
from typing import Any, TypeVar

from experiments.actuator.fit import current_per_nm
from experiments.actuator.friction import Loop, swing_arm
from experiments.actuator.mismatch import find_mismatch
from experiments.actuator.plan import COOL_K, READING_S, Plan, Step, largest_current_a, stays_cool, steps_of
from experiments.actuator.reading import HeldJoint, MovedError, WarmError
from experiments.actuator.weight_handling import WeightHandler
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import BenchRobot, arm, ask_to_clear_faults, require_hold
from experiments.robot.steps import OperatorStep, conduct_steps
from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON, SKIP, Operator
from experiments.study.session import Show
from operator_client.status_client import CallRefusedError

Answer = TypeVar("Answer")

KEEP, OTHER = "k", "o"  # keys of answers
MOST_FAULTS = 5  # during the attempts at one weight
MOST_REPEATS = 3  # of one weight that does not come to rest, or does not match
COOLING_S, LONGEST_COOLING_S = 1.0, 1800.0  # period of the check, and time limit
TICK_S = 0.01  # of a prompt, in which the robot is attended


@dataclass
class Calibration:
    """Runs the calibration of one joint."""

    robot: BenchRobot
    joint: str
    plan: Plan
    weights: WeightHandler
    operator: Operator
    notebook: Notebook
    show: Show
    held: HeldJoint | None = None
    faults: Counter[str] = field(default_factory=Counter)  # by step
    mismatches: Counter[str] = field(default_factory=Counter)
    warned: bool = False

    @property
    def constant_nm_a(self) -> float:
        """The configured torque constant."""
        return self.robot.configuration.drive[self.joint].torque_constant_nm_a

    def run(self) -> Mapping[str, Any]:
        """Return the readings by the steps' keys. Raises BenchError where the robot is lost or cannot be armed."""
        steps = [
            OperatorStep(
                step.key, partial(self._attempt, self._prepare, step), partial(self._attempt, self._read, step)
            )
            for step in steps_of(self.plan)
        ]
        conduct_steps(steps, self.notebook, self.operator, self.show, {"skipped": "on request"})
        return self.notebook.entries

    def _attempt(self, act: Callable[[Step], Answer], step: Step) -> Answer | None:
        """Return nothing where the robot let go, or its winding got warm: the step is prepared again."""
        try:
            return act(step)
        except WarmError as problem:
            self._count(step, problem)
            self.operator.report(f"{step.name} was not read: {problem}.")
            self.weights.take_off()
        except (BenchError, CallRefusedError) as problem:
            self._recover(step, problem)
        return None

    def _prepare(self, step: Step) -> str:
        """Hold the joint and hang the weight; return the operator's answer."""
        self._hold(step)
        self.warned = False
        return self.weights.hang(step, self._attend_hold)

    def _count(self, step: Step, problem: Exception) -> None:
        """Raise the problem after too many of them."""
        self.faults[step.key] += 1
        if self.faults[step.key] >= MOST_FAULTS:
            raise BenchError(f"{step.name} of {self.joint} cannot be read: {problem}") from problem

    # the robot

    def _hold(self, step: Step) -> None:
        """Hold with an empty arm, and a winding that is cool enough for the next weight."""
        if self.held is None or self.robot.call("status")["mode"] != "hold":
            self.held = None
            ask_to_clear_faults(self.robot, self.operator)
            self.weights.hold_level(self.joint, self._attend_hold)
            self._cool(step)
            arm(self.robot, self.operator)
            self.weights.release(self._attend_hold)
            self.held = HeldJoint(self.robot, self.joint)
        elif not self._is_cool(step):
            self.weights.take_off()
            self._cool(step)

    def _is_cool(self, step: Step) -> bool:
        per_nm, hangs_s = current_per_nm(self.plan, self.notebook.entries), READING_S + self.weights.handling_s
        expected_a = largest_current_a(self.plan, self.robot.configuration, self.joint, step.weight_g)
        if per_nm is not None:
            expected_a = per_nm * self.plan.torque_nm(step.weight_g)
        return stays_cool(self.robot.configuration, expected_a, self._winding_c(), hangs_s)

    def _cool(self, step: Step) -> None:
        if self._is_cool(step):
            return
        self.operator.report(
            f"The {self.joint} winding has {self._winding_c():.0f} °C, too warm for {step.name}: waiting."
        )
        waited_s = 0.0
        while not self._is_cool(step):
            if waited_s > LONGEST_COOLING_S:
                raise BenchError(f"the {self.joint} winding does not cool: check [winding] and the drive's temperature")
            self.robot.wait(COOLING_S)
            waited_s += COOLING_S

    def _winding_c(self) -> float:
        drives = self.robot.call("status")["drives"]
        return float(next(drive["winding_c"] for drive in drives if drive["joint"] == self.joint))

    def _attend_hold(self) -> None:
        """Attend the robot during a prompt. Raises BenchError where it lets go."""
        self._attend()
        if self.held is not None:
            require_hold(self.robot.call("status"))

    def _attend(self) -> None:
        self.robot.wait(TICK_S)
        warm_c, winding_c = self.robot.configuration.limits.temperature_warm_c - COOL_K, self._winding_c()
        if not self.warned and winding_c > warm_c:
            self.warned = True
            self.operator.report(f"The {self.joint} winding has {winding_c:.0f} °C: a weight would fall soon.")
            self.weights.take_off()

    def _recover(self, step: Step, problem: Exception) -> None:
        """Recover from a robot that let go. Raises any other problem."""
        status = self.robot.call("status")
        if status["mode"] == "hold":
            raise problem
        self._count(step, problem)
        self.operator.report(f"{step.name} was not read: {str(problem).rstrip('.')}.")
        self.weights.take_off()
        self.held = None

    # readings

    def _read(self, step: Step) -> Entry | None:
        """Return the entry of the notebook; nothing where the weight is hung again."""
        assert self.held is not None
        trouble = ""
        for _ in range(MOST_REPEATS):
            try:
                reading = self.held.read()
            except MovedError as problem:
                trouble = str(problem)
            else:
                return self._checked(step, reading)
            answers = {GO_ON: "read it again", SKIP: "skip it"}
            question = f"{step.name} did not come to rest: {trouble}. Let it hang still and touch nothing."
            if self.operator.ask(question, answers, self._attend_hold) == SKIP:
                break
        self.operator.report(f"{step.name} of trial {step.reported_trial} is left out: {trouble}.")
        return {"skipped": trouble}

    def _checked(self, step: Step, reading: Entry) -> Entry | None:
        """Ask about a reading of another weight at most MOST_REPEATS times; then keep it as doubtful."""
        mismatch = find_mismatch(self.plan, self.notebook.entries, step, reading["current_a"], self.constant_nm_a)
        if mismatch is None:
            return self._entry(step, reading, loops=() if step.weight_g else self._measure_friction())
        answers = {GO_ON: "read it again", KEEP: "keep it, marked as doubtful"}
        if mismatch.other_g is not None:
            answers[OTHER] = f"it was the {mismatch.other_g:g} g"
        self.mismatches[step.key] += 1
        question = f"{step.name}: {mismatch.message}"
        answer = self.operator.ask(question, answers, self._attend)  # the reading counts even if the robot lets go
        if answer == OTHER and mismatch.other_g is not None:
            other = replace(step, weight_g=mismatch.other_g)
            if other.key in self.notebook.entries:
                self.operator.report(f"{other.name} of trial {other.trial} was read already and is not replaced.")
            else:
                self.notebook.write(other.key, self._entry(other, reading))
        elif answer == KEEP or self.mismatches[step.key] >= MOST_REPEATS:
            return self._entry(step, reading, mismatch.message)
        return None

    def _measure_friction(self) -> Sequence[Loop]:
        """Return no loops where the arm does not swing freely: only friction is missing then."""
        assert self.held is not None
        try:
            return swing_arm(self.held)
        except MovedError as problem:
            self.operator.report(f"friction was not measured this time: {problem}")
            return ()

    def _entry(self, step: Step, reading: Entry, doubt: str = "", loops: Sequence[Loop] = ()) -> Entry:
        """Return the notebook's entry; loops are those of the empty arm."""
        held_nm = self.constant_nm_a * reading["current_a"]
        self.operator.report(
            f"{self.joint}, trial {step.reported_trial}, {step.name}: {reading['current_a']:+.3f} A,"
            f" {held_nm:+.4f} N·m by the configured constant, at {degrees(reading['angle_rad']):+.2f} degrees"
        )
        more = {"loops": [loop._asdict() for loop in loops]} if loops else {}
        return reading | more | ({"doubt": doubt} if doubt else {})
