"""A step of the wall clock does not interrupt a walk, although the kernel stamps frames with this clock."""

import pytest

from control.controller import WalkOrder
from control.faults import Reaction
from control.modes import Mode
from firmware_host.configuration.configuration import Configuration
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.copied_robots import copy_of
from verification.faults.failing_robot import FailingRobot
from verification.faults.injection import ACTS


@pytest.fixture(scope="module")
def walking(configuration: Configuration) -> FailingRobot:
    robot = FailingRobot(configuration, Track([(5.0, MUDS["48.5"])]))
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    robot.run_for(1.0)
    return robot


@pytest.mark.parametrize("step_s", [-2.0, -0.012, 0.005, 0.1])
def test_a_walk_goes_on_while_the_wall_clock_is_stepped(walking: FailingRobot, step_s: float) -> None:
    robot = copy_of(walking)
    worst = Reaction.NONE
    with ACTS["wall_clock_stepped"](robot, "left_sweep", step_s):
        for _ in range(300):
            robot.step()
            worst = max(worst, robot.loop.faults.reaction)
    assert worst is Reaction.NONE
    assert robot.loop.mode is Mode.WALKING
