"""A calibration continues after an interruption at any prompt, and belongs to its configuration and drives."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from math import nan
from pathlib import Path
from typing import Any

import pytest
from pandas import DataFrame

from control.records import JOINTS
from drivers.drive import DriveCalibration
from experiments.actuator.configuration_change import find_target
from experiments.actuator.file_change import changed_text
from experiments.actuator.fit import JointFit
from experiments.actuator.friction import Loop
from experiments.actuator.plan import WeighingPlan, steps_of
from experiments.actuator.report import Readings
from experiments.actuator.simulation import BuiltRobot
from experiments.calibration.calibration import calibrate_robot
from experiments.calibration.drive_identities import Identities, calibration_records
from experiments.calibration.report import arm_changes
from experiments.calibration.robots import CalibratedRobot
from experiments.robot.bench_errors import BenchError, EndedError
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.study.notebook import NotebookError
from experiments.study.result import Result
from experiments.study.session import Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from tests.scripted_operator import ScriptedOperator

JOINT = "right_adduction"
PLAN = WeighingPlan((JOINT,), weights_g=(200.0, 400.0), trials=2, trusts_constant=False)
UNCALIBRATED: dict[tuple[str, ...], Any] = {("drive", joint, "calibrated"): {} for joint in JOINTS}
CONFIGURATION = parse_configuration(changed_text(simulated_configuration().text, UNCALIBRATED))
TRUE_NM_A = 0.072
LOOPS = [Loop(0.2, 0.2, quick, 0.8)._asdict() for quick in (False, False, True, True)]


class WeighedRobot(CalibratedRobot):
    """A simulated robot whose weights are read without an error, and without the minutes that they take."""

    scatter_a = 0.0  # of the trials

    def weigh(self, configuration: Configuration, plan: WeighingPlan) -> tuple[Readings, list[Path]]:
        assert all(drive.calibrated.date for drive in configuration.drive.values())  # as their daemon requires
        self.session.operator.ask("weights", {"": "done"}, lambda: None)
        entries = {
            step.key: {
                "current_a": plan.torque_nm(step.weight_g) / TRUE_NM_A + 0.8 + step.trial % 2 * self.scatter_a,
                "rest_friction_a": 0.1,
                "angle_rad": 0.0,
                "loops": LOOPS,
            }
            for step in steps_of(plan)
        }
        return {JOINT: entries}, []


class InterruptedOperator(ScriptedOperator):
    """Presses Ctrl-C at one prompt."""

    def __init__(self, at: int) -> None:
        super().__init__()
        self._at = at

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        if len(self.asked) == self._at:
            raise KeyboardInterrupt
        return super().ask(question, answers, meanwhile)


@dataclass
class Case:
    folder: Path
    truth: Mapping[tuple[str, ...], Any]

    def run(self, operator: ScriptedOperator) -> Result:
        session = Session(self.folder, operator, lambda done, total: None, simulated=True)
        built = BuiltRobot(parse_configuration(changed_text(CONFIGURATION.text, self.truth)), TRUE_NM_A)
        target = find_target(self.folder, CONFIGURATION.text, session)
        return calibrate_robot(WeighedRobot(session, built), CONFIGURATION, PLAN, "Ada", target)


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path, {("drive", JOINT, "sign"): -1, ("drive", JOINT, "serial_number"): "3854345a3133"})


def changed(case: Case) -> Configuration:
    return parse_configuration((case.folder / "mudskipper.toml").read_text(encoding="utf-8"))


def test_nothing_is_lost_by_an_interruption_at_a_prompt(case: Case, tmp_path: Path) -> None:
    """Level, both ends, torque, weights, difference; only the interrupted prompt, and its joint's, are asked again."""
    whole, again = ScriptedOperator(), replace(case, folder=tmp_path / "again")
    expected = case.run(whole).json()
    assert len(whole.asked) == 6
    again.folder.mkdir()
    interrupted = [InterruptedOperator(at) for at in (1, 2, 2)]  # at an end, the torque and the difference
    for operator in interrupted:
        with pytest.raises(KeyboardInterrupt):
            again.run(operator)
    last = ScriptedOperator()
    assert again.run(last).json()["hands"] == expected["hands"]
    assert sum(len(operator.asked) for operator in (*interrupted, last)) in range(6, 13)
    assert changed(again).drive == changed(case).drive


def test_the_configuration_gets_what_was_found(case: Case) -> None:
    result = case.run(ScriptedOperator())
    drive = changed(case).drive[JOINT]
    assert drive.sign == -1
    assert drive.torque_constant_nm_a == pytest.approx(TRUE_NM_A, rel=0.01)
    assert changed(case).arm.arm_mass_kg == pytest.approx(0.8 * TRUE_NM_A / (9.81 * 0.06), rel=0.01)
    assert drive.calibrated == DriveCalibration(date.today().isoformat(), "3854345a3133")
    assert not changed(case).drive["left_sweep"].calibrated.date  # it was not calibrated
    numbers = result.json()
    assert numbers["operator"] == "Ada" and numbers["drives"][JOINT]["serial_number"] == "3854345a3133"
    assert {"motion under torque", "current over command"} <= {each["reading"] for each in numbers["torques"]}


def test_a_joint_whose_torque_constant_is_uncertain_is_not_calibrated(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(WeighedRobot, "scatter_a", 1.0)
    case.run(ScriptedOperator())
    drive = changed(case).drive[JOINT]
    assert (drive.sign, drive.torque_constant_nm_a) == (-1, CONFIGURATION.drive[JOINT].torque_constant_nm_a)
    assert not drive.calibrated.date and not drive.serial_number


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [("node_id", 9, "messages of node .* on"), ("torque_constant_nm_a", 0.1, "current over command is 0.8")],
)
def test_a_drive_that_is_not_as_configured_ends_the_calibration(
    case: Case, key: str, value: float, problem: str
) -> None:
    with pytest.raises(BenchError, match=problem):
        replace(case, truth={**case.truth, ("drive", JOINT, key): value}).run(ScriptedOperator())


def test_the_mass_of_the_arm_is_the_mean_of_those_that_swing_in_air() -> None:
    arm = CONFIGURATION.arm
    lever_m_s2 = PLAN.gravity_m_s2 * arm.center_of_mass_m

    def found(*masses_kg: float) -> Mapping[tuple[str, ...], Any]:
        joints = ("left_sweep", "left_adduction", "right_adduction")  # a sweep joint lifts another arm on the bench
        lifted_nm = [mass_kg * lever_m_s2 for mass_kg in (1.0, *masses_kg)]
        numbers = [{"joint": joint, "lifted_nm": nm} for joint, nm in zip(joints, lifted_nm, strict=True)]
        return arm_changes(CONFIGURATION, PLAN, [JointFit(each, DataFrame(), []) for each in numbers])

    assert found(1.1 * arm.arm_mass_kg, 1.5 * arm.arm_mass_kg) == {
        ("arm", "arm_mass_kg"): pytest.approx(1.3 * arm.arm_mass_kg, abs=1e-4)
    }
    assert not found(1.05 * arm.arm_mass_kg, 1.1 * arm.arm_mass_kg) and not found(0.9 * arm.arm_mass_kg, nan)


def test_a_serial_number_of_zeros_is_none() -> None:
    drives: Identities = {JOINT: {"serial_number": "000000000000"}}
    record = calibration_records(CONFIGURATION, drives, [JOINT], "2026-11-28")[("drive", JOINT, "calibrated")]
    assert record["drive"] == CONFIGURATION.drive[JOINT].identity == "right 2"


def test_another_drive_is_no_continuation(case: Case) -> None:
    with pytest.raises(KeyboardInterrupt):
        case.run(InterruptedOperator(3))
    other = replace(case, truth={**case.truth, ("drive", JOINT, "serial_number"): "111111111111"})
    with pytest.raises(NotebookError, match=f"drives.{JOINT}.serial_number = 3854345a3133.*= 111111111111"):
        other.run(ScriptedOperator())


def test_nothing_moves_without_the_operator_s_consent(case: Case) -> None:
    with pytest.raises(EndedError):
        case.run(ScriptedOperator("", "", "", "n"))
