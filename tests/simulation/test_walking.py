"""The whole program walks, slips and sticks in the muds of the paper.

Speeds are only compared with each other. The strengths were fitted to a simpler model, so this plant does not reproduce
every cell of Table I: see the module of the clay.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import isfinite

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from control.parameters.recovery_parameters import RecoveryParameters
from firmware_host.configuration.configuration import Configuration
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import Track

STRIDES = 2
COMPARTMENT_M = 0.4  # shorter than the paper's, for a short test
StepCm = Callable[[Clay, float], float]


@pytest.fixture(scope="module")
def step_cm(configuration: Configuration) -> StepCm:
    """Return a function that gives the step length of the second stride at a fixed depth; results are cached.

    Like that of the paper's robot, the gait does not wait for flippers that are stuck.
    """
    configuration = replace(configuration, recovery=RecoveryParameters(attempts=0))

    @cache
    def walk(clay: Clay, depth_m: float) -> float:
        lockstep = Lockstep(configuration, Track([(1.0, clay)]))
        lockstep.arm()
        lockstep.walk(WalkOrder(depth_m, adaptive=False))
        starts_m: list[float] = []
        while len(starts_m) <= STRIDES:
            lockstep.run_until(lambda: lockstep.loop.target.stride == len(starts_m), 5.0)
            starts_m.append(lockstep.robot.plant.body_m)
        return 100.0 * (starts_m[2] - starts_m[1])

    return walk


def test_five_centimetres_stick_in_the_stiff_mud(step_cm: StepCm) -> None:
    assert step_cm(MUDS["45.3"], 0.05) < 0.5 * step_cm(MUDS["45.3"], 0.03)


@pytest.mark.parametrize("water", MUDS)
def test_it_moves_forward_in_every_mud(step_cm: StepCm, water: str) -> None:
    assert 1.0 < step_cm(MUDS[water], 0.03) < 20.0  # a sweep of 12 cm plus coasting


def test_three_centimetres_slip_in_the_soft_mud(step_cm: StepCm) -> None:
    assert step_cm(MUDS["53.1"], 0.03) < 0.3 * step_cm(MUDS["48.5"], 0.03)


def test_deeper_strides_slip_less_in_the_soft_mud(step_cm: StepCm) -> None:
    assert step_cm(MUDS["53.1"], 0.05) > 2.0 * step_cm(MUDS["53.1"], 0.03)


def test_a_mud_stronger_than_the_motors_holds_the_flippers(step_cm: StepCm) -> None:
    assert step_cm(Clay("8 kPa", 8000.0), 0.05) < 2.5


@pytest.fixture(scope="module")
def adaptive_walk(configuration: Configuration) -> Lockstep:
    """Walk adaptively over the paper's three muds, to their end or for 40 s."""
    track = Track([(COMPARTMENT_M, clay) for clay in MUDS.values()])
    lockstep = Lockstep(configuration, track)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03))
    lockstep.run_until(lambda: lockstep.robot.plant.body_m >= track.length_m, 40.0)
    return lockstep


def chosen_depths_m(adaptive_walk: Lockstep, compartment: int) -> list[float]:
    """Return the depths of the last strides in a compartment; the robot still learns in the first ones."""
    start_m, chosen, position_m = compartment * COMPARTMENT_M, [], 0.0
    for stride in adaptive_walk.loop.learning.strides:
        if stride.estimate.flipper != "left":
            continue
        position_m += stride.estimate.step_m if isfinite(stride.estimate.step_m) else 0.0
        if start_m + 0.2 < position_m < start_m + COMPARTMENT_M:
            chosen.append(stride.chosen_depth_m)
    return chosen


def test_adaptation_crosses_every_mud_at_more_than_5_cm_per_second(adaptive_walk: Lockstep) -> None:
    assert adaptive_walk.loop.mode is Mode.WALKING
    assert adaptive_walk.robot.plant.body_m >= 3.0 * COMPARTMENT_M
    assert adaptive_walk.robot.plant.body_m / adaptive_walk.now_s > 0.05


def test_adaptation_goes_deeper_in_the_soft_mud_than_in_the_stiff_one(adaptive_walk: Lockstep) -> None:
    soft_m, stiff_m = chosen_depths_m(adaptive_walk, 1), chosen_depths_m(adaptive_walk, 2)
    assert len(soft_m) >= 2
    assert len(stiff_m) >= 2
    assert min(soft_m) > max(stiff_m) + 0.01
