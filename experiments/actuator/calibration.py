"""The calibration of one joint (the paper's section II-B): a motor holds a weight level, again and again.

Each reading is in the notebook before the next weight is asked for, so the same plan continues after any interruption.
A robot that lets go, after a fault or after ten idle minutes, is reported with its own message and armed again, and the
weight is read again. The empty arm waits until the winding is cool enough for the next weight; where it gets warm while
a weight hangs, the operator takes the weight off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import degrees
from typing import Any

from experiments.actuator.fit import current_per_nm
from experiments.actuator.friction import Loop, swing_arm
from experiments.actuator.mismatch import Mismatch, find_mismatch
from experiments.actuator.plan import COOL_K, READING_S, Plan, Step, largest_current_a, stays_cool, steps_of
from experiments.actuator.reading import HeldJoint, MovedError, Reading, WarmError
from experiments.actuator.weight_handling import WeightHandler
from experiments.robot.bench_robot import BenchError, BenchRobot, arm, ask_to_clear_faults, require_hold
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trials.notebook import Notebook
from experiments.trials.session import Show
from firmware_host.operator.status_client import CallRefusedError

KEEP, OTHER = "k", "o"  # keys of answers
MOST_FAULTS = 5  # during the attempts at one weight
MOST_REPEATS = 3  # of one weight that does not come to rest, or does not match
COOLING_S, LONGEST_COOLING_S = 1.0, 1800.0  # period of the check, and time limit
TICK_S = 0.01  # of a prompt, in which the robot is attended


class Calibration:
    """Runs the calibration of one joint."""

    def __init__(
        self,
        robot: BenchRobot,
        joint: str,
        plan: Plan,
        weights: WeightHandler,
        operator: Operator,
        notebook: Notebook,
        show: Show,
    ) -> None:
        self._robot = robot
        self._joint = joint
        self._plan = plan
        self._weights = weights
        self._operator = operator
        self._notebook = notebook
        self._show = show
        self._constant_nm_a = robot.configuration.drive[joint].torque_constant_nm_a
        self._steps = steps_of(plan)
        self._held: HeldJoint | None = None
        self._faults: dict[str, int] = {}
        self._mismatches: dict[str, int] = {}
        self._warned = False

    def run(self) -> Mapping[str, Any]:
        """Return the readings by the steps' keys. Raises BenchError where the robot is lost or cannot be armed."""
        index = 0
        while index < len(self._steps):
            self._show(index, len(self._steps))
            step = self._steps[index]
            if step.key not in self._notebook.entries and self._measure(step) == REDO:
                index = max(index - 1, 0)
                self._notebook.forget(self._steps[index].key)
            elif step.key in self._notebook.entries:
                index += 1
        self._show(index, len(self._steps))
        return self._notebook.entries

    def _measure(self, step: Step) -> str:
        """Return the operator's answer. A step that is not in the notebook then is measured again."""
        try:
            self._hold(step)
            self._warned = False
            answer = self._weights.hang(step, self._attend_hold)
            if answer == SKIP:
                self._notebook.write(step.key, {"skipped": "on request"})
            elif answer == GO_ON:
                self._read(step)
        except WarmError as problem:
            self._count(step, problem)
            self._operator.report(f"{_name(step)} was not read: {problem}.")
            self._weights.take_off()
        except (BenchError, CallRefusedError) as problem:
            self._recover(step, problem)
        else:
            return answer
        return GO_ON

    def _count(self, step: Step, problem: Exception) -> None:
        """Raise the problem after too many of them."""
        self._faults[step.key] = self._faults.get(step.key, 0) + 1
        if self._faults[step.key] >= MOST_FAULTS:
            raise BenchError(f"{_name(step)} of {self._joint} cannot be read: {problem}") from problem

    # the robot

    def _hold(self, step: Step) -> None:
        """Hold with an empty arm, and a winding that is cool enough for the next weight."""
        if self._held is None or self._robot.call("status")["mode"] != "hold":
            self._held = None
            ask_to_clear_faults(self._robot, self._operator)
            self._weights.hold_level(self._joint, self._attend_hold)
            self._cool(step)
            arm(self._robot, self._operator)
            self._weights.release(self._attend_hold)
            self._held = HeldJoint(self._robot, self._joint)
        elif not self._is_cool(step):
            self._weights.take_off()
            self._cool(step)

    def _is_cool(self, step: Step) -> bool:
        hangs_s = READING_S + self._weights.handling_s
        return stays_cool(self._robot.configuration, self._expected_a(step), self._winding_c(), hangs_s)

    def _expected_a(self, step: Step) -> float:
        """Return the current by the readings so far."""
        per_nm = current_per_nm(self._plan, self._notebook.entries)
        if per_nm is None:
            return largest_current_a(self._plan, self._robot.configuration, self._joint, step.weight_g)
        return per_nm * self._plan.torque_nm(step.weight_g)

    def _cool(self, step: Step) -> None:
        if self._is_cool(step):
            return
        self._operator.report(
            f"The {self._joint} winding has {self._winding_c():.0f} °C, too warm for {_name(step)}: waiting."
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

    def _recover(self, step: Step, problem: Exception) -> None:
        """Recover from a robot that let go. Raises any other problem."""
        status = self._robot.call("status")
        if status["mode"] == "hold":
            raise problem
        self._count(step, problem)
        self._operator.report(f"{_name(step)} was not read: {str(problem).rstrip('.')}.")
        self._weights.take_off()
        self._held = None

    # readings

    def _read(self, step: Step) -> None:
        reading = self._read_at_rest(step)
        if reading is None:
            return
        mismatch = find_mismatch(self._plan, self._notebook.entries, step, reading.current_a, self._constant_nm_a)
        if mismatch is not None:
            self._ask_about_mismatch(mismatch, step, reading)
        elif step.weight_g:
            self._keep(step, reading)
        else:
            self._keep(step, reading, loops=self._measure_friction())

    def _read_at_rest(self, step: Step) -> Reading | None:
        """Return nothing for a step that is left out."""
        assert self._held is not None
        trouble = ""
        for _ in range(MOST_REPEATS):
            try:
                return self._held.read()
            except MovedError as problem:
                trouble = str(problem)
            answers = {GO_ON: "read it again", SKIP: "skip it"}
            question = f"{_name(step)} did not come to rest: {trouble}. Let it hang still and touch nothing."
            if self._operator.ask(question, answers, self._attend_hold) == SKIP:
                break
        self._notebook.write(step.key, {"skipped": trouble})
        self._operator.report(f"{_name(step)} of trial {step.reported_trial} is left out: {trouble}.")
        return None

    def _measure_friction(self) -> Sequence[Loop]:
        """Return no loops where the arm does not swing freely: only friction is missing then."""
        assert self._held is not None
        try:
            return swing_arm(self._held)
        except MovedError as problem:
            self._operator.report(f"friction was not measured this time: {problem}")
            return ()

    def _ask_about_mismatch(self, mismatch: Mismatch, step: Step, reading: Reading) -> None:
        """Ask again at most MOST_REPEATS times; then keep the reading as doubtful."""
        answers = {GO_ON: "read it again", KEEP: "keep it, marked as doubtful"}
        if mismatch.other_g is not None:
            answers[OTHER] = f"it was the {mismatch.other_g:g} g"
        self._mismatches[step.key] = self._mismatches.get(step.key, 0) + 1
        question = f"{_name(step)}: {mismatch.message}"
        answer = self._operator.ask(question, answers, self._attend)  # the reading counts even if the robot lets go
        if answer == OTHER and mismatch.other_g is not None:
            other = replace(step, weight_g=mismatch.other_g)
            if other.key in self._notebook.entries:
                self._operator.report(f"{_name(other)} of trial {step.trial} was read already and is not replaced.")
            else:
                self._keep(other, reading)
        elif answer == KEEP or self._mismatches[step.key] >= MOST_REPEATS:
            self._keep(step, reading, mismatch.message)

    def _keep(self, step: Step, reading: Reading, doubt: str = "", loops: Sequence[Loop] = ()) -> None:
        self._notebook.write(step.key, entry_of(reading, doubt, loops))
        held_nm = self._constant_nm_a * reading.current_a
        self._operator.report(
            f"{self._joint}, trial {step.reported_trial}, {_name(step)}: {reading.current_a:+.3f} A,"
            f" {held_nm:+.4f} N·m by the configured constant, at {degrees(reading.angle_rad):+.2f} degrees"
        )


def entry_of(reading: Reading, doubt: str = "", loops: Sequence[Loop] = ()) -> dict[str, Any]:
    """Return the notebook's entry; loops are those of the empty arm."""
    entry = {
        "current_a": reading.current_a,
        "rest_friction_a": reading.rest_friction_a,
        "angle_rad": reading.angle_rad,
        "winding_c": reading.winding_c,
        "at_s": reading.at_s,
        "below": reading.below._asdict(),
        "above": reading.above._asdict(),
    }
    entry |= {"loops": [loop._asdict() for loop in loops]} if loops else {}
    return entry | ({"doubt": doubt} if doubt else {})


def _name(step: Step) -> str:
    return f"{step.weight_g:g} g" if step.weight_g else "the empty arm"
