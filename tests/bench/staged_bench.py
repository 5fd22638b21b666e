"""The parts that the stages of the bench share: the test rig, the measured values, and the report of all stages."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

import pytest

from command_line.experiments.terminal_prompt import TerminalPrompt
from experiments.bench.measured_check import UnfinishedCheckError, measure_check
from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import EndedError
from tests.bench.bench_table import table_lines

STAGES = ("wiring", "zeros", "signs", "currents", "watchdogs", "strokes", "stops", "strides")
P = ParamSpec("P")
PASSED, FAILED, SKIPPED = "passed", "failed", "skipped"


def stage_of(path: Path) -> int:
    """Return the stage from the name of a file: 2 for test_2_zeros.py, 0 for other files."""
    number = path.stem.split("_")[1]
    return int(number) if number.isdigit() else 0


def claim_of(test: str) -> str:
    """Return the name of a test without its joint."""
    return test.partition("[")[0]


def stage_name(stage: int) -> str:
    return f"stage {stage}, {STAGES[stage - 1]}"


def reported_of_file(path: Path, problems: Iterable[str]) -> str:
    """List the problems of a file, each with its name once."""
    named = f"{path}: "
    return "\n".join(named + problem.removeprefix(named) for problem in problems)


class BenchReport:
    """Owns the results of all tests of the bench."""

    def __init__(self) -> None:
        self.robot: dict[str, Any] = {}
        self.tests: list[dict[str, Any]] = []
        self.consents: dict[int, bool] = {}  # by stage: whether the operator allows motion
        self.keeps_torque = ""  # why no further test may begin: a drive kept its torque
        self._test: dict[str, Any] | None = None  # under way

    def begin(self, stage: int, test: str) -> None:
        names = {"stage": stage, "name": STAGES[stage - 1], "test": test}
        self._test = names | {"outcome": PASSED, "why": "", "spoiled": [], "readings": []}

    def add(self, reading: BenchReading) -> None:
        """Add a reading of the running test."""
        if self._test is not None:
            self._test["readings"].append(reading)

    def note_repeat(self, why: str) -> None:
        """Record readings of the running test that were out of bounds before it was repeated."""
        if self._test is not None:
            self._test["spoiled"].append(why)

    def worsen(self, outcome: str, why: str) -> None:
        """Set the outcome of the running test; the first one remains."""
        if self._test is not None and self._test["outcome"] == PASSED:
            self._test |= {"outcome": outcome, "why": why}

    def end(self) -> None:
        """End the running test, if there is one."""
        if self._test is not None:
            self.tests.append(self._test)
        self._test = None

    def outcome_of(self, stage: int) -> str:
        """Return PASSED only if all tests of the stage were run and passed."""
        outcomes = [test["outcome"] for test in self.tests if test["stage"] == stage]
        if FAILED in outcomes:
            return FAILED
        return PASSED if outcomes and SKIPPED not in outcomes else SKIPPED

    def obstacle(self, stage: int) -> str:
        """Return why a stage may not begin; empty where it may."""
        if self.keeps_torque:
            return self.keeps_torque
        for earlier in range(1, stage):
            outcome = self.outcome_of(earlier)
            if outcome == FAILED:
                return f"{stage_name(earlier)}, failed: fix that first"
            if outcome == SKIPPED:
                return f"{stage_name(earlier)}, was not passed in this run: the stages run one after the other"
        return ""

    def own_obstacle(self, stage: int, test: str) -> str:
        """Return why a stage that moves something may not continue with this test; empty where it may.

        The same claim for another joint may still be tested: it gives more information and moves only that joint.
        """
        for earlier in self.tests:
            if (earlier["stage"], earlier["outcome"]) == (stage, FAILED) and claim_of(earlier["test"]) != claim_of(
                test
            ):
                return f"{earlier['test']} failed: fix that before anything else moves"
        return ""

    @property
    def as_json(self) -> dict[str, Any]:
        tests = [test | {"readings": [reading.as_json for reading in test["readings"]]} for test in self.tests]
        stages = {name: self.outcome_of(number) for number, name in enumerate(STAGES, 1)}
        return {**self.robot, "stages": stages, "tests": tests}

    def write(self, path: Path) -> None:
        """Raises OSError."""
        path.write_text(json.dumps(self.as_json, indent=1, allow_nan=False) + "\n", encoding="utf-8")

    def lines(self, brief: bool) -> Iterator[tuple[str, bool]]:
        """Yield the lines of the report, and whether each is good. `brief` leaves out good readings."""
        for number, name in enumerate(STAGES, 1):
            readings = [reading for test in self.tests if test["stage"] == number for reading in test["readings"]]
            yield from table_lines(f"stage {number}, {name}", [each for each in readings if not (brief and each.good)])
        for test in self.tests:
            yield from ((f"{test['test']}, before it was repeated: {why}", True) for why in test["spoiled"])
        for number, name in enumerate(STAGES, 1):
            outcome = self.outcome_of(number)
            reported = self._reason(number) if outcome == SKIPPED else self._omissions(number)
            yield f"stage {number}, {name}: {outcome}{reported}", outcome == PASSED

    def _reason(self, stage: int) -> str:
        """Return the first reason why tests of the stage were skipped."""
        reasons = [test["why"] for test in self.tests if (test["stage"], test["outcome"]) == (stage, SKIPPED)]
        return f": {reasons[0]}" if reasons else ""

    def _omissions(self, stage: int) -> str:
        """Count the checks that were left out without an operator."""
        of_stage = [test for test in self.tests if test["stage"] == stage]
        count = sum(reading.left_out for test in of_stage for reading in test["readings"])
        return f", without {count} checks that were left out" if count else ""


class StagedBench:
    """The test rig and the report, for one test of the bench."""

    def __init__(self, test_rig: TestRig, report: BenchReport) -> None:
        self.test_rig = test_rig
        self.report = report

    def check(
        self, measure: Callable[Concatenate[TestRig, P], BenchReadings], *arguments: P.args, **named: P.kwargs
    ) -> None:
        """Record the readings, and fail with a message for each one out of bounds.

        A check that late ticks or messages may have disturbed is repeated, and the report lists the first result; if
        they occur again, the failure says so.
        """
        try:
            measured = measure_check(self.test_rig, measure, *arguments, **named)
        except UnfinishedCheckError as problem:
            self._add(problem.readings)
            raise
        for repeat in measured.repeats:
            self.report.note_repeat(repeat)
        self._add(measured.readings)
        if measured.problem:
            pytest.fail(measured.problem, pytrace=False)

    def _add(self, readings: Iterable[BenchReading]) -> None:
        for reading in readings:
            self.report.add(reading)


class UncapturedOperator:
    """A prompt on the terminal, with pytest's capturing suspended."""

    def __init__(self, config: pytest.Config) -> None:
        self._capture = config.pluginmanager.getplugin("capturemanager")
        self._operator = TerminalPrompt()

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        with self._on_terminal():
            return self._operator.ask(f"\n{question}", answers, meanwhile)

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        with self._on_terminal():
            return self._operator.ask_number(f"\n{question}", low, high, meanwhile)

    def report(self, message: str) -> None:
        with self._on_terminal():
            self._operator.report(f"\n{message}")

    @contextmanager
    def _on_terminal(self) -> Iterator[None]:
        if self._capture is None:
            yield
            return
        self._capture.suspend(in_=True)
        try:
            yield
        except EndedError as problem:
            pytest.skip(str(problem))
        finally:
            self._capture.resume()
