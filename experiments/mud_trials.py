"""Trials in mud, one after another: the bed is prepared, the robot strides, and a person says what to do where it went
wrong.

Each trial is in the notebook before the next begins, so whatever ends an experiment costs the trial under way and no
other. A trial that a fault ended, or that said nothing, is repeated, after the third time only where a person wants it
so; one that is only doubtful is kept or repeated as they decide. Torque is off whenever hands may be in the mud.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, Protocol

from experiments.bench_robot import BenchError, BenchRobot, disarm, face_faults, rest
from experiments.notebook import Entry, Notebook
from experiments.person import GO_ON, REDO, SKIP, Person

MOST_ATTEMPTS = 3
LOOK_S = 0.05  # of waiting for a person, in which nobody else arms the robot
ASKED = {GO_ON: "go on", SKIP: "leave this trial out", REDO: "measure the last one again"}
SPOILT = {GO_ON: "repeat it", SKIP: "leave it out"}
SPOILT_OFTEN = {GO_ON: "end here", REDO: "repeat it", SKIP: "leave it out"}
DOUBTFUL = {GO_ON: "keep it", REDO: "measure it again", SKIP: "leave it out"}

Truths = dict[int, dict[str, float | None]]  # N/m³ by stride and coefficient


class PlannedTrial(NamedTuple):
    key: str  # in the notebook
    mud: str
    number: int  # from 1
    of: int

    def __str__(self) -> str:
        return f"{self.mud}, trial {self.number} of {self.of}"


class SpoiltTrialError(Exception):
    """A trial says nothing; the text says why."""


class MudBed(Protocol):
    """The mud under the robot."""

    def prepare(self, trial: PlannedTrial) -> str:
        """Fresh mud in front of the robot: GO_ON, SKIP this trial, or REDO the one before."""

    def truths(self, flipper: str) -> Truths:
        """What a load cell reads in the strides of the last walk; empty where there is none."""


class PromptedBed:
    """A person's: asked for each trial, with torque off."""

    def __init__(self, robot: BenchRobot, person: Person, words: Callable[[PlannedTrial], str]) -> None:
        self._robot = robot
        self._person = person
        self._words = words

    def prepare(self, trial: PlannedTrial) -> str:
        disarm(self._robot)
        face_faults(self._robot, self._person)
        return self._person.ask(f"{trial}. {self._words(trial)}", ASKED, partial(self._robot.wait, LOOK_S))

    def truths(self, flipper: str) -> Truths:
        return {}


class Bench(NamedTuple):
    """Where trials are made, and where they are written down."""

    robot: BenchRobot
    bed: MudBed
    person: Person
    notebook: Notebook


Measure = Callable[[PlannedTrial], Entry]  # raises SpoiltTrialError, BenchError; an entry has "remarks"


def conduct_trials(
    bench: Bench, planned: Sequence[PlannedTrial], measure: Measure, show: Callable[[int, int], None]
) -> None:
    """All that are not in the notebook yet. Raises BenchError where one cannot be measured."""
    entries, place, attempts = bench.notebook.entries, 0, 0
    while place < len(planned):
        trial = planned[place]
        show(sum(each.key in entries for each in planned), len(planned))
        answer = SKIP if trial.key in entries else bench.bed.prepare(trial)
        if answer == REDO:
            place = _forget_last(bench, planned[:place])
        elif answer == SKIP or _is_done(bench, trial, measure, attempts + 1):
            place, attempts = place + 1, 0
        else:
            attempts += 1
    show(len(planned), len(planned))


def _forget_last(bench: Bench, before: Sequence[PlannedTrial]) -> int:
    """The place of the last one that was measured, which is open again."""
    for place in reversed(range(len(before))):
        if before[place].key in bench.notebook.entries:
            bench.notebook.forget(before[place].key)
            return place
    bench.person.tell("nothing was measured before this one")
    return len(before)


def _is_done(bench: Bench, trial: PlannedTrial, measure: Measure, attempt: int) -> bool:
    """Measured, or left out. Raises BenchError after too many attempts."""
    attend = partial(bench.robot.wait, LOOK_S)
    try:
        entry = measure(trial)
    except (SpoiltTrialError, BenchError) as problem:
        rest(bench.robot)
        often = attempt >= MOST_ATTEMPTS
        told = f"{trial} went wrong{f' {attempt} times; the last time' if often else ''}: {str(problem).rstrip('.')}."
        answer = bench.person.ask(told, SPOILT_OFTEN if often else SPOILT, attend)
        if often and answer == GO_ON:
            raise BenchError(told) from problem
        return answer == SKIP
    rest(bench.robot)
    for remark in entry["remarks"]:
        bench.person.tell(f"{trial}: {remark}")
    answer = bench.person.ask("Is this trial to count?", DOUBTFUL, attend) if entry["remarks"] else GO_ON
    if answer == GO_ON:
        bench.notebook.write(trial.key, entry)
    return answer != REDO


def require_some(notebook: Notebook) -> None:
    """Raises BenchError for an experiment that has nothing to report."""
    if not notebook.entries:
        raise BenchError("nothing was measured: every trial was left out")
