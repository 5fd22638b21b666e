"""Hands alone, without torque, show each error of a configuration: the robot is built otherwise than configured."""

import tracemalloc
from collections.abc import Callable, Mapping
from math import degrees, radians
from pathlib import Path
from typing import Any

import pytest

from control.records import JOINTS
from experiments.actuator.file_change import changed_text
from experiments.actuator.simulation import BuiltRobot
from experiments.bench.operator import Hand
from experiments.calibration.hand_steps import HandSteps, hand_changes, level_key, stops_deg
from experiments.calibration.robots import CalibratedRobot, build_with_errors
from experiments.robot.bench_errors import BenchError
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.robot.steps import conduct_steps
from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON, REDO
from experiments.study.session import Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.body.plant import END_STOPS_RAD
from tests.scripted_operator import ScriptedOperator

Changes = Mapping[tuple[str, ...], Any]
CONFIGURATION = simulated_configuration()
STOPS_DEG = {"min": -110.0, "max": 110.0}
CUBEMARS = simulated_configuration(drive_type="mit:AK80-9")


def with_changes(configuration: Configuration, changes: Changes) -> Configuration:
    uncalibrated: Changes = {("drive", joint, "calibrated"): {} for joint in JOINTS}  # a record belongs to one node id
    return parse_configuration(changed_text(configuration.text, {**uncalibrated, **changes}))


def move_by_hand(
    folder: Path, configuration: Configuration, truth: Changes, *joints: str, operator: ScriptedOperator | None = None
) -> dict[str, Entry]:
    """Return the notebook's entries of a robot whose truth differs from its configuration."""
    operator = operator or ScriptedOperator()
    session = Session(folder, operator, lambda done, total: None, simulated=True)
    robot = CalibratedRobot(session, BuiltRobot(with_changes(configuration, truth)))
    notebook = Notebook(folder, {})
    with robot.open(configuration) as test_rig:
        steps = HandSteps(test_rig, operator).steps(joints or JOINTS)
        conduct_steps(steps, notebook, operator, session.show, {})
    return notebook.entries


@pytest.mark.parametrize(
    ("configuration", "truth"),
    [
        (CONFIGURATION, {}),
        (CONFIGURATION, {("drive", "right_sweep", "sign"): 1}),
        (CONFIGURATION, {("drive", "left_adduction", "zero_turn"): 0.07}),
        (CONFIGURATION, {("drive", "left_sweep", "sign"): -1, ("drive", "left_sweep", "zero_turn"): -0.1}),
        (CUBEMARS, {("drive", "right_adduction", "velocity_range_rad_s"): 25.64}),
        (CUBEMARS, {("drive", "left_sweep", "velocity_range_rad_s"): 65.0, ("drive", "left_sweep", "sign"): -1}),
    ],
)
def test_the_truth_is_recovered_and_nothing_else_is_changed(
    tmp_path: Path, configuration: Configuration, truth: dict[tuple[str, ...], Any]
) -> None:
    entries = move_by_hand(tmp_path, configuration, truth)
    found = hand_changes(configuration, entries)
    assert found.keys() == truth.keys()
    for key, value in truth.items():
        assert found[key] == pytest.approx(value, rel=0.03, abs=0.001)
    for joint, stop_rad in zip(JOINTS, 2 * END_STOPS_RAD, strict=True):
        assert stops_deg(entries, joint) == pytest.approx((-degrees(stop_rad), degrees(stop_rad)), abs=0.2)


def test_a_limit_beyond_a_stop_is_narrowed_to_one_degree_before_it(tmp_path: Path) -> None:
    wide = with_changes(CONFIGURATION, {("limits", "sweep_max_deg"): 110.0})
    found = hand_changes(wide, move_by_hand(tmp_path, wide, {}, "left_sweep"))
    assert found == {("limits", "sweep_max_deg"): 98.0}


def test_limits_are_narrowed_for_the_joint_with_the_least_range_on_either_side() -> None:
    """A level that a hand cannot tell from zero shifts nothing."""

    def ends(front_deg: float, rear_deg: float) -> Entry:
        return {"front_rad": radians(front_deg), "rear_rad": radians(rear_deg), "velocity_scale": 1.04}

    limits = {("limits", f"sweep_{end}_deg"): deg for end, deg in STOPS_DEG.items()}
    wide = with_changes(CONFIGURATION, limits | {("drive", "right_sweep", "zero_turn"): 0.2})
    entries = {
        level_key("left"): {"left_sweep": radians(1.9)},
        level_key("right"): {"right_sweep": radians(-10.0)},
        "left_sweep: ends": ends(90.0, -95.5),
        "right_sweep: ends": ends(75.5, -109.0),
    }
    zero_turn = 0.2 - wide.drive["right_sweep"].sign * 10.0 / 360.0
    assert hand_changes(wide, entries) == {
        ("drive", "right_sweep", "zero_turn"): pytest.approx(zero_turn, abs=1e-5),
        ("limits", "sweep_min_deg"): -94.0,
        ("limits", "sweep_max_deg"): 84.0,
    }


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_robot_to_practise_on_has_its_zero_a_little_off_the_configured_one(seed: int) -> None:
    zeros: Changes = {("drive", joint, "zero_turn"): 0.45 for joint in JOINTS}
    configured = with_changes(CONFIGURATION, zeros)
    built = build_with_errors(configured, seed).configuration
    (off_turn,) = {abs(drive.zero_turn - 0.45) for drive in built.drive.values()} - {0.0}
    assert 0.03 <= off_turn <= 0.1


def test_a_prompt_that_waits_for_hours_takes_no_memory(tmp_path: Path) -> None:
    session = Session(tmp_path, ScriptedOperator(), lambda done, total: None, simulated=True)
    with CalibratedRobot(session, BuiltRobot(CONFIGURATION)).open(CONFIGURATION) as test_rig:
        steps = HandSteps(test_rig, PatientOperator()).steps(["left_sweep"])
        tracemalloc.start()
        steps[0].prepare()
        kept_bytes, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert kept_bytes < 1_000_000  # all ticks of these 5 s have 3 MB


class PatientOperator(ScriptedOperator):
    """Answers after five seconds."""

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        for _ in range(50):
            meanwhile()
        return super().ask(question, answers, meanwhile)


class HastyOperator(ScriptedOperator):
    """Answers before the robot is looked at once."""

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        return super().ask(question, answers, lambda: None)


def test_an_operator_who_turns_nothing_is_asked_again_and_then_refused(tmp_path: Path) -> None:
    operator = HastyOperator()
    session = Session(tmp_path, operator, lambda done, total: None, simulated=True)
    with CalibratedRobot(session, BuiltRobot(CONFIGURATION)).open(CONFIGURATION) as test_rig:
        test_rig.operator.hand = Hand()  # does nothing
        steps = HandSteps(test_rig, operator).steps(["left_sweep"])
        with pytest.raises(BenchError, match="left_sweep turned by 0 degrees|turned instead of left_sweep"):
            conduct_steps(steps, Notebook(tmp_path, {}), operator, session.show, {})
    assert len(operator.reported) == 2


def test_exchanged_motors_end_the_calibration_with_what_to_do(tmp_path: Path) -> None:
    exchanged: Changes = {("drive", "left_sweep", "node_id"): 1, ("drive", "left_adduction", "node_id"): 0}
    with pytest.raises(BenchError, match="left_adduction turned instead of left_sweep.*node ids"):
        move_by_hand(tmp_path, CONFIGURATION, exchanged, "left_sweep")


def test_a_velocity_whose_scale_is_no_key_is_refused(tmp_path: Path) -> None:
    entries = move_by_hand(tmp_path, CONFIGURATION, {}, "left_sweep")
    entries["left_sweep: ends"]["velocity_scale"] = 1.2
    with pytest.raises(BenchError, match="left_sweep: .* 1.20 times"):
        hand_changes(CONFIGURATION, entries)


def test_a_joint_is_moved_again_and_the_step_before_is_redone_on_request(tmp_path: Path) -> None:
    """The level flipper, front; the one before; level, front, rear: again; front, rear."""
    operator = ScriptedOperator(GO_ON, REDO, GO_ON, GO_ON, REDO, GO_ON, GO_ON)
    entries = move_by_hand(tmp_path, CONFIGURATION, {}, "left_sweep", operator=operator)
    assert len(operator.asked) == 7 and entries.keys() == {level_key("left"), "left_sweep: ends"}
