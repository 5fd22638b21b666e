"""A simulated joint is read like a real one: level, after an approach from each side, and settled."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees
from pathlib import Path

import pytest

from control.parameters.arm_mass import GRAVITY_M_S2
from experiments.actuator.plan import WeighingPlan, WeighingStep
from experiments.actuator.reading import HeldJoint, MovedError
from experiments.actuator.simulation import (
    COULOMB_NM,
    TRUE_CONSTANT_NM_A,
    SimulatedWeights,
    bench_configuration,
    simulated_bench,
)
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import arm
from experiments.robot.lockstep_robot import LockstepRobot
from experiments.study.notebook import Entry


def nothing() -> None:
    pass


Arm = tuple[LockstepRobot, SimulatedWeights, HeldJoint]


@contextmanager
def held_arm(joint: str, seed: int, folder: Path) -> Iterator[Arm]:
    """Yield a simulated robot that holds its empty arm level, the weights for it, and the joint."""
    robot, hand = simulated_bench(bench_configuration(), joint, WeighingPlan((joint,)), seed, folder / "log.mcap")
    try:
        hand.hold_level(nothing)
        arm(robot)
        hand.release(nothing)
        yield robot, hand, HeldJoint(robot, joint)
    finally:
        robot.close()


@pytest.mark.parametrize("joint", ["left_sweep", "right_adduction"])
def test_a_weight_is_read_level_and_without_friction(joint: str, tmp_path: Path) -> None:
    with held_arm(joint, 2, tmp_path) as (_, hand, held):
        empty = held.read()
        hand.hang(WeighingStep(1, 400.0), nothing)
        loaded = held.read()
    external_nm = 0.4 * GRAVITY_M_S2 * hand.mount.lever_m
    sensed_nm = abs(loaded["current_a"] - empty["current_a"]) * TRUE_CONSTANT_NM_A
    assert sensed_nm == pytest.approx(external_nm, abs=0.5 * COULOMB_NM)
    assert abs(degrees(loaded["angle_rad"])) < 0.1 and abs(degrees(empty["angle_rad"])) < 0.1
    assert abs(degrees(loaded["below"]["held_rad"])) > 2.0  # without levelling the arm would hang this low
    assert 0.4 * COULOMB_NM < empty["rest_friction_a"] * TRUE_CONSTANT_NM_A < 1.3 * COULOMB_NM


def test_an_arm_that_never_rests_is_not_read(tmp_path: Path) -> None:
    with held_arm("right_adduction", 3, tmp_path) as (robot, hand, held):
        plain_wait = robot.wait

        def shaken(duration_s: float) -> None:
            hand.mount.hang(0.1 if int(robot.lockstep.now_s * 4.0) % 2 else 0.3, WeighingPlan(()).lever_m)
            plain_wait(duration_s)

        robot.wait = shaken  # type: ignore[method-assign]
        with pytest.raises(MovedError, match="swings|drifts"):
            held.read()
        robot.call("disarm")
        plain_wait(0.1)
        with pytest.raises(BenchError, match="no longer holds its pose"):
            held.read()


def test_a_load_that_the_motor_does_not_lift_is_reported(tmp_path: Path) -> None:
    joint, plan = "right_adduction", WeighingPlan(("right_adduction",))
    robot, hand = simulated_bench(bench_configuration(), joint, plan, 4, tmp_path / "log.mcap")
    try:
        hand.hold_level(nothing)
        robot.lockstep.robot.plant.arms[1].adduction_rad = -0.55  # held 30 degrees down
        robot.wait(0.1)
        arm(robot)
        held = HeldJoint(robot, joint)
        held.held_rad = 0.0  # as if it had been commanded level
        with pytest.raises(MovedError, match="cannot bring the arm level"):
            held.read()
    finally:
        robot.close()


def test_a_weight_that_slips_off_between_the_approaches_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with held_arm("left_adduction", 5, tmp_path) as (_, hand, held):
        hand.hang(WeighingStep(1, 200.0), nothing)
        settled = HeldJoint._settled

        def slipping(self: HeldJoint) -> Entry:
            side = settled(self)
            hand.take_off()
            return side

        monkeypatch.setattr(HeldJoint, "_settled", slipping)
        with pytest.raises(MovedError, match=r"differ by \+3\.[0-9] A, as if the load had changed"):
            held.read()
