"""The weighing of one joint (the paper's section II-B): a motor holds a weight level, again and again.

Each reading is in the notebook before the next weight is asked for, so the same plan continues after any interruption.
A robot that lets go, after a fault or after ten idle minutes, is reported with its own message and armed again, and the
weight is read again. The empty arm waits until the winding is cool enough for the next weight; where it gets warm while
a weight hangs, the operator takes the weight off.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import degrees
from typing import TypeVar

from experiments.actuator.fit import current_per_nm
from experiments.actuator.friction import SWING_RAD, swing_arm
from experiments.actuator.mismatch import find_mismatch
from experiments.actuator.plan import (
    COOL_K,
    OPERATOR_S,
    READING_S,
    WeighingPlan,
    WeighingStep,
    largest_current_a,
    stays_cool,
    steps_of,
)
from experiments.actuator.reading import HeldJoint, MovedError, WarmError
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import BenchRobot, arm, ask_to_clear_faults, require_hold
from experiments.robot.steps import OperatorStep, conduct_steps
from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON, REDO, SKIP, Operator
from experiments.study.session import Show
from operator_client.status_client import CallRefusedError

Answer = TypeVar("Answer")

KEEP, OTHER = "k", "o"  # keys of answers
MOST_FAULTS = 5  # during the attempts at one weight
MOST_REPEATS = 3  # of one weight that does not come to rest, or does not match
COOLING_S, LONGEST_COOLING_S = 1.0, 1800.0  # period of the check, and time limit
TICK_S = 0.01  # of a prompt, in which the robot is attended
EMPTY = (
    "take everything off the flipper, and let it rest. Keep clear: after its reading it swings by"
    f" {degrees(SWING_RAD):.0f} degrees to each side for 15 s."
)


class WeightHandler:
    """Asks the operator of one joint. `meanwhile` is called repeatedly while an answer is awaited."""

    handling_s = OPERATOR_S  # that a weight hangs beyond its reading

    def __init__(self, operator: Operator, plan: WeighingPlan, joint: str) -> None:
        self.operator, self.plan, self.joint = operator, plan, joint

    def hold_level(self, meanwhile: Callable[[], None]) -> None:
        """Take all weights off and hold all flippers near level while torque is off."""
        flipper, axle = self.joint.split("_")
        self.operator.ask(
            f"Mount the robot with the {axle} axle of the {flipper} flipper horizontal and the flipper out"
            " over the edge, the other joints propped within their range. Take all weights off and hold the flipper"
            " level: all motors will hold their angles.",
            {GO_ON: "it is held"},
            meanwhile,
        )

    def release(self, meanwhile: Callable[[], None]) -> None:
        self.operator.ask("The motor holds. Let go of the flipper.", {GO_ON: "done"}, meanwhile)

    def hang(self, step: WeighingStep, meanwhile: Callable[[], None]) -> str:
        """Return GO_ON when it hangs, SKIP to leave it out, REDO for the one before."""
        lever = f"{100.0 * self.plan.lever_m:g} cm from the axle"
        what = f"hang {step.weight_g:g} g at {lever}, nothing else, and let it rest."
        question = f"Trial {step.reported_trial} of {self.plan.trials}: {what if step.weight_g else EMPTY}"
        answers = {GO_ON: "it rests", SKIP: "skip it", REDO: "redo the one before"}
        return self.operator.ask(question, answers, meanwhile)

    def take_off(self) -> None:
        """Have the weight taken off at once: it is too much for the motor."""
        self.operator.report("Take the weight off the flipper now.")


class JointWeighing:
    """Owns the held joint, and what went wrong at each step so far."""

    def __init__(self, robot: BenchRobot, weights: WeightHandler, notebook: Notebook, show: Show) -> None:
        self._robot, self._weights, self._notebook, self._show = robot, weights, notebook, show
        self._joint, self._plan, self._operator = weights.joint, weights.plan, weights.operator
        self._constant_nm_a = robot.configuration.drive[weights.joint].torque_constant_nm_a  # configured
        self._held: HeldJoint | None = None
        self._faults, self._mismatches = Counter[str](), Counter[str]()  # by step
        self._warned = False

    def run(self) -> dict[str, Entry]:
        """Return the readings by the steps' keys. Raises BenchError where the robot is lost or cannot be armed."""
        steps = [
            OperatorStep(
                step.key, partial(self._attempt, self._prepare, step), partial(self._attempt, self._read, step)
            )
            for step in steps_of(self._plan)
        ]
        conduct_steps(steps, self._notebook, self._operator, self._show, {"skipped": "on request"})
        return self._notebook.entries

    def _attempt(self, act: Callable[[WeighingStep], Answer], step: WeighingStep) -> Answer | None:
        """Return nothing where the robot let go, or its winding got warm: the step is prepared again.

        Raises the problem after too many of them, and any other at once.
        """
        try:
            return act(step)
        except (WarmError, BenchError, CallRefusedError) as problem:
            if not isinstance(problem, WarmError):
                if self._robot.call("status")["mode"] == "hold":
                    raise
                self._held = None
            self._faults[step.key] += 1
            if self._faults[step.key] >= MOST_FAULTS:
                raise BenchError(f"{step.name} of {self._joint} cannot be read: {problem}") from problem
            self._operator.report(f"{step.name} was not read: {str(problem).rstrip('.')}.")
            self._weights.take_off()
        return None

    def _prepare(self, step: WeighingStep) -> str:
        """Hold the joint and hang the weight; return the operator's answer."""
        self._hold(step)
        self._warned = False
        return self._weights.hang(step, self._attend_hold)

    # the robot

    def _hold(self, step: WeighingStep) -> None:
        """Hold with an empty arm, and a winding that is cool enough for the next weight."""
        if self._held is None or self._robot.call("status")["mode"] != "hold":
            self._held = None
            ask_to_clear_faults(self._robot, self._operator)
            self._weights.hold_level(self._attend_hold)
            self._cool(step)
            arm(self._robot, self._operator)
            self._weights.release(self._attend_hold)
            self._held = HeldJoint(self._robot, self._joint)
        elif not self._is_cool(step):
            self._weights.take_off()
            self._cool(step)

    def _is_cool(self, step: WeighingStep) -> bool:
        configuration, per_nm = self._robot.configuration, current_per_nm(self._plan, self._notebook.entries)
        expected_a = largest_current_a(self._plan, configuration, self._joint, step.weight_g)
        if per_nm is not None:
            expected_a = per_nm * self._plan.torque_nm(step.weight_g)
        return stays_cool(configuration, expected_a, self._winding_c(), READING_S + self._weights.handling_s)

    def _cool(self, step: WeighingStep) -> None:
        if self._is_cool(step):
            return
        self._operator.report(
            f"The {self._joint} winding has {self._winding_c():.0f} °C, too warm for {step.name}: waiting."
        )
        waited_s = 0.0
        while not self._is_cool(step):
            if waited_s > LONGEST_COOLING_S:
                raise BenchError(
                    f"the {self._joint} winding does not cool: check [winding] and the drive's temperature"
                )
            self._robot.wait(COOLING_S)
            waited_s += COOLING_S

    def _winding_c(self) -> float:
        drives = self._robot.call("status")["drives"]
        return float(next(drive["winding_c"] for drive in drives if drive["joint"] == self._joint))

    def _attend_hold(self) -> None:
        """Attend the robot during a prompt. Raises BenchError where it lets go."""
        self._attend()
        if self._held is not None:
            require_hold(self._robot.call("status"))

    def _attend(self) -> None:
        self._robot.wait(TICK_S)
        warm_c, winding_c = self._robot.configuration.limits.temperature_warm_c - COOL_K, self._winding_c()
        if not self._warned and winding_c > warm_c:
            self._warned = True
            self._operator.report(f"The {self._joint} winding has {winding_c:.0f} °C: a weight would fall soon.")
            self._weights.take_off()

    # readings

    def _read(self, step: WeighingStep) -> Entry | None:
        """Return the entry of the notebook; nothing where the weight is hung again."""
        assert self._held is not None
        trouble = ""
        for left in reversed(range(MOST_REPEATS)):
            try:
                reading = self._held.read()
            except MovedError as problem:
                trouble = str(problem)
            else:
                return self._checked(step, reading)
            answers = {GO_ON: "read it again", SKIP: "skip it"}
            question = f"{step.name} did not come to rest: {trouble}. Let it hang still and touch nothing."
            if not left or self._operator.ask(question, answers, self._attend_hold) == SKIP:
                break
        self._operator.report(f"{step.name} of trial {step.reported_trial} is left out: {trouble}.")
        return {"skipped": trouble}

    def _checked(self, step: WeighingStep, reading: Entry) -> Entry | None:
        """Ask about a reading of another weight, which may be repeated until there are MOST_REPEATS of them."""
        entries = self._notebook.entries
        mismatch = find_mismatch(self._plan, entries, step, reading["current_a"], self._constant_nm_a)
        if mismatch is None:
            loops = None if step.weight_g else self._measure_friction()
            return self._reported(step, reading | ({"loops": loops} if loops else {}))
        message, other_g = mismatch
        self._mismatches[step.key] += 1
        answers = {GO_ON: "read it again"} if self._mismatches[step.key] < MOST_REPEATS else {}
        answers[KEEP] = "keep it, marked as doubtful"
        if other_g is not None:
            answers[OTHER] = f"it was the {other_g:g} g"
        # the reading counts even if the robot lets go
        answer = self._operator.ask(f"{step.name}: {message}", answers, self._attend)
        if answer == OTHER and other_g is not None:
            other = replace(step, weight_g=other_g)
            if other.key in entries:
                self._operator.report(f"{other.name} of trial {other.trial} was read already and is not replaced.")
            else:
                self._notebook.write(other.key, self._reported(other, reading))
        elif answer == KEEP:
            return self._reported(step, reading | {"doubt": message})
        return None

    def _measure_friction(self) -> list[Entry]:
        """Return no loops of the empty arm where it does not swing freely: only friction is missing then."""
        assert self._held is not None
        try:
            return [loop._asdict() for loop in swing_arm(self._held)]
        except MovedError as problem:
            self._operator.report(f"friction was not measured this time: {problem}")
            return []

    def _reported(self, step: WeighingStep, entry: Entry) -> Entry:
        held_nm = self._constant_nm_a * entry["current_a"]
        self._operator.report(
            f"{self._joint}, trial {step.reported_trial}, {step.name}: {entry['current_a']:+.3f} A,"
            f" {held_nm:+.4f} N·m by the configured constant, at {degrees(entry['angle_rad']):+.2f} degrees"
        )
        return entry
