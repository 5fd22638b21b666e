"""Table I through the daemon's calls: every trial counts once, stops where it should, and stays in the notebook."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from control.modes import Mode
from control.rate import PERIOD_S
from experiments.reports.report_page import to_json
from experiments.robot.bench_robot import BenchError, arm
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.robot.prompt import GO_ON, REDO, SKIP
from experiments.trackway.bench import (
    KEEP,
    UNSEEN_S,
    LoggedWalk,
    Mud,
    Plan,
    Progress,
    PromptedTrackway,
    first_walks,
    report_of,
    run,
    trial_text,
    walk_over,
)
from experiments.trackway.plots import plot_trackway
from experiments.trackway.text import trackway_text
from experiments.trackway.walk import StrideRecord, Walk, WalkedStride
from experiments.trials.notebook import Notebook
from firmware_host.log.file_recorder import FileRecorder
from firmware_host.log_reading.log_reader import read_log
from simulation.devices.motion_capture import AT_EVERY_TICK, MotionCaptureParameters
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.scripted_operator import ScriptedOperator

SHORT = Plan((Mud("48.5", 0.3), Mud("53.1", 0.3)), trials=1, depths_m=(0.03,))
TINY = Plan((Mud("48.5", 0.15),), trials=1, depths_m=(0.03,))


class SimulatedTrackway:
    """A robot of its own for each trial, and an operator with scripted verdicts."""

    def __init__(self, folder: Path, verdicts: Iterator[str], capture: MotionCaptureParameters = AT_EVERY_TICK) -> None:
        self.folder, self.verdicts, self.capture = folder, verdicts, capture
        self.prepared: list[str] = []
        self.reported: list[str] = []
        self.truth: list[StrideRecord] = []

    def prepare(self, trial: str) -> LockstepRobot:
        self.prepared.append(trial)
        configuration = simulated_configuration()
        recorder = FileRecorder(self.folder / f"{len(self.prepared)}.mcap", configuration)
        track = Track([(mud.length_m, MUDS[mud.name]) for mud in SHORT.muds])
        lockstep = Lockstep(configuration, track, recorder=recorder, motion_capture=self.capture)
        self.truth.append(StrideRecord(lockstep, track))
        return WatchedRobot(lockstep, recorder, self.truth[-1])

    def evaluate(self, reported: str, stopped: bool) -> str:
        self.reported.append(reported)
        return next(self.verdicts)


class WatchedRobot(LockstepRobot):
    """A robot that records the plant's strides once a tick."""

    def __init__(self, lockstep: Lockstep, recorder: FileRecorder, truth: StrideRecord) -> None:
        super().__init__(lockstep, recorder)
        self._truth = truth

    def wait(self, duration_s: float) -> None:
        for _ in range(round(duration_s / PERIOD_S)):
            self.lockstep.step()
            self._truth.update()


class LevellingOperator(ScriptedOperator):
    """Asserts that the robot cannot move while hands are in the mud."""

    def __init__(self, robot: LockstepRobot) -> None:
        super().__init__()
        self.robot = robot

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        assert self.robot.call("status")["mode"] == "idle"
        return super().ask(question, answers, meanwhile)


def test_torque_is_off_while_the_operator_levels_the_mud(tmp_path: Path) -> None:
    robot = SimulatedTrackway(tmp_path, always(GO_ON)).prepare("any")
    arm(robot)
    operator = LevellingOperator(robot)
    PromptedTrackway(robot, operator).prepare("3 cm, trial 1 of 3")
    assert operator.asked == [
        "3 cm, trial 1 of 3. Torque is off: level the mud, and put the sweep axes over the beginning of the first mud."
        " Take your hands away: the robot walks next"
    ]
    robot.close()


def always(verdict: str) -> Iterator[str]:
    while True:
        yield verdict


def silent(done: int, total: int) -> None:
    """Show no progress."""


def test_the_table_from_the_log_is_that_of_the_plant(tmp_path: Path) -> None:
    trackway = SimulatedTrackway(tmp_path, always(GO_ON))
    report = run(SHORT, trackway, Notebook(tmp_path, {}), silent)
    assert trackway.prepared == ["3 cm, trial 1 of 1", "adaptive, trial 1 of 1"]
    assert [reported.partition(": ")[0] for reported in trackway.reported] == trackway.prepared
    assert {tuple(ends) for ends in report.ends.values()} == {("past the end",)}
    for rule, record in zip(("3 cm", "adaptive"), trackway.truth, strict=True):
        reported, true = report.walks[rule][0], [stride for stride in record.strides if stride.position_m < 0.6]
        assert len(reported) == len(true) >= 5
        for stride, truth in zip(reported, true, strict=True):
            assert stride.mud == truth.mud
            assert stride.step_cm == pytest.approx(100.0 * truth.step_m, abs=0.05)
            assert stride.duration_s == pytest.approx(truth.duration_s, abs=0.01)
    json.dumps(to_json(report), allow_nan=False)
    plot_trackway(report, tmp_path / "trackway.png")
    assert "Table I" in trackway_text(report)


def test_a_repeated_trial_counts_once_a_skipped_one_never_and_a_continued_experiment_repeats_none(
    tmp_path: Path,
) -> None:
    trackway, notebook = SimulatedTrackway(tmp_path, iter([REDO, GO_ON])), Notebook(tmp_path, {})
    with pytest.raises(StopIteration):  # the operator has gone
        run(TINY, trackway, notebook, silent)
    assert trackway.prepared == ["3 cm, trial 1 of 1", "3 cm, trial 1 of 1", "adaptive, trial 1 of 1"]
    again, notebook = SimulatedTrackway(tmp_path / "again", always(SKIP)), Notebook(tmp_path, {})
    report = run(TINY, again, notebook, silent)
    assert again.prepared == ["adaptive, trial 1 of 1"]
    ((key, logged),) = first_walks(TINY, notebook).items()
    counted = read_log(tmp_path / "2.mcap")
    assert (key, logged.run) == ("3 cm, trial 1", counted.metadata["run_id"])
    walked_s = counted.ticks["stamp_s"][counted.ticks["mode"] == Mode.WALKING]
    assert logged.from_s < walked_s[0] < walked_s[-1] < logged.to_s
    assert len(report.walks["3 cm"]) == 1 and report.walks["adaptive"] == []
    assert report.table["adaptive"]["48.5"].mean is None


def test_the_robot_does_not_walk_without_a_pose(tmp_path: Path) -> None:
    trackway = SimulatedTrackway(tmp_path, always(GO_ON), MotionCaptureParameters(rate_hz=0.001))
    with pytest.raises(BenchError, match="the position of the body is not known"):
        run(TINY, trackway, Notebook(tmp_path, {}), silent)


def test_strides_without_a_pose_are_reported_and_not_counted(tmp_path: Path) -> None:
    capture = MotionCaptureParameters(rate_hz=120.0, dropouts_per_s=1.0, dropout_s=0.4)
    trackway = SimulatedTrackway(tmp_path, always(GO_ON), capture)
    report = run(TINY, trackway, Notebook(tmp_path, {}), silent)
    assert report.strides_without_position > 0
    json.dumps(to_json(report), allow_nan=False)


@pytest.mark.parametrize(
    ("position_m", "mud"), [(-0.1, "48.5"), (0.0, "48.5"), (0.299, "48.5"), (0.3, "53.1"), (0.6, ""), (9.0, "")]
)
def test_a_mud_extends_from_its_border_to_the_next(position_m: float, mud: str) -> None:
    assert SHORT.mud_at(position_m) == mud


class AlteredRobot(WatchedRobot):
    """A robot whose status has an altered position, and which gets another request while it walks."""

    pose: Callable[[float, float | None], float | None]
    asked: tuple[float, str]

    def call(self, method: str, **params: Any) -> Any:
        answer = super().call(method, **params)
        if method != "status":
            return answer
        if self.asked[1] and answer["mode"] == "walking" and answer["now_s"] > self.asked[0]:
            super().call(self.asked[1])
            self.asked = (0.0, "")
        return answer | {"body_x_m": self.pose(answer["now_s"], answer["body_x_m"])}


def altered_walk(
    folder: Path, pose: Callable[[float, float | None], float | None], asked: tuple[float, str] = (0.0, "")
) -> tuple[LoggedWalk, float]:
    """A trial, and when it was over."""
    robot = SimulatedTrackway(folder, always(GO_ON)).prepare("one")
    robot.__class__ = AlteredRobot
    assert isinstance(robot, AlteredRobot)
    robot.pose, robot.asked = pose, asked
    walk = walk_over(robot, SHORT, SHORT.rules[0])
    assert robot.call("status")["mode"] in ("idle", "fault")
    return walk, robot.lockstep.now_s


def test_a_robot_whose_pose_is_lost_stops(tmp_path: Path) -> None:
    walk, over_s = altered_walk(tmp_path, lambda now_s, x_m: x_m if now_s < 4.0 else None)
    assert "pose of the body is lost" in walk.fault
    assert over_s < 4.0 + UNSEEN_S + 5.0
    assert walk.strides  # from its log


def test_a_pose_of_the_wrong_sign_stops_the_walk(tmp_path: Path) -> None:
    walk, _ = altered_walk(tmp_path, lambda now_s, x_m: x_m and -x_m)
    assert "reverse pose.axis" in walk.fault


@pytest.mark.parametrize(("asked", "reported"), [("stop", "was stopped"), ("disarm", "torque was switched off")])
def test_a_walk_that_another_client_stops_is_marked_as_stopped(tmp_path: Path, asked: str, reported: str) -> None:
    walk, _ = altered_walk(tmp_path, lambda now_s, x_m: x_m, (5.0, asked))
    assert reported in walk.fault and walk.stopped


@pytest.mark.parametrize(
    ("now_s", "body_m", "why", "stopped"),
    [
        (91.0, 0.1, "stuck in 48.5", False),
        (60.0, 0.6, "", False),
        (60.0, -0.3, "the measured position falls", True),
        (60.0, None, "the pose of the body is lost", True),
    ],
)
def test_a_walk_that_arrives_or_gets_stuck_is_not_marked_as_stopped(
    now_s: float, body_m: float | None, why: str, stopped: bool
) -> None:
    end = Progress(SHORT, 0.0, 0.0).evaluate({"now_s": now_s, "body_x_m": body_m, "phase": "insertion"})
    assert end and end.why.startswith(why) and end.stopped is stopped


@pytest.mark.parametrize("stopped", [False, True])
def test_a_stopped_walk_is_repeated_unless_the_operator_says_otherwise(stopped: bool, tmp_path: Path) -> None:
    robot = SimulatedTrackway(tmp_path, always(GO_ON)).prepare("one")
    verdicts = {
        answer: PromptedTrackway(robot, ScriptedOperator(answer)).evaluate("one", stopped)
        for answer in (GO_ON, SKIP, KEEP if stopped else REDO)
    }
    robot.close()
    assert verdicts == ({GO_ON: REDO, SKIP: SKIP, KEEP: GO_ON} if stopped else {GO_ON: GO_ON, SKIP: SKIP, REDO: REDO})


def test_a_trial_is_summarised_in_one_line() -> None:
    stride = WalkedStride("48.5", 0.0, 0.03, 0.1, 2.0, 0.0)
    assert trial_text("3 cm, trial 1", Walk([stride], "")) == "3 cm, trial 1: 1 stride, 5.0 cm/s"
    assert trial_text("3 cm, trial 1", Walk([stride, stride], "")).startswith("3 cm, trial 1: 2 strides, ")


def test_a_report_without_any_trial_still_has_table_and_picture(tmp_path: Path) -> None:
    left_out = {"strides": [], "fault": "", "arm_m": 0.12, "skipped": True}
    notebook = Notebook(tmp_path, {})
    for key, _ in TINY.orders():
        notebook.write(key, left_out)
    report = report_of(TINY, notebook)
    assert "Trials left out: 2." in trackway_text(report)
    plot_trackway(report, tmp_path / "trackway.png")
    assert (tmp_path / "trackway.png").stat().st_size > 0
