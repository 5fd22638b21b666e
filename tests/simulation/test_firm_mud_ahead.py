"""A robot walks with 5 cm deep strides from soft mud into firm mud that could hold its flippers.

The firm mud has 4.5 kPa, which holds flippers from 3.5 cm on. One of 6 kPa can hold them from 1.8 cm on, so there an
insertion that ended early may need a recovery too.
"""

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
    track = Track([(SOFT_M, Clay("soft", 600.0)), (5.0, Clay("firm", 4500.0))])
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
    segments[1] = segments[1]._replace(ground=Clay("firm", pascal))
    end_s = robot.now_s + 20.0
    while robot.robot.plant.body_m < SOFT_M + 0.2 and robot.now_s < end_s and Phase.RECOVERY not in seen:
        robot.step()
        seen.add(robot.loop.controller.target.phase)
    assert robot.loop.mode is Mode.WALKING
    assert isinstance(robot.loop.recorder, EventRecorder)
    return seen, robot.loop.recorder


@pytest.mark.parametrize(("pascal", "ends_early"), [(1500.0, False), (4500.0, True)])
def test_it_ends_the_insertion_before_the_mud_would_hold_it_and_only_then(
    in_soft_mud: Lockstep, pascal: float, ends_early: bool
) -> None:
    phases, recorder = walk_into(in_soft_mud, pascal)
    assert Phase.RECOVERY not in phases
    assert bool(recorder.about("insertion ended")) is ends_early


@pytest.mark.parametrize("adaptive", [True, False])
def test_without_the_early_end_and_at_a_fixed_depth_the_mud_holds_it(
    configuration: Configuration, adaptive: bool
) -> None:
    patient = replace(configuration, adaptation=replace(configuration.adaptation, insertion_fraction=10.0))
    robot = walk_in_soft_mud(patient) if adaptive else walk_in_soft_mud(configuration, adaptive=False)
    phases, recorder = walk_into(robot, 4500.0)
    assert Phase.RECOVERY in phases
    assert not recorder.about("insertion ended")
