"""Hands alone, without torque, show each error of a configuration: the robot is built otherwise than configured."""

import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import degrees, radians
from pathlib import Path
from typing import Any

import pytest

from control.records import JOINTS
from experiments.actuator.file_change import changed_text
from experiments.actuator.simulation import BuiltRobot
from experiments.bench.operator import Hand
from experiments.bench.test_rig import TestRig
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
AS_CONFIGURED: Changes = {}
CONFIGURATION = simulated_configuration()
CUBEMARS = simulated_configuration(drive_type="mit:AK80-9")


def with_changes(configuration: Configuration, changes: Changes) -> Configuration:
    uncalibrated: Changes = {("drive", joint, "calibrated"): {} for joint in JOINTS}  # a record belongs to one node id
    return parse_configuration(changed_text(configuration.text, {**uncalibrated, **changes}))


@contextmanager
def opened(
    folder: Path,
    operator: ScriptedOperator,
    configuration: Configuration = CONFIGURATION,
    truth: Changes = AS_CONFIGURED,
) -> Iterator[TestRig]:
    """Yield the rig of a robot whose truth differs from its configuration."""
    session = Session(folder, operator, lambda done, total: None, simulated=True)
    robot = CalibratedRobot(session, BuiltRobot(with_changes(configuration, truth)))
    with robot.open(configuration) as test_rig:
        yield test_rig


def conduct(test_rig: TestRig, folder: Path, operator: ScriptedOperator, *joints: str) -> dict[str, Entry]:
    """Return the notebook's entries."""
    notebook, steps = Notebook(folder, {}), HandSteps(test_rig, operator).steps(joints or JOINTS)
    conduct_steps(steps, notebook, operator, lambda done, total: None, {})
    return notebook.entries


def move_by_hand(folder: Path, configuration: Configuration, truth: Changes, *joints: str) -> dict[str, Entry]:
    operator = ScriptedOperator()
    with opened(folder, operator, configuration, truth) as test_rig:
        return conduct(test_rig, folder, operator, *joints)


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


def ends(front_deg: float, rear_deg: float, velocity_scale: float = 1.04) -> Entry:
    return {"front_rad": radians(front_deg), "rear_rad": radians(rear_deg), "velocity_scale": velocity_scale}


def test_limits_are_narrowed_for_the_joint_with_the_least_range_on_either_side() -> None:
    """A level that a hand cannot tell from zero shifts nothing."""
    zero, low, high = ("drive", "right_sweep", "zero_turn"), ("limits", "sweep_min_deg"), ("limits", "sweep_max_deg")
    wide = with_changes(CONFIGURATION, {low: -110.0, high: 110.0, zero: 0.2})
    entries = {
        level_key("left"): {"left_sweep": radians(1.9)},
        level_key("right"): {"right_sweep": radians(-10.0)},
        "left_sweep: ends": ends(90.0, -95.5),
        "right_sweep: ends": ends(75.5, -109.0),
    }
    zero_turn = 0.2 - wide.drive["right_sweep"].sign * 10.0 / 360.0
    assert hand_changes(wide, entries) == {zero: pytest.approx(zero_turn, abs=1e-5), low: -94.0, high: 84.0}


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_robot_to_practise_on_has_its_zero_a_little_off_the_configured_one(seed: int) -> None:
    zeros: Changes = {("drive", joint, "zero_turn"): 0.45 for joint in JOINTS}
    configured = with_changes(CONFIGURATION, zeros)
    built = build_with_errors(configured, seed).configuration
    (off_turn,) = {abs(drive.zero_turn - 0.45) for drive in built.drive.values()} - {0.0}
    assert 0.03 <= off_turn <= 0.1


class WaitingOperator(ScriptedOperator):
    """Looks at the robot this often before each answer."""

    def __init__(self, looks: int) -> None:
        super().__init__()
        self._looks = looks

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        for _ in range(self._looks):
            meanwhile()
        return super().ask(question, answers, lambda: None)


def test_a_prompt_that_waits_for_hours_takes_no_memory(tmp_path: Path) -> None:
    operator = WaitingOperator(50)
    with opened(tmp_path, operator) as test_rig:
        tracemalloc.start()
        HandSteps(test_rig, operator).steps(["left_sweep"])[0].prepare()
        kept_bytes, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert kept_bytes < 1_000_000  # all ticks of these 5 s have 3 MB


def test_an_operator_who_turns_nothing_is_asked_again_and_then_refused(tmp_path: Path) -> None:
    operator = WaitingOperator(0)
    with opened(tmp_path, operator) as test_rig:
        test_rig.operator.hand = Hand()  # does nothing
        with pytest.raises(BenchError, match="left_sweep turned by 0 degrees|turned instead of left_sweep"):
            conduct(test_rig, tmp_path, operator, "left_sweep")
    assert len(operator.reported) == 2


def test_exchanged_motors_end_the_calibration_with_what_to_do(tmp_path: Path) -> None:
    exchanged: Changes = {("drive", "left_sweep", "node_id"): 1, ("drive", "left_adduction", "node_id"): 0}
    with pytest.raises(BenchError, match="left_adduction turned instead of left_sweep.*node ids"):
        move_by_hand(tmp_path, CONFIGURATION, exchanged, "left_sweep")


def test_a_velocity_whose_scale_is_no_key_is_refused() -> None:
    entries = {level_key("left"): {"left_sweep": 0.0}, "left_sweep: ends": ends(90.0, -90.0, velocity_scale=1.2)}
    with pytest.raises(BenchError, match="left_sweep: .* 1.20 times"):
        hand_changes(CONFIGURATION, entries)


def test_a_joint_is_moved_again_and_the_step_before_is_redone_on_request(tmp_path: Path) -> None:
    """The level flipper, front; the one before; level, front, rear: again; front, rear."""
    operator = ScriptedOperator(GO_ON, REDO, GO_ON, GO_ON, REDO, GO_ON, GO_ON)
    with opened(tmp_path, operator) as test_rig:
        entries = conduct(test_rig, tmp_path, operator, "left_sweep")
    assert len(operator.asked) == 7 and entries.keys() == {level_key("left"), "left_sweep: ends"}
