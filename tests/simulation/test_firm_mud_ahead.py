"""A robot walks with 5 cm deep strides from soft mud into firm mud that could hold its flippers.

The firm mud has 4.5 kPa, which holds flippers from 3.5 cm on. One of 6 kPa can hold them from 1.8 cm on, so there an
insertion that ended early may need a recovery too.
"""

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from simulation.harness.direct import Direct
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track
from tests.recorded_events import EventRecorder

SOFT_M = 0.2


def walk_into(configuration: Configuration, pascal: float) -> tuple[set[Phase], EventRecorder]:
    """Walk from soft mud until the robot is well inside firm mud of this strength, held there, or out of time."""
    track, seen = Track([(SOFT_M, Clay("soft", 600.0)), (5.0, Clay("firm", pascal))]), {Phase.REST}
    robot = Direct(configuration, track, 1, EventRecorder(), LAB)
    robot.arm()
    robot.walk(WalkOrder(0.05))
    end_s = robot.now_s + 30.0
    while robot.robot.plant.body_m < SOFT_M + 0.2 and robot.now_s < end_s and Phase.RECOVERY not in seen:
        robot.step()
        seen.add(robot.loop.controller.target.phase)
    assert robot.loop.mode is Mode.WALKING
    assert isinstance(robot.loop.recorder, EventRecorder)
    return seen, robot.loop.recorder


@pytest.mark.parametrize(("pascal", "ends_early"), [(1500.0, False), (4500.0, True)])
def test_it_ends_the_insertion_before_the_mud_would_hold_it_and_only_then(
    configuration: Configuration, pascal: float, ends_early: bool
) -> None:
    phases, recorder = walk_into(configuration, pascal)
    assert Phase.RECOVERY not in phases
    assert bool(recorder.about("insertion ended")) is ends_early
