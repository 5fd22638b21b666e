"""Table I is measured through the daemon's calls; every walk stops in time, and its log gives the table."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import pytest

from experiments.robot.bench_errors import BenchError
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.study.notebook import Notebook
from experiments.study.prompt import SKIP
from experiments.study.result import to_json
from experiments.trackway.bench import (
    UNSEEN_S,
    Progress,
    Trackway,
    first_walks,
    measure,
    report_of,
)
from experiments.trackway.plots import draw_trackway
from experiments.trials.mud_trials import Bench, InvalidTrialError, conduct_trials, counted_entries
from experiments.trials.simulated_bed import simulated_bench
from simulation.devices.motion_capture_parameters import AT_EVERY_TICK, MotionCaptureParameters
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.scripted_operator import ScriptedOperator

SHORT = Trackway((("48.5", 0.2), ("53.1", 0.2)), trials=1, depths_m=(0.03,))
TINY = Trackway((("48.5", 0.15),), trials=1, depths_m=(0.03,))
COPIES, BEYOND_M = 3, 0.5  # fresh trackways in a row, and the length of mud after each


MakeBench = Callable[..., Bench]


@pytest.fixture
def make_bench(tmp_path: Path) -> Iterator[MakeBench]:
    """Yield a function that makes a bench; finish the log of its robot in the end."""
    opened = ExitStack()

    def make(*answers: str, capture: MotionCaptureParameters = AT_EVERY_TICK) -> Bench:
        segments = [(length_m, MUDS[name]) for name, length_m in SHORT.muds] + [(BEYOND_M, MUDS["48.5"])]
        track = Track(segments * COPIES)
        bench = simulated_bench(
            ScriptedOperator(*answers),
            Notebook(tmp_path, {}),
            simulated_configuration(),
            track,
            lambda trial, prepared: prepared * track.length_m / COPIES,
            capture,
        )
        opened.callback(bench.robot.close)
        return bench

    with opened:
        yield make


def walk_all(bench: Bench, plan: Trackway) -> dict[str, Any]:
    conduct_trials(bench, plan.planned, partial(measure, bench, plan), lambda done, total: None)
    bench.robot.close()
    return report_of(plan, counted_entries(bench.notebook), 0.12)


def test_every_gait_is_walked_past_the_end_and_reported(make_bench: MakeBench) -> None:
    bench = make_bench()
    report = walk_all(bench, SHORT)
    operator = bench.operator
    assert isinstance(operator, ScriptedOperator)
    assert [message.partition(": ")[0] for message in operator.reported] == [
        "3 cm, trial 1 of 1",
        "adaptive, trial 1 of 1",
    ]
    assert {tuple(ends) for ends in report["ends"].values()} == {("past the end",)}
    for (strides,) in report["walks"].values():
        assert list(dict.fromkeys(stride["mud"] for stride in strides)) == ["48.5", "53.1"]
        assert 0.0 < strides[0]["position_cm"] < 12.0 < strides[-1]["position_cm"] < 40.0


def test_a_walk_that_is_left_out_is_in_no_figure(make_bench: MakeBench) -> None:
    bench = make_bench(SKIP)
    report = walk_all(bench, TINY)
    assert list(first_walks(TINY, counted_entries(bench.notebook))) == ["adaptive, trial 1"]
    assert report["walks"]["3 cm"] == [] and len(report["walks"]["adaptive"]) == 1
    assert report["table"]["3 cm"]["48.5"]["mean"] is None
    assert report["left_out"] == 1
    draw_trackway(report)


def test_the_robot_does_not_walk_without_a_pose(make_bench: MakeBench) -> None:
    bench = make_bench(capture=MotionCaptureParameters(rate_hz=0.001))
    with pytest.raises(BenchError, match="the position of the body is not known"):
        measure(bench, TINY, TINY.planned[0])


def test_strides_without_a_pose_are_reported_and_not_counted(make_bench: MakeBench) -> None:
    capture = MotionCaptureParameters(rate_hz=120.0, dropouts_per_s=1.0, dropout_s=0.4)
    report = walk_all(make_bench(capture=capture), TINY)
    assert report["strides_without_position"] > 0
    json.dumps(to_json(report), allow_nan=False)


@pytest.mark.parametrize(
    ("position_m", "mud"), [(-0.1, "48.5"), (0.0, "48.5"), (0.199, "48.5"), (0.2, "53.1"), (0.4, ""), (9.0, "")]
)
def test_a_mud_extends_from_its_border_to_the_next(position_m: float, mud: str) -> None:
    assert SHORT.mud_at(position_m) == mud


class AlteredRobot(LockstepRobot):
    """A robot whose status has no pose, or that another client disarms, from a given time on."""

    blind_from_s = disarmed_from_s = inf

    def call(self, method: str, **params: Any) -> Any:
        answer = super().call(method, **params)
        if method != "status":
            return answer
        if answer["mode"] == "walking" and answer["now_s"] > self.disarmed_from_s:
            super().call("disarm")
        return answer if answer["now_s"] < self.blind_from_s else answer | {"body_x_m": None}


@pytest.mark.parametrize(
    ("change", "why"),
    [("blind_from_s", "pose of the body is lost"), ("disarmed_from_s", "torque was switched off")],
)
def test_a_walk_without_a_pose_or_that_another_client_stops_is_invalid(
    change: str, why: str, make_bench: MakeBench
) -> None:
    bench = make_bench()
    robot = bench.robot
    robot.__class__ = AlteredRobot
    assert isinstance(robot, AlteredRobot)
    setattr(robot, change, 5.0)
    with pytest.raises(InvalidTrialError) as invalid:
        measure(bench, SHORT, SHORT.planned[0])
    assert robot.call("status")["mode"] in ("idle", "fault") and robot.lockstep.now_s < 5.0 + UNSEEN_S + 5.0
    entry = invalid.value.entry
    assert entry and why in entry["fault"] and entry["fault"] in str(invalid.value)
    assert entry["strides"]  # read from its log


@pytest.mark.parametrize(
    ("now_s", "body_m", "why", "stopped"),
    [
        (91.0, 0.1, "stuck in 48.5", False),
        (60.0, 0.6, "", False),
        (60.0, -0.3, "the measured position fell by 30 cm, more than 20 cm", True),
        (60.0, None, "the pose of the body is lost", True),
    ],
)
def test_a_walk_that_arrives_or_gets_stuck_is_not_marked_as_stopped(
    now_s: float, body_m: float | None, why: str, stopped: bool
) -> None:
    end = Progress(SHORT, 0.0, 0.0).evaluate({"now_s": now_s, "body_x_m": body_m, "phase": "insertion"})
    assert end and end.why.startswith(why) and end.stopped is stopped
