"""Trials in mud, one after another: the bed is prepared, the robot walks, and the operator decides on invalid trials.

Each trial is in the notebook before the next begins, so an interruption costs the current trial only. A trial that a
fault ended, or that is invalid, is repeated, after the third time only if the operator wants it; a doubtful one is
kept or repeated as the operator decides. The notebook also has the trials that are left out, so that the same command
does not ask for them again. Torque is off whenever hands may be in the mud.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from experiments.reports.mud_names import mud_text
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import BenchRobot, ask_to_clear_faults, disarm, leave, rest
from experiments.robot.daemon_robot import DaemonRobot
from experiments.robot.steps import OperatorStep, conduct_steps
from experiments.study.notebook import Entry, Notebook
from experiments.study.option import OptionError
from experiments.study.prompt import GO_ON, REDO, SKIP, Operator
from experiments.study.session import Session
from experiments.trials.load_cell_truth import Truth
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.toml_records import parse_document
from simulation.mud.clay import clay_of_water

MOST_ATTEMPTS = 3  # of one trial, after which Enter ends the experiment
KEEP = "k"  # the key of an answer
POLL_S = 0.05  # of a prompt, in which the lease is renewed
PREPARED = {GO_ON: "go on", SKIP: "leave this trial out", REDO: "measure the last one again"}
INVALID = {GO_ON: "repeat it", SKIP: "leave it out"}
INVALID_OFTEN = {GO_ON: "end here", REDO: "repeat it", SKIP: "leave it out"}
KEPT = {KEEP: "keep it as it is"}
DOUBTFUL = {GO_ON: "keep it", REDO: "measure it again", SKIP: "leave it out"}

Truths = dict[int, Truth]  # by stride


class PlannedTrial(NamedTuple):
    key: str  # in the notebook
    group: str  # the mud or the gait whose trials are repetitions
    number: int  # from 1
    of: int  # trials of the group

    def __str__(self) -> str:
        return f"{mud_text(self.group)}, trial {self.number} of {self.of}"


class InvalidTrialError(Exception):
    """A trial is invalid; the text says why. The operator may keep the `entry` of one that was measured completely."""

    def __init__(self, why: str, entry: Entry | None = None) -> None:
        super().__init__(why)
        self.entry = entry


class Bench(NamedTuple):
    """The robot with its mud, its operator and its notebook."""

    robot: BenchRobot
    operator: Operator
    notebook: Notebook
    # levels fresh mud in front of the robot; returns GO_ON, SKIP this trial, or REDO the one before
    prepare: Callable[[PlannedTrial], str]
    # returns a load cell's readings in a flipper's strides of the last walk
    truths: Callable[[str], Truths] = lambda flipper: {}

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        return self.operator.ask(question, answers, partial(self.robot.wait, POLL_S))


def prepare_by_hand(
    robot: BenchRobot, operator: Operator, instructions: Callable[[PlannedTrial], str], trial: PlannedTrial
) -> str:
    """Let the operator level the mud, with torque off."""
    disarm(robot)
    ask_to_clear_faults(robot, operator)
    return operator.ask(f"{trial}. {instructions(trial)}", PREPARED, partial(robot.wait, POLL_S))


Measure = Callable[[PlannedTrial], Entry]  # raises InvalidTrialError, BenchError; an entry has "remarks"


def conduct_trials(
    bench: Bench, planned: Sequence[PlannedTrial], measure: Measure, show: Callable[[int, int], None]
) -> None:
    """Measure all trials that are not in the notebook. Raises BenchError where one cannot be measured."""
    attempts = Counter[str]()
    steps = [
        OperatorStep(trial.key, partial(bench.prepare, trial), partial(_measure_once, bench, trial, measure, attempts))
        for trial in planned
    ]
    conduct_steps(steps, bench.notebook, bench.operator, show, _left_out())


def _measure_once(bench: Bench, trial: PlannedTrial, measure: Measure, attempts: Counter[str]) -> Entry | None:
    """Return the trial's entry; nothing where it is repeated. Raises BenchError after too many attempts."""
    attempts[trial.key] += 1
    try:
        entry = measure(trial)
    except (InvalidTrialError, BenchError) as problem:
        rest(bench.robot)
        settled = _settle_invalid(bench, trial, problem, attempts[trial.key])
    else:
        rest(bench.robot)
        settled = _settle(bench, trial, entry)
    if settled is not None:
        del attempts[trial.key]
    return settled


def _settle(bench: Bench, trial: PlannedTrial, entry: Entry) -> Entry | None:
    for remark in entry["remarks"]:
        bench.operator.report(f"{trial}: {remark}")
    answer = bench.ask("Is this trial to count?", DOUBTFUL) if entry["remarks"] else GO_ON
    return {GO_ON: entry, SKIP: _left_out(entry["remarks"])}.get(answer)


def _settle_invalid(bench: Bench, trial: PlannedTrial, problem: Exception, attempt: int) -> Entry | None:
    """Leave an invalid trial out, or keep it."""
    entry = problem.entry if isinstance(problem, InvalidTrialError) else None
    often = attempt >= MOST_ATTEMPTS
    message = f"{trial} went wrong{f' {attempt} times; the last time' if often else ''}: {str(problem).rstrip('.')}."
    answer = bench.ask(message, (INVALID_OFTEN if often else INVALID) | ({} if entry is None else KEPT))
    if often and answer == GO_ON:
        raise BenchError(message) from problem
    if answer == KEEP and entry is not None:
        return entry | {"remarks": [*entry["remarks"], str(problem)]}
    return _left_out([str(problem)]) if answer == SKIP else None


def _left_out(why: Sequence[str] = ()) -> Entry:
    return {"skipped": True, "why": list(why)}


def require_named(muds: Sequence[str], session: Session, example: str) -> None:
    """Raises OptionError where no mud is named, and where one of them cannot be simulated in a simulated session."""
    if not muds:
        raise OptionError(f"no mud is named: give the muds {example}")
    try:
        [clay_of_water(float(mud)) for mud in muds if session.simulated]
    except ValueError as problem:
        raise OptionError(f"--mud: simulated muds are named after their water in percent: {problem}") from None


def open_bench(
    session: Session,
    plan: Entry,
    instructions: Callable[[PlannedTrial], str],
    simulated: Callable[[Notebook], Bench] | None = None,
    check: Callable[[Configuration], None] = lambda configuration: None,
) -> Bench:
    """Connect to the daemon's robot, or make a simulated one in a session without a daemon.

    `plan` has the options that must be the same when an experiment continues; so must be the program, and the daemon's
    version and configuration. `instructions` say how the operator prepares a trial. `check` raises BenchError for a
    daemon's configuration that does not fit.
    """
    plan = {**plan, **session.program}
    if session.socket is None:
        assert simulated is not None
        return simulated(Notebook(session.folder, plan))
    robot = DaemonRobot(session.socket)
    try:
        check(robot.configuration)
        daemon = {"version": robot.call("hello")["version"]}
        configuration = parse_document(robot.configuration.text)
        notebook = Notebook(session.folder, plan | {"daemon": daemon, "configuration": configuration})
    except BaseException:
        robot.close()
        raise
    return Bench(robot, session.operator, notebook, partial(prepare_by_hand, robot, session.operator, instructions))


class MeasuredTrials(NamedTuple):
    configuration: Configuration  # the robot's
    entries: dict[str, Entry]  # that count
    left_out: dict[str, Entry]
    logs: list[Path] = []


def run_trials(bench: Bench, session: Session, planned: Sequence[PlannedTrial], measure: Measure) -> MeasuredTrials:
    """Run the trials. The robot is left at rest, however they end. Raises BenchError where no entry counts."""
    try:
        configuration = bench.robot.configuration
        conduct_trials(bench, planned, measure, session.show)
    finally:
        logs = leave(bench.robot, session.operator, session.folder)
    return MeasuredTrials(configuration, counted_entries(bench.notebook), bench.notebook.left_out, logs)


def counted_entries(notebook: Notebook) -> dict[str, Entry]:
    """Return the trials that count. Raises BenchError where none does."""
    measured = {key: entry for key, entry in notebook.entries.items() if not entry.get("skipped")}
    if not measured:
        raise BenchError("nothing was measured: every trial was left out")
    return measured
