"""The whole program but its buses walks, slips and sticks in the muds of the paper.

Speeds are only compared with each other. The strengths were fitted to a simpler model, so this plant does not reproduce
every cell of Table I: see the module of the clay.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.parameters.recovery_parameters import RecoveryParameters
from firmware_host.configuration.configuration import Configuration
from simulation.harness.direct import Direct
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

COMPARTMENT_M = 0.4  # shorter than the paper's, for a short test
WALKS = (("48.5", 3), ("53.1", 3), ("53.1", 5), ("45.3", 3), ("45.3", 5))  # muds, and depths in centimetres


@pytest.fixture(scope="module")
def step_cm(configuration: Configuration) -> Mapping[tuple[str, int], float]:
    """Return the length of the second step in each mud.

    Like that of the paper's robot, the gait does not wait for flippers that are stuck.
    """
    configuration, found = replace(configuration, recovery=RecoveryParameters(attempts=0)), {}
    for water, depth_cm in WALKS:
        robot = Direct(configuration, Track([(1.0, MUDS[water])]))
        robot.arm()
        robot.walk(WalkOrder(depth_cm / 100.0, adaptive=False))
        starts_m = []
        for stride in (1, 2):
            robot.run_until(lambda: robot.loop.target.stride == stride, 5.0)  # noqa: B023
            starts_m.append(robot.robot.plant.body_m)
        found[water, depth_cm] = 100.0 * (starts_m[1] - starts_m[0])
    return found


def test_it_moves_forward_slips_less_the_deeper_it_strides_and_sticks(
    step_cm: Mapping[tuple[str, int], float],
) -> None:
    for water in MUDS:
        assert 1.0 < step_cm[water, 3] < 20.0  # a sweep of 12 cm plus coasting
    assert step_cm["53.1", 3] < 0.3 * step_cm["48.5", 3]
    assert step_cm["53.1", 5] > 2.0 * step_cm["53.1", 3]
    assert step_cm["45.3", 5] < 0.5 * step_cm["45.3", 3]


@pytest.fixture(scope="module")
def adaptive_walk(configuration: Configuration) -> Direct:
    """Walk adaptively over the paper's three muds, to their end or for 40 s."""
    track = Track([(COMPARTMENT_M, clay) for clay in MUDS.values()])
    robot = Direct(configuration, track)
    robot.arm()
    robot.walk(WalkOrder(0.03))
    robot.run_until(lambda: robot.robot.plant.body_m >= track.length_m, 40.0)
    return robot


def chosen_depths_m(adaptive_walk: Direct, compartment: int) -> list[float]:
    """Return the depths of the last strides in a compartment; the robot still learns in the first ones."""
    start_m, chosen, position_m = compartment * COMPARTMENT_M, [], 0.0
    for stride in adaptive_walk.loop.learning.strides:
        if stride.estimate.flipper != "left":
            continue
        position_m += stride.estimate.step_m if isfinite(stride.estimate.step_m) else 0.0
        if start_m + 0.2 < position_m < start_m + COMPARTMENT_M:
            chosen.append(stride.chosen_depth_m)
    return chosen


def test_adaptation_crosses_every_mud_at_more_than_5_cm_per_second_deeper_in_the_soft_one(
    adaptive_walk: Direct,
) -> None:
    assert adaptive_walk.loop.mode is Mode.WALKING
    assert adaptive_walk.robot.plant.body_m >= 3.0 * COMPARTMENT_M
    assert adaptive_walk.robot.plant.body_m / adaptive_walk.now_s > 0.05
    soft_m, stiff_m = chosen_depths_m(adaptive_walk, 1), chosen_depths_m(adaptive_walk, 2)
    assert min(len(soft_m), len(stiff_m)) >= 2
    assert min(soft_m) > max(stiff_m) + 0.01
