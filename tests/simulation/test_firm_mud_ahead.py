"""A robot walks with 5 cm deep strides from soft mud into firm mud that could hold its flippers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track
from tests.copied_robots import copy_of
from tests.recorded_events import EventRecorder

SOFT_M = 0.2


def walk_in_soft_mud(configuration: Configuration, adaptive: bool = True) -> Lockstep:
    track = Track([(SOFT_M, Clay("soft", 600.0)), (5.0, Clay("firm", 6000.0))])
    robot = Lockstep(configuration, track, 1, EventRecorder(), LAB)
    robot.arm()
    robot.walk(WalkOrder(0.05, adaptive))
    assert robot.run_until(lambda: robot.robot.plant.body_m > SOFT_M / 2.0, 15.0)
    return robot


@pytest.fixture(scope="module")
def in_soft_mud(configuration: Configuration) -> Lockstep:
    """Return an adaptive walk that has not met the firm mud yet."""
    return walk_in_soft_mud(configuration)


def walk_into(robot: Lockstep, pascal: float) -> tuple[set[Phase], EventRecorder]:
    """Walk a copy until it is well inside firm mud of this strength, held there, or out of time."""
    robot, seen = copy_of(robot), {Phase.REST}
    segments = robot.robot.plant.track.segments
    segments[1] = segments[1]._replace(clay=Clay("firm", pascal))
    end_s = robot.now_s + 20.0
    while robot.robot.plant.body_m < SOFT_M + 0.2 and robot.now_s < end_s and Phase.RECOVERY not in seen:
        robot.step()
        seen.add(robot.loop.controller.target.phase)
    assert robot.loop.mode is Mode.WALKING
    assert isinstance(robot.loop.recorder, EventRecorder)
    return seen, robot.loop.recorder


@pytest.mark.parametrize("pascal", [4500.0, 6000.0])
def test_it_ends_the_insertion_before_the_mud_would_hold_it(in_soft_mud: Lockstep, pascal: float) -> None:
    phases, recorder = walk_into(in_soft_mud, pascal)
    assert Phase.RECOVERY not in phases
    assert recorder.about("insertion ended")


def test_without_the_early_end_the_mud_would_hold_it(configuration: Configuration) -> None:
    patient = replace(configuration, adaptation=replace(configuration.adaptation, insertion_fraction=10.0))
    phases, recorder = walk_into(walk_in_soft_mud(patient), 6000.0)
    assert Phase.RECOVERY in phases
    assert not recorder.about("insertion ended")


def test_a_fixed_depth_is_not_given_up(configuration: Configuration) -> None:
    phases, recorder = walk_into(walk_in_soft_mud(configuration, adaptive=False), 6000.0)
    assert Phase.RECOVERY in phases
    assert not recorder.about("insertion ended")


def test_mud_that_lets_go_is_entered_as_deep_as_was_chosen(in_soft_mud: Lockstep) -> None:
    _, recorder = walk_into(in_soft_mud, 1500.0)
    assert not recorder.about("insertion ended")
