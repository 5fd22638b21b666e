"""What the stages of the bench share: the stand, the figures they measure, and the report of all of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

import pytest

from command_line.experiments.terminal_prompt import TerminalPrompt
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Stand
from experiments.robot.bench_errors import EndedError
from experiments.robot.bench_robot import BenchError
from tests.bench.bench_table import table_lines

STAGES = ("wiring", "signs", "zeros", "currents", "watchdogs", "strokes", "stops", "strides")
MOST_MEASURED = 3  # times, one claim
P = ParamSpec("P")
PASSED, FAILED, SKIPPED = "passed", "failed", "skipped"


def stage_of(path: Path) -> int:
    """By the name of its file: test_3_zeros.py is of stage 3. Other files are of none: 0."""
    number = path.stem.split("_")[1]
    return int(number) if number.isdigit() else 0


def claim_of(test: str) -> str:
    """Its name without the joint."""
    return test.partition("[")[0]


def stage_name(stage: int) -> str:
    return f"stage {stage}, {STAGES[stage - 1]}"


def reported_of_file(path: Path, problems: Iterable[str]) -> str:
    """Each behind the file's name, once."""
    named = f"{path}: "
    return "\n".join(named + problem.removeprefix(named) for problem in problems)


class BenchReport:
    """Owns what every test of the bench came to."""

    def __init__(self) -> None:
        self.robot: dict[str, Any] = {}
        self.tests: list[dict[str, Any]] = []
        self.consents: dict[int, bool] = {}  # by stage: whether a person lets the robot move
        self.out_of_hand = ""  # why no test may begin any more: a drive kept its torque
        self._test: dict[str, Any] | None = None  # under way

    def begin(self, stage: int, test: str) -> None:
        names = {"stage": stage, "name": STAGES[stage - 1], "test": test}
        self._test = names | {"outcome": PASSED, "why": "", "spoiled": [], "readings": []}

    def keep(self, reading: Reading) -> None:
        """Of the test under way."""
        if self._test is not None:
            self._test["readings"].append(reading)

    def spoil(self, why: str) -> None:
        """What was out of its bounds in the test under way before it was measured anew."""
        if self._test is not None:
            self._test["spoiled"].append(why)

    def worsen(self, outcome: str, why: str) -> None:
        """What was told first of the test under way remains."""
        if self._test is not None and self._test["outcome"] == PASSED:
            self._test |= {"outcome": outcome, "why": why}

    def end(self) -> None:
        """The test under way, if there is one."""
        if self._test is not None:
            self.tests.append(self._test)
        self._test = None

    def outcome_of(self, stage: int) -> str:
        """Passed only where all of its tests were run and passed."""
        outcomes = [test["outcome"] for test in self.tests if test["stage"] == stage]
        if FAILED in outcomes:
            return FAILED
        return PASSED if outcomes and SKIPPED not in outcomes else SKIPPED

    def obstacle(self, stage: int) -> str:
        """Why a stage may not begin; empty where it may."""
        if self.out_of_hand:
            return self.out_of_hand
        for earlier in range(1, stage):
            outcome = self.outcome_of(earlier)
            if outcome == FAILED:
                return f"{stage_name(earlier)}, failed: mend that first"
            if outcome == SKIPPED:
                return f"{stage_name(earlier)}, was not passed in this run: the stages go one after the other"
        return ""

    def stumble(self, stage: int, test: str) -> str:
        """Why a stage that moves something may not go on with this test; empty where it may.

        The same claim about another joint may still be tried: it tells more, and moves that joint alone.
        """
        for earlier in self.tests:
            if (earlier["stage"], earlier["outcome"]) == (stage, FAILED) and claim_of(earlier["test"]) != claim_of(
                test
            ):
                return f"{earlier['test']} failed: mend that before anything else moves"
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
        """Of a table, with whether all is well there. `brief`: of the figures only those that are not."""
        for number, name in enumerate(STAGES, 1):
            readings = [reading for test in self.tests if test["stage"] == number for reading in test["readings"]]
            yield from table_lines(f"stage {number}, {name}", [each for each in readings if not (brief and each.good)])
        for test in self.tests:
            yield from ((f"{test['test']}, before it was measured anew: {why}", True) for why in test["spoiled"])
        for number, name in enumerate(STAGES, 1):
            outcome = self.outcome_of(number)
            reported = self._reason(number) if outcome == SKIPPED else self._omissions(number)
            yield f"stage {number}, {name}: {outcome}{reported}", outcome == PASSED

    def _reason(self, stage: int) -> str:
        """What was told first; why a test failed stands above."""
        reasons = [test["why"] for test in self.tests if (test["stage"], test["outcome"]) == (stage, SKIPPED)]
        return f": {reasons[0]}" if reasons else ""

    def _omissions(self, stage: int) -> str:
        """What nobody was there for is no part of what was passed."""
        of_stage = [test for test in self.tests if test["stage"] == stage]
        count = sum(reading.left_out for test in of_stage for reading in test["readings"])
        return f", without {count} checks that need a person" if count else ""


class StagedBench:
    """What a test of the bench is given."""

    def __init__(self, stand: Stand, report: BenchReport) -> None:
        self.stand = stand
        self.report = report

    def check(self, measure: Callable[Concatenate[Stand, P], Readings], *arguments: P.args, **named: P.kwargs) -> None:
        """Keep what it measures, and fail with a sentence for each reading that is out of its bounds.

        What late ticks or messages may have spoiled is measured anew, and the report keeps what it was; where they come
        again, the failure says so.
        """
        for left in reversed(range(MOST_MEASURED)):
            readings = self._readings(measure(self.stand, *arguments, **named))
            late = self.stand.lateness.message
            wrong = [reading.message for reading in readings if not reading.good]
            if not (wrong and late and left):
                break
            self.report.spoil(" ".join([*wrong, late]))
        for reading in readings:
            self.report.keep(reading)
        if wrong:
            pytest.fail("\n".join([*wrong, late]).rstrip(), pytrace=False)

    def _readings(self, measured: Readings) -> list[Reading]:
        self.stand.lateness.reset()
        reported: list[Reading] = []
        try:
            for reading in measured:
                reported.append(reading)
        except BenchError as problem:
            for reading in reported:
                self.report.keep(reading)
            raise BenchError(f"{problem} {self.stand.lateness.message}".rstrip()) from None
        return reported


class UncapturedOperator:
    """A person on the terminal, from whom pytest holds neither questions nor answers back."""

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
