"""Calibrates a robot step by step; each step is in the notebook before the next, which belongs to these drives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

from experiments.actuator.configuration_change import apply_changes, fitted_changes
from experiments.actuator.file_change import changed_text
from experiments.actuator.fit import JointFit, fit_joint
from experiments.actuator.plan import Plan
from experiments.actuator.report import list_left_out, list_remarks
from experiments.calibration.drive_identities import Identities, calibration_records, identify_drives
from experiments.calibration.hand_steps import HandSteps, hand_changes
from experiments.calibration.report import arm_changes, report_calibration
from experiments.calibration.robots import CalibratedRobot
from experiments.calibration.torque_steps import torque_key, torque_steps
from experiments.robot.steps import OperatorStep, conduct_steps
from experiments.study.notebook import Entry, Notebook
from experiments.study.result import Result
from experiments.study.session import Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import parse_document


@dataclass(frozen=True)
class Calibration:
    session: Session
    robot: CalibratedRobot
    configuration: Configuration
    plan: Plan

    def run(self, operator: str, target: Path) -> Result:
        """Calibrate the joints, and change the configuration file if the operator agrees. Raises BenchError."""
        drives, notebook = self._move_by_hand(operator)
        changes: dict[tuple[str, ...], Any] = hand_changes(self.configuration, notebook.entries)
        begun = notebook.entries["begun"]["date"]
        in_advance = calibration_records(self.configuration, drives, drives, begun)  # the weights' daemon must arm
        corrected = parse_configuration(changed_text(self.configuration.text, changes | in_advance))
        self._try_torques(corrected, notebook)
        readings, logs = self.robot.weigh(corrected, self.plan)
        fits = [fit for joint in self.plan.joints if (fit := self._fit(joint, readings[joint], corrected)) is not None]
        changes |= (fitted := fitted_changes(fits, self.session)) | arm_changes(self.configuration, self.plan, fits)
        done = [joint for joint in self.plan.joints if ("drive", joint, "torque_constant_nm_a") in fitted]
        changes |= calibration_records(self.configuration, drives, done, begun)
        applied, ending = apply_changes(target, changes, self.session)
        weighed, simulated = (self.plan, readings, fits), self.session.simulated
        result = report_calibration(drives, notebook.entries, corrected, weighed, applied, simulated)
        notes = [*list_remarks(self.plan.joints, fits, len(list_left_out(self.plan, readings))), applied]
        return replace(result, notes=notes, logs=logs, ending=ending)

    def _move_by_hand(self, operator: str) -> tuple[Identities, Notebook]:
        """Return the drives and the notebook, with all that hands show. Raises BenchError, NotebookError."""
        with self.robot.open(self.configuration) as (test_rig, hand):
            drives = identify_drives(test_rig)
            same = {"drives": drives, **self.session.program, "configuration": parse_document(self.configuration.text)}
            notebook = Notebook(self.session.folder, {"joints": self.plan.joints, **same})
            if "begun" not in notebook.entries:
                notebook.write("begun", {"date": date.today().isoformat(), "operator": operator})
            self._conduct(HandSteps(test_rig, self.session.operator, hand).steps(self.plan.joints), notebook)
        return drives, notebook

    def _try_torques(self, corrected: Configuration, notebook: Notebook) -> None:
        left = [joint for joint in self.plan.joints if torque_key(joint) not in notebook.entries]
        if left:
            with self.robot.open(corrected) as (test_rig, _):
                self._conduct(torque_steps(test_rig, left), notebook)

    def _conduct(self, steps: Sequence[OperatorStep], notebook: Notebook) -> None:
        conduct_steps(steps, notebook, self.session.operator, self.session.show, {})

    def _fit(self, joint: str, readings: Mapping[str, Entry], corrected: Configuration) -> JointFit | None:
        return fit_joint(joint, self.plan, readings, corrected.drive[joint].torque_constant_nm_a)
