"""Who stands beside the robot: asked in words on a bench, looked up in the mechanics of a simulated one."""

from __future__ import annotations

import pytest

from control.records import JOINTS
from experiments.bench.operator import Observation, PromptedBenchOperator, SimulatedBenchOperator
from experiments.bench.rig import SimulatedRig
from firmware_host.configuration.configuration import Configuration
from tests.scripted_operator import ScriptedOperator


def nothing() -> None: ...


@pytest.mark.parametrize(("answer", "consents"), [("", True), ("n", False)])
def test_nothing_moves_without_a_yes(answer: str, consents: bool) -> None:
    operator = ScriptedOperator(answer)
    assert PromptedBenchOperator(operator, sure=False).allows_motion("It moves.", nothing) is consents
    assert operator.asked == ["It moves."]


def test_who_has_said_yes_is_told_and_not_asked() -> None:
    operator = ScriptedOperator("n")
    assert PromptedBenchOperator(operator, sure=True).allows_motion("It moves.", nothing)
    assert (operator.asked, operator.reported) == ([], ["It moves."])


@pytest.mark.parametrize(
    ("answer", "observation"),
    [("", Observation.RIGHT), ("w", Observation.OPPOSITE), ("o", Observation.OTHER), ("n", Observation.NOTHING)],
)
def test_what_was_seen_is_taken_as_told(answer: str, observation: Observation) -> None:
    operator = ScriptedOperator(answer)
    assert PromptedBenchOperator(operator, sure=True).observed_motion("right_adduction", nothing) is observation
    assert "the right flipper rise" in operator.asked[0]


@pytest.mark.parametrize(("answer", "done"), [("", True), ("s", False)])
def test_hands_may_be_refused(answer: str, done: bool) -> None:
    bench_operator = PromptedBenchOperator(ScriptedOperator(answer, answer), sure=True)
    assert bench_operator.hold_level(nothing) is done
    assert bench_operator.turn_joint("left_sweep", nothing) is done


@pytest.mark.parametrize(
    ("ways_rad", "observation"),
    [
        ((0.2, 0.0, 0.0, 0.0), Observation.RIGHT),
        ((-0.2, 0.0, 0.0, 0.0), Observation.OPPOSITE),
        ((0.0, 0.0, 0.2, 0.0), Observation.OTHER),
        ((0.2, 0.2, 0.0, 0.0), Observation.OTHER),
        ((0.0, 0.0, 0.0, 0.0), Observation.NOTHING),
    ],
)
def test_simulated_eyes_see_where_the_joints_go(
    configuration: Configuration, ways_rad: tuple[float, ...], observation: Observation
) -> None:
    rig = SimulatedRig(configuration)
    bench_operator = SimulatedBenchOperator(rig)
    bench_operator.start_observing()
    for arm, (sweep_rad, adduction_rad) in zip(rig.robot.plant.arms, (ways_rad[:2], ways_rad[2:]), strict=True):
        arm.sweep_rad += sweep_rad
        arm.adduction_rad += adduction_rad
    bench_operator.observe_farthest()
    assert bench_operator.observed_motion(JOINTS[0], nothing) is observation
