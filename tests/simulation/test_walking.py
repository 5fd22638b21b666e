"""The muds of the paper under the whole program: where it walks, slips and sticks.

Speeds are compared with one another only. The strengths were fitted to a simpler model, so this plant does not meet
every cell of Table I: see the module of the clay.
"""

from dataclasses import replace
from math import isfinite

import pytest

from control.controller import WalkOrder
from control.gait.recovery import RecoveryParameters
from control.modes import Mode
from firmware_host.configuration.configuration import Configuration
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import COMPARTMENT_M, Track, paper_track

STRIDES = 5


def walk(configuration: Configuration, clay: Clay, depth_m: float) -> tuple[float, float]:
    """Step length in cm and speed in cm/s over the strides after the first two, at a fixed depth.

    As on the paper's robot, the gait does not wait for flippers that are stuck.
    """
    configuration = replace(configuration, recovery=RecoveryParameters(attempts=0))
    lockstep = Lockstep(configuration, Track([(1.0, clay)]))
    lockstep.arm()
    lockstep.walk(WalkOrder(depth_m, adaptive=False))
    begun: list[tuple[float, float]] = []
    while len(begun) <= STRIDES:
        lockstep.run_until(lambda: lockstep.loop.target.stride == len(begun), 5.0)
        begun.append((lockstep.now_s, lockstep.robot.plant.body_m))
    (start_s, start_m), (end_s, end_m) = begun[2], begun[-1]
    return 100.0 * (end_m - start_m) / (STRIDES - 2), 100.0 * (end_m - start_m) / (end_s - start_s)


def test_five_centimetres_stick_in_the_stiff_mud(configuration: Configuration) -> None:
    stuck_cm, _ = walk(configuration, MUDS["45.3"], 0.05)
    free_cm, _ = walk(configuration, MUDS["45.3"], 0.03)
    assert stuck_cm < 0.5 * free_cm


@pytest.mark.parametrize("water", MUDS)
def test_it_moves_forward_in_every_mud(configuration: Configuration, water: str) -> None:
    step_cm, _ = walk(configuration, MUDS[water], 0.03)
    assert 1.0 < step_cm < 20.0  # a sweep of 12 cm, and some coasting


def test_three_centimetres_slip_in_the_soft_mud(configuration: Configuration) -> None:
    soft_cm, _ = walk(configuration, MUDS["53.1"], 0.03)
    medium_cm, _ = walk(configuration, MUDS["48.5"], 0.03)
    assert soft_cm < 0.3 * medium_cm


def test_deeper_strides_slip_less_in_the_soft_mud(configuration: Configuration) -> None:
    assert walk(configuration, MUDS["53.1"], 0.05)[0] > 2.0 * walk(configuration, MUDS["53.1"], 0.03)[0]


def test_a_mud_stronger_than_the_motors_holds_the_flippers(configuration: Configuration) -> None:
    step_cm, _ = walk(configuration, Clay("8 kPa", 8000.0), 0.05)
    assert step_cm < 2.5


@pytest.fixture(scope="module")
def cross_coupling(configuration: Configuration) -> Lockstep:
    """An adaptive walk over the paper's three muds, up to their end or for 40 s."""
    lockstep = Lockstep(configuration, paper_track())
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03))
    lockstep.run_until(lambda: lockstep.robot.plant.body_m >= paper_track().length_m, 40.0)
    return lockstep


def chosen_depths_m(cross_coupling: Lockstep, compartment: int) -> list[float]:
    """Of the last strides in a compartment: the first ones there still learn."""
    start_m, chosen, position_m = compartment * COMPARTMENT_M, [], 0.0
    for stride in cross_coupling.loop.learning.strides:
        if stride.estimate.flipper != "left":
            continue
        position_m += stride.estimate.step_m if isfinite(stride.estimate.step_m) else 0.0
        if start_m + 0.3 < position_m < start_m + COMPARTMENT_M:
            chosen.append(stride.chosen_depth_m)
    return chosen


def test_adaptation_crosses_every_mud_at_more_than_5_cm_per_second(cross_coupling: Lockstep) -> None:
    assert cross_coupling.loop.mode is Mode.WALKING
    assert cross_coupling.robot.plant.body_m >= paper_track().length_m
    assert cross_coupling.robot.plant.body_m / cross_coupling.now_s > 0.05


def test_adaptation_goes_deeper_in_the_soft_mud_than_in_the_stiff_one(cross_coupling: Lockstep) -> None:
    soft_m, stiff_m = chosen_depths_m(cross_coupling, 1), chosen_depths_m(cross_coupling, 2)
    assert len(soft_m) >= 2
    assert len(stiff_m) >= 2
    assert min(soft_m) > max(stiff_m) + 0.01
