"""The actuator calibration of one joint (the paper's section II-B): a motor holds a weight level, again and again.

Each reading is in the notebook before the next weight is asked for, so whatever ends the work, the same plan goes on
behind it. A robot that lets go in the middle, after a fault or because nobody needed it for ten minutes, is told of in
its own words, armed again, and the weight read anew. Before a weight is asked for that the winding would not bear as
warm as it is, the empty arm waits; and where it gets warm while a weight hangs, the weight is to be taken off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import degrees
from typing import Any

from experiments.actuator.fit import current_per_nm
from experiments.actuator.friction import Loop, swing
from experiments.actuator.plan import COOL_K, READING_S, Plan, Step, largest_current_a, stays_cool, steps_of
from experiments.actuator.reading import HeldJoint, MovedError, Reading, WarmError
from experiments.actuator.uncertainty import Uncertainty, uncertainty_of
from experiments.actuator.weight_handling import Hand
from experiments.robot.bench_robot import BenchError, BenchRobot, arm, ask_to_clear_faults, require_hold
from experiments.robot.prompt import GO_ON, REDO, SKIP, Operator
from experiments.trials.notebook import Notebook
from firmware_host.operator.status_client import CallRefusedError

KEEP, OTHER = "k", "o"
MOST_FAULTS = 5  # of one weight
MOST_REPEATS = 3  # of one weight that does not come to rest, or does not fit
COOLING_S, LONGEST_COOLING_S = 1.0, 1800.0
TICK_S = 0.01  # of waiting for a person, in which the robot is attended

Show = Callable[[int, int], None]


class Calibration:
    """Owns the course of one joint's calibration."""

    def __init__(
        self, robot: BenchRobot, joint: str, plan: Plan, hand: Hand, operator: Operator, notebook: Notebook, show: Show
    ) -> None:
        self._robot = robot
        self._joint = joint
        self._plan = plan
        self._hand = hand
        self._operator = operator
        self._notebook = notebook
        self._show = show
        self._constant_nm_a = robot.configuration.drive[joint].torque_constant_nm_a
        self._steps = steps_of(plan)
        self._held: HeldJoint | None = None
        self._faults: dict[str, int] = {}
        self._uncertainties: dict[str, int] = {}
        self._warned = False

    def run(self) -> Mapping[str, Any]:
        """What was read, by the steps' keys. Raises BenchError where the robot is gone or cannot be armed."""
        place = 0
        while place < len(self._steps):
            self._show(place, len(self._steps))
            step = self._steps[place]
            if step.key not in self._notebook.entries and self._take(step) == REDO:
                place = self._one_back(place)
            elif step.key in self._notebook.entries:
                place += 1
        self._show(place, len(self._steps))
        return self._notebook.entries

    def _one_back(self, place: int) -> int:
        place = max(place - 1, 0)
        self._notebook.forget(self._steps[place].key)
        return place

    def _take(self, step: Step) -> str:
        """What the person answered. Unless the step is then in the notebook, it is to be taken again."""
        try:
            self._hold(step)
            self._warned = False
            answer = self._hand.hang(step, self._watch)
            if answer == SKIP:
                self._notebook.write(step.key, {"skipped": "on request"})
            elif answer == GO_ON:
                self._read(step)
        except WarmError as problem:
            self._count(step, problem)
            self._operator.report(f"{_named(step)} was not read: {problem}.")
            self._hand.take_off()
        except (BenchError, CallRefusedError) as problem:
            self._recover(step, problem)
        else:
            return answer
        return GO_ON

    def _count(self, step: Step, problem: Exception) -> None:
        """Raises the problem where it does not end."""
        self._faults[step.key] = self._faults.get(step.key, 0) + 1
        if self._faults[step.key] >= MOST_FAULTS:
            raise BenchError(f"{_named(step)} of {self._joint} cannot be read: {problem}") from problem

    # the robot

    def _hold(self, step: Step) -> None:
        """With torque on, an empty arm, and a winding that bears what comes."""
        if self._held is None or self._robot.call("status")["mode"] != "hold":
            self._held = None
            ask_to_clear_faults(self._robot, self._operator)
            self._hand.hold_level(self._joint, self._watch)
            self._cool(step)
            arm(self._robot, self._operator)
            self._hand.let_go(self._watch)
            self._held = HeldJoint(self._robot, self._joint)
        elif not self._is_cool(step):
            self._hand.take_off()
            self._cool(step)

    def _is_cool(self, step: Step) -> bool:
        hangs_s = READING_S + self._hand.lingers_s
        return stays_cool(self._robot.configuration, self._expected_a(step), self._winding_c(), hangs_s)

    def _expected_a(self, step: Step) -> float:
        """By what the weights so far have taken."""
        per_nm = current_per_nm(self._plan, self._notebook.entries)
        if per_nm is None:
            return largest_current_a(self._plan, self._robot.configuration, self._joint, step.weight_g)
        return per_nm * self._plan.torque_nm(step.weight_g)

    def _cool(self, step: Step) -> None:
        if self._is_cool(step):
            return
        self._operator.report(
            f"The {self._joint} winding has {self._winding_c():.0f} degrees C, too warm for {_named(step)}: waiting."
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

    def _watch(self) -> None:
        """While a person is waited for. Raises BenchError where the robot lets go meanwhile."""
        self._attend()
        if self._held is not None:
            require_hold(self._robot.call("status"))

    def _attend(self) -> None:
        self._robot.wait(TICK_S)
        warm_c, winding_c = self._robot.configuration.limits.temperature_warm_c - COOL_K, self._winding_c()
        if not self._warned and winding_c > warm_c:
            self._warned = True
            self._operator.report(f"The {self._joint} winding has {winding_c:.0f} degrees C: a weight would fall soon.")
            self._hand.take_off()

    def _recover(self, step: Step, problem: Exception) -> None:
        """From a robot that let go. Raises the problem where it is another."""
        status = self._robot.call("status")
        if status["mode"] == "hold":
            raise problem
        self._count(step, problem)
        self._operator.report(f"{_named(step)} was not read: {str(problem).rstrip('.')}.")
        self._hand.take_off()
        self._held = None

    # readings

    def _read(self, step: Step) -> None:
        reading = self._settled(step)
        if reading is None:
            return
        uncertainty = uncertainty_of(self._plan, self._notebook.entries, step, reading.current_a, self._constant_nm_a)
        if uncertainty is not None:
            self._ask_about(uncertainty, step, reading)
        elif step.weight_g:
            self._keep(step, reading)
        else:
            self._keep(step, reading, loops=self._swung())

    def _settled(self, step: Step) -> Reading | None:
        """None where it is left out."""
        assert self._held is not None
        trouble = ""
        for _ in range(MOST_REPEATS):
            try:
                return self._held.read()
            except MovedError as problem:
                trouble = str(problem)
            answers = {GO_ON: "read it again", SKIP: "skip it"}
            question = f"{_named(step)} did not come to rest: {trouble}. Let it hang still; nothing may touch it."
            if self._operator.ask(question, answers, self._watch) == SKIP:
                break
        self._notebook.write(step.key, {"skipped": trouble})
        self._operator.report(f"{_named(step)} of trial {step.reported_trial} is left out: {trouble}.")
        return None

    def _swung(self) -> Sequence[Loop]:
        """None where it does not swing freely, which costs friction alone."""
        assert self._held is not None
        try:
            return swing(self._held)
        except MovedError as problem:
            self._operator.report(f"friction was not measured this time: {problem}")
            return ()

    def _ask_about(self, uncertainty: Uncertainty, step: Step, reading: Reading) -> None:
        """Whoever only ever goes on does not go on for ever: it is kept as doubtful then."""
        answers = {GO_ON: "read it anew", KEEP: "keep it, marked as doubtful"}
        if uncertainty.other_g is not None:
            answers[OTHER] = f"it was the {uncertainty.other_g:g} g"
        self._uncertainties[step.key] = self._uncertainties.get(step.key, 0) + 1
        answer = self._operator.ask(
            f"{_named(step)}: {uncertainty.message}", answers, self._attend
        )  # a reading is at stake
        if answer == OTHER and uncertainty.other_g is not None:
            self._take_as(replace(step, weight_g=uncertainty.other_g), reading)
        elif answer == KEEP or self._uncertainties[step.key] >= MOST_REPEATS:
            self._keep(step, reading, uncertainty.message)

    def _take_as(self, step: Step, reading: Reading) -> None:
        if step.key in self._notebook.entries:
            self._operator.report(f"{_named(step)} of trial {step.trial} was read already, and stays as it is.")
        else:
            self._keep(step, reading)

    def _keep(self, step: Step, reading: Reading, uncertainty: str = "", loops: Sequence[Loop] = ()) -> None:
        self._notebook.write(step.key, entry_of(reading, uncertainty, loops))
        held_nm = self._constant_nm_a * reading.current_a
        self._operator.report(
            f"{self._joint}, trial {step.reported_trial}, {_named(step)}: {reading.current_a:+.3f} A,"
            f" {held_nm:+.4f} N·m by the configured constant, at {degrees(reading.angle_rad):+.2f} degrees"
        )


def entry_of(reading: Reading, uncertainty: str = "", loops: Sequence[Loop] = ()) -> dict[str, Any]:
    """As the notebook keeps it; loops are those of the empty arm."""
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
    return entry | ({"doubt": uncertainty} if uncertainty else {})


def _named(step: Step) -> str:
    return f"{step.weight_g:g} g" if step.weight_g else "the empty arm"
