"""The work at the ends of strides is spread over ticks, and its results do not depend on how it is spread."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from control.controller import WalkOrder
from control.modes import Mode, Request
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.log.recorder import Recorder
from logs.replay import replay_files
from simulation.harness.direct import Direct
from simulation.harness.drive_presets import calibrated
from simulation.mud.track import paper_track
from tests.folders import EXAMPLE_CONFIGURATION

STRIDES = 2
ALL = 1000
NONE = 0  # no unit until the next insertion needs the choice, as in a swing that is shorter than the work


class Watched:
    """Counts the units of each tick, and what is finished at once."""

    def __init__(self, robot: Direct) -> None:
        self.robot, self.work = robot, robot.loop.learning.estimator.work
        self.units: list[int] = []
        self.at_once = 0
        self._run, self._finish = self.work.run, self.work.finish
        self.work.run, self.work.finish = self.run, self.finish  # type: ignore[method-assign]

    def run(self, units: int) -> None:
        self.units.append(units)
        self._run(units)

    def finish(self) -> None:
        self.at_once += not self.work.is_empty
        self._finish()


@cache
def walked(units_per_tick: int) -> Watched:
    configuration = parse_configuration(calibrated(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")))
    robot = Direct(configuration, paper_track(), seed=5)
    robot.loop.learning.units_per_tick = units_per_tick
    robot.arm()
    watched = Watched(robot)
    robot.walk(WalkOrder(0.04, True, STRIDES))
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 20.0)
    return watched


@pytest.mark.parametrize("units_per_tick", [NONE, ALL])
def test_estimates_depths_and_walk_do_not_depend_on_the_units_per_tick(units_per_tick: int) -> None:
    robots = [walked(units).robot for units in (1, units_per_tick)]
    one, other = (robot.loop.learning for robot in robots)
    assert len(one.strides) == 2 * STRIDES
    assert repr(one.strides) == repr(other.strides)
    assert repr(one.estimator.mud_estimate) == repr(other.estimator.mud_estimate)
    assert repr(one.estimator.map.rows()) == repr(other.estimator.map.rows())
    assert repr(robots[0].loop.states) == repr(robots[1].loop.states)
    assert robots[0].robot.plant.body_m == robots[1].robot.plant.body_m


def test_no_tick_of_a_walk_runs_more_than_one_unit() -> None:
    watched = walked(1)
    assert watched.robot.loop.learning.strides_closed == 2 * STRIDES
    assert set(watched.units) == {1}
    assert watched.at_once == 0


def test_the_command_of_a_tick_is_sent_before_its_learning(configuration: Configuration) -> None:
    robot, order = Direct(configuration, paper_track()), list[str]()

    def noted(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def noted_method(*values: Any) -> Any:
            order.append(name)
            return method(*values)

        return noted_method

    loop = robot.loop
    robot.arm()
    loop.drives.send = noted("send", loop.drives.send)  # type: ignore[method-assign]
    loop.learning.step = noted("learn", loop.learning.step)  # type: ignore[method-assign]
    robot.run_for(5.0 * robot.period_s)
    assert order == ["send", "learn"] * 5


def test_a_choice_that_is_due_is_made_before_the_insertion_uses_it(configuration: Configuration) -> None:
    """Without any unit in time, all of them run at the end of the swing."""
    robot = Direct(configuration, paper_track(), seed=5)
    robot.loop.learning.units_per_tick = NONE
    robot.arm()
    robot.walk(WalkOrder(0.04))
    loop = robot.loop
    assert robot.run_until(lambda: loop.controller.target.phase is Phase.SWING, 5.0)
    assert robot.run_until(lambda: loop.learning.strides_closed > 0, 5.0)
    assert loop.controller.target.phase is Phase.SWING
    chosen_m = loop.learning.strides[-1].chosen_depth_m
    assert robot.run_until(lambda: loop.controller.target.phase is Phase.INSERTION, 1.0)
    assert loop.stride_depth_m == chosen_m != 0.04


def test_a_new_walk_finishes_the_strides_of_the_one_before(tmp_path: Path, configuration: Configuration) -> None:
    """The first walk is stopped in the middle of its schedule, and its log replays to the same strides."""
    path = tmp_path / "walk.mcap"
    recorder = Recorder(path, configuration.text, {"robot": "test"})
    robot = Direct(configuration, paper_track(), recorder=recorder)
    loop, learning = robot.loop, robot.loop.learning
    learning.units_per_tick = NONE
    robot.arm()
    robot.walk(WalkOrder(0.03))
    assert robot.run_until(lambda: loop.target.phase is Phase.SWING, 5.0)
    robot.run_for(2.0 * robot.period_s)
    assert not learning.estimator.work.is_empty
    loop.request(Request.STOP, robot.now_s)
    assert robot.run_until(lambda: loop.mode is Mode.HOLD, 10.0)
    assert learning.strides_closed == 0
    learning.units_per_tick = 1
    robot.walk(WalkOrder(0.03, True, 1))
    robot.step()
    assert learning.strides_closed == 2
    assert robot.run_until(lambda: loop.mode is Mode.HOLD, 10.0)
    assert recorder.close(20.0)
    replayed = replay_files([path]).strides
    assert [stride.estimate.index for stride in learning.strides] == [0, 0, 0, 0]
    assert repr([stride.estimate for stride in learning.strides]) == repr(list(replayed))
