"""Trials run one after another: none is lost, none counts twice, and the operator decides about doubtful ones."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from experiments.robot.bench_errors import BenchError, EndedError
from experiments.robot.bench_robot import CLEAR, LEAVE, leave
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.study.notebook import Entry, Notebook, NotebookError
from experiments.study.prompt import GO_ON, REDO, SKIP
from experiments.study.session import Session
from experiments.trials import mud_trials
from experiments.trials.mud_trials import (
    KEEP,
    Bench,
    InvalidTrialError,
    PlannedTrial,
    conduct_trials,
    counted_entries,
    open_bench,
    prepare_by_hand,
)
from tests.experiments.still_robot import StillRobot
from tests.scripted_operator import ScriptedOperator

TRIALS = [PlannedTrial(f"47.6/{number}", "47.6", number, 3) for number in (1, 2, 3)]
PLAN = {"experiment": "synthetic"}


class AskedRobot(StillRobot):
    """A BenchRobot that only records the methods that were called."""

    def __init__(self) -> None:
        super().__init__("idle")
        self.called: list[str] = []
        self.blocked = self.deaf = False

    def call(self, method: str, **params: Any) -> Any:
        if self.deaf:
            raise BenchError("the daemon does not answer")
        self.called.append(method)
        if method in ("disarm", "stop"):
            self.mode = "idle"
        self.blocked = self.blocked and method != "clear"
        reported = {"message": "A drive is silent.", "age_s": 150.0, "what_to_do": "check it", "blocks_arming": True}
        faults = [reported] if self.blocked else []
        return {"mode": self.mode, "now_s": self.now_s, "faults": faults} if method == "status" else "accepted"


ALL = [trial.key for trial in TRIALS]
FAULT = BenchError("the walk ended early: a drive is silent.")
MOVED = InvalidTrialError("the base moved by 113 mm", {"remarks": []})
DOUBTFUL = {"remarks": ["the base moved by 5.0 mm"]}
FIRST = "47.6 %, trial 1 of 3"


class ScriptedTrials:
    """Owns a bench of scripted parts; its measurements give the listed outcomes."""

    def __init__(
        self,
        folder: Path,
        outcomes: Sequence[Entry | BaseException] = (),
        answers: Sequence[str] = (),
        prepared: Sequence[str] = (),
    ) -> None:
        """`prepared` are the answers of the operator who prepares the mud."""
        self.robot, self.operator = AskedRobot(), ScriptedOperator(*answers)
        self.notebook = Notebook(folder, PLAN)
        self.bench = Bench(self.robot, self.operator, self.notebook, self.prepare)
        self.outcomes, self.answers = list(outcomes), list(prepared)
        self.prepared: list[str] = []
        self.measured: list[str] = []
        self.shown: list[tuple[int, int]] = []

    def prepare(self, trial: PlannedTrial) -> str:
        self.prepared.append(trial.key)
        return self.answers.pop(0) if self.answers else GO_ON

    def measure(self, trial: PlannedTrial) -> Entry:
        self.measured.append(trial.key)
        outcome = self.outcomes.pop(0) if self.outcomes else {"remarks": [], "count": len(self.measured)}
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    def conduct(self) -> ScriptedTrials:
        conduct_trials(self.bench, TRIALS, self.measure, lambda done, of: self.shown.append((done, of)))
        return self


def test_every_trial_is_prepared_measured_and_written(tmp_path: Path) -> None:
    session = ScriptedTrials(tmp_path).conduct()
    assert session.prepared == session.measured == list(session.notebook.entries) == ALL
    assert session.shown == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert session.robot.called.count("disarm") == len(TRIALS)


def test_an_interrupted_experiment_continues(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        ScriptedTrials(tmp_path, [{"remarks": []}, KeyboardInterrupt()]).conduct()
    second = ScriptedTrials(tmp_path).conduct()
    assert second.prepared == second.measured == ALL[1:]


@pytest.mark.parametrize(
    ("outcomes", "answers", "asked", "measured", "kept"),
    [
        ([FAULT], [], f"{FIRST} went wrong: the walk ended early: a drive is silent.", [ALL[0], *ALL], ALL),
        ([MOVED], [GO_ON], f"{FIRST} went wrong: the base moved by 113 mm.", [ALL[0], *ALL], ALL),
        ([MOVED], [KEEP], f"{FIRST} went wrong: the base moved by 113 mm.", ALL, ALL),
        ([DOUBTFUL], [GO_ON], "Is this trial to count?", ALL, ALL),
        ([DOUBTFUL], [SKIP], "Is this trial to count?", ALL, ALL[1:]),
        ([DOUBTFUL], [REDO], "Is this trial to count?", [ALL[0], *ALL], ALL),
        ([MOVED] * 3, [GO_ON, GO_ON, REDO], f"{FIRST} went wrong 3 times", [ALL[0]] * 3 + ALL, ALL),
        ([MOVED] * 3, [GO_ON, GO_ON, SKIP], f"{FIRST} went wrong 3 times", [ALL[0]] * 3 + ALL[1:], ALL[1:]),
    ],
)
def test_the_operator_decides_on_invalid_and_doubtful_trials(
    outcomes: list[Entry], answers: list[str], asked: str, measured: list[str], kept: list[str], tmp_path: Path
) -> None:
    session = ScriptedTrials(tmp_path, outcomes, answers).conduct()
    assert session.operator.asked[-1].startswith(asked)
    assert session.operator.reported == ([f"{FIRST}: the base moved by 5.0 mm"] if outcomes == [DOUBTFUL] else [])
    assert session.prepared == session.measured == measured
    counted = counted_entries(session.notebook)
    assert list(counted) == kept
    if answers == [KEEP]:
        assert counted[ALL[0]]["remarks"] == ["the base moved by 113 mm"]


def test_a_third_failure_ends_the_experiment_unless_the_operator_repeats_it(tmp_path: Path) -> None:
    session = ScriptedTrials(tmp_path, [{"remarks": []}, *[MOVED] * 3])
    with pytest.raises(BenchError, match="trial 2 of 3 went wrong 3 times"):
        session.conduct()
    assert list(session.notebook.entries) == ALL[:1]


def test_a_trial_that_is_left_out_is_written_down_and_not_asked_for_again(tmp_path: Path) -> None:
    session = ScriptedTrials(tmp_path, prepared=(GO_ON, SKIP)).conduct()
    assert list(counted_entries(session.notebook)) == [ALL[0], ALL[2]]
    again = ScriptedTrials(tmp_path).conduct()
    assert again.prepared == [] and again.notebook.left_out == {ALL[1]: {"skipped": True, "why": []}}


def test_the_last_trial_can_be_measured_again(tmp_path: Path) -> None:
    session = ScriptedTrials(tmp_path, prepared=(GO_ON, REDO)).conduct()
    assert session.measured == [ALL[0], ALL[0], ALL[1], ALL[2]]
    assert session.notebook.entries[ALL[0]]["count"] == 2


def test_an_experiment_without_any_result_ends_with_a_message(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="nothing was measured"):
        counted_entries(ScriptedTrials(tmp_path, prepared=(SKIP, SKIP, SKIP)).conduct().notebook)


@pytest.mark.parametrize("answer", [CLEAR, LEAVE])
def test_the_operator_decides_on_a_fault_before_levelling_the_mud(answer: str) -> None:
    robot, operator = AskedRobot(), ScriptedOperator(answer)
    robot.blocked = True
    prepare = partial(prepare_by_hand, robot, operator, lambda trial: "Level it", TRIALS[0])
    if answer == CLEAR:
        assert prepare() == GO_ON
    else:
        with pytest.raises(EndedError, match="mudskipper clear"):
            prepare()
    assert "A drive is silent. (for 2 min)\n    -> check it" in operator.asked[0]
    assert robot.called.count("clear") == (answer == CLEAR) and len(operator.asked) == 1 + (answer == CLEAR)


def test_a_robot_that_walks_on_is_stopped_before_anybody_is_asked(tmp_path: Path) -> None:
    session = ScriptedTrials(tmp_path, [MOVED])
    session.robot.mode = "walking"
    assert session.conduct().robot.called[:2] == ["status", "stop"]


def test_a_robot_that_no_longer_answers_is_left_with_a_message(tmp_path: Path) -> None:
    session = ScriptedTrials(tmp_path)
    session.robot.deaf = True
    (tmp_path / "old.mcap").touch()
    assert leave(session.bench.robot, session.bench.operator, tmp_path) == [tmp_path / "old.mcap"]
    assert session.operator.reported == ["the daemon does not answer"]
    assert session.robot.closed


class DaemonsRobot(AskedRobot):
    """The robot of a daemon of some version and configuration."""

    def __init__(self, version: str, sections: str) -> None:
        super().__init__()
        self.configuration = simulated_configuration(sections)
        self.version = version

    def call(self, method: str, **params: Any) -> Any:
        return {"version": self.version} if method == "hello" else super().call(method, **params)


def test_another_configuration_or_daemon_of_a_real_robot_is_refused_and_the_robot_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots: list[DaemonsRobot] = []

    def opened(version: str = "0.2", sections: str = "") -> Notebook:
        robots.append(DaemonsRobot(version, sections))
        monkeypatch.setattr(mud_trials, "DaemonRobot", lambda socket: robots[-1])
        session = Session(tmp_path, ScriptedOperator(), lambda done, total: None, Path("socket"))
        return open_bench(session, PLAN, str).notebook

    opened().write("47.6/1", {})
    stiffness = "sweep_stiffness_nm_rad"
    for version, sections, key in (
        ("0.3", "", "daemon.version = 0.2"),
        ("0.2", f"[gains]\n{stiffness} = 9.0", f"configuration.gains.{stiffness} = (none)"),
    ):
        with pytest.raises(NotebookError) as refused:
            opened(version, sections)
        assert key in str(refused.value)
    assert list(opened(sections="# a comment\n").entries) == ["47.6/1"]
    assert [robot.closed for robot in robots] == [False, True, True, False]
