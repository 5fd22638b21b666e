"""Who stands beside the robot: asked in words on a bench, looked up in the mechanics of a simulated one."""

from __future__ import annotations

import pytest

from control.records import JOINTS
from experiments.bench.operator import AskedAttendant, Sight, SimulatedAttendant
from experiments.bench.rig import SimulatedRig
from firmware_host.configuration.configuration import Configuration
from tests.scripted_operator import ScriptedOperator


def nothing() -> None: ...


@pytest.mark.parametrize(("answer", "consents"), [("", True), ("n", False)])
def test_nothing_moves_without_a_yes(answer: str, consents: bool) -> None:
    operator = ScriptedOperator(answer)
    assert AskedAttendant(operator, sure=False).consents("It moves.", nothing) is consents
    assert operator.asked == ["It moves."]


def test_who_has_said_yes_is_told_and_not_asked() -> None:
    operator = ScriptedOperator("n")
    assert AskedAttendant(operator, sure=True).consents("It moves.", nothing)
    assert (operator.asked, operator.reported) == ([], ["It moves."])


@pytest.mark.parametrize(
    ("answer", "sight"), [("", Sight.RIGHT), ("w", Sight.WRONG_WAY), ("o", Sight.OTHER), ("n", Sight.NOTHING)]
)
def test_what_was_seen_is_taken_as_told(answer: str, sight: Sight) -> None:
    operator = ScriptedOperator(answer)
    assert AskedAttendant(operator, sure=True).saw("right_adduction", nothing) is sight
    assert "the right flipper rise" in operator.asked[0]


@pytest.mark.parametrize(("answer", "done"), [("", True), ("s", False)])
def test_hands_may_be_refused(answer: str, done: bool) -> None:
    attendant = AskedAttendant(ScriptedOperator(answer, answer), sure=True)
    assert attendant.holds_level(nothing) is done
    assert attendant.turns("left_sweep", nothing) is done


@pytest.mark.parametrize(
    ("ways_rad", "sight"),
    [
        ((0.2, 0.0, 0.0, 0.0), Sight.RIGHT),
        ((-0.2, 0.0, 0.0, 0.0), Sight.WRONG_WAY),
        ((0.0, 0.0, 0.2, 0.0), Sight.OTHER),
        ((0.2, 0.2, 0.0, 0.0), Sight.OTHER),
        ((0.0, 0.0, 0.0, 0.0), Sight.NOTHING),
    ],
)
def test_simulated_eyes_see_where_the_joints_go(
    configuration: Configuration, ways_rad: tuple[float, ...], sight: Sight
) -> None:
    rig = SimulatedRig(configuration)
    attendant = SimulatedAttendant(rig)
    attendant.watch()
    for arm, (sweep_rad, adduction_rad) in zip(rig.robot.plant.arms, (ways_rad[:2], ways_rad[2:]), strict=True):
        arm.sweep_rad += sweep_rad
        arm.adduction_rad += adduction_rad
    attendant.look()
    assert attendant.saw(JOINTS[0], nothing) is sight
