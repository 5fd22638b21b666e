"""A robot that comes from soft mud, five centimetres deep, into mud that would hold it there."""

from __future__ import annotations

from collections.abc import Iterator
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
from tests.recorded_events import EventRecorder

SOFT_M = 0.2


def firm_mud_ahead(configuration: Configuration, pascal: float, adaptive: bool = True) -> Iterator[Lockstep]:
    """Walks tick by tick until the robot is well in the firm mud, or stops."""
    track = Track([(SOFT_M, Clay("soft", 600.0)), (5.0, Clay("firm", pascal))])
    robot = Lockstep(configuration, track, 1, EventRecorder(), LAB)
    robot.arm()
    robot.walk(WalkOrder(0.05, adaptive))
    end_s = robot.now_s + 20.0
    while robot.loop.mode is Mode.WALKING and robot.robot.plant.body_m < SOFT_M + 0.2 and robot.now_s < end_s:
        robot.step()
        yield robot


def phases_in(ticks: Iterator[Lockstep]) -> tuple[set[Phase], EventRecorder]:
    seen = set()
    for robot in ticks:
        seen.add(robot.loop.controller.target.phase)
    assert isinstance(robot.loop.recorder, EventRecorder)
    return seen, robot.loop.recorder


@pytest.mark.parametrize("pascal", [4500.0, 6000.0])
def test_it_ends_the_insertion_before_the_mud_would_hold_it(configuration: Configuration, pascal: float) -> None:
    phases, recorder = phases_in(firm_mud_ahead(configuration, pascal))
    assert Phase.RECOVERY not in phases
    assert recorder.about("insertion ended")


def test_without_the_early_end_the_mud_would_hold_it(configuration: Configuration) -> None:
    patient = replace(configuration, adaptation=replace(configuration.adaptation, insertion_fraction=10.0))
    phases, recorder = phases_in(firm_mud_ahead(patient, 6000.0))
    assert Phase.RECOVERY in phases
    assert not recorder.about("insertion ended")


def test_a_fixed_depth_is_not_given_up(configuration: Configuration) -> None:
    _, recorder = phases_in(firm_mud_ahead(configuration, 6000.0, adaptive=False))
    assert not recorder.about("insertion ended")


def test_mud_that_lets_go_is_entered_as_deep_as_was_chosen(configuration: Configuration) -> None:
    _, recorder = phases_in(firm_mud_ahead(configuration, 1500.0))
    assert not recorder.about("insertion ended")
