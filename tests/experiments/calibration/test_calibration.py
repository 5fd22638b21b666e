"""A calibration continues after an interruption at any prompt, and belongs to its configuration and drives."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from control.records import JOINTS
from drivers.drive import DriveCalibration
from experiments.actuator.configuration_change import find_target
from experiments.actuator.file_change import changed_text
from experiments.actuator.friction import Loop
from experiments.actuator.plan import WeighingPlan, steps_of
from experiments.actuator.report import Readings
from experiments.actuator.simulation import BuiltRobot
from experiments.calibration.calibration import calibrate_robot
from experiments.calibration.robots import CalibratedRobot
from experiments.robot.bench_errors import EndedError
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

    def weigh(self, configuration: Configuration, plan: WeighingPlan) -> tuple[Readings, list[Path]]:
        self.session.operator.ask("weights", {"": "done"}, lambda: None)
        entries = {
            step.key: {
                "current_a": plan.torque_nm(step.weight_g) / TRUE_NM_A + 0.8,
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


def test_another_drive_is_no_continuation(case: Case) -> None:
    with pytest.raises(KeyboardInterrupt):
        case.run(InterruptedOperator(3))
    other = replace(case, truth={**case.truth, ("drive", JOINT, "serial_number"): "111111111111"})
    with pytest.raises(NotebookError, match=f"drives.{JOINT}.serial_number = 3854345a3133.*= 111111111111"):
        other.run(ScriptedOperator())


def test_nothing_moves_without_the_operator_s_consent(case: Case) -> None:
    with pytest.raises(EndedError):
        case.run(ScriptedOperator("", "", "", "n"))
