"""Calibrates a robot step by step; each step is in the notebook before the next, which belongs to these drives."""

from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from experiments.actuator.configuration_change import apply_changes, fitted_changes
from experiments.actuator.file_change import changed_text
from experiments.actuator.fit import fit_joints
from experiments.actuator.plan import WeighingPlan
from experiments.actuator.report import make_result
from experiments.calibration.drive_identities import calibration_records, identify_drives
from experiments.calibration.hand_steps import HandSteps, hand_changes
from experiments.calibration.report import arm_changes, change_table, report_calibration
from experiments.calibration.robots import CalibratedRobot
from experiments.calibration.torque_steps import torque_key, torque_steps
from experiments.robot.steps import conduct_steps
from experiments.study.notebook import Notebook
from experiments.study.result import Result
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import parse_document


def calibrate_robot(
    robot: CalibratedRobot, configuration: Configuration, plan: WeighingPlan, operator: str, target: Path
) -> Result:
    """Calibrate the joints of the plan, and change the file `target` if the operator agrees.

    Raises BenchError, NotebookError.
    """
    session = robot.session
    with robot.open(configuration) as test_rig:
        drives = identify_drives(test_rig)
        same = {"drives": drives, **session.program, "configuration": parse_document(configuration.text)}
        notebook = Notebook(session.folder, {"joints": plan.joints, **same})
        entries = notebook.entries
        if "begun" not in entries:
            notebook.write("begun", {"date": date.today().isoformat(), "operator": operator})
        steps = HandSteps(test_rig, session.operator).steps(plan.joints)
        conduct_steps(steps, notebook, session.operator, session.show, {})

    changes: dict[tuple[str, ...], Any] = hand_changes(configuration, entries)
    begun = entries["begun"]["date"]
    in_advance = calibration_records(configuration, drives, drives, begun)  # the weights' daemon must arm
    corrected = parse_configuration(changed_text(configuration.text, changes | in_advance))
    if left := [joint for joint in plan.joints if torque_key(joint) not in entries]:
        with robot.open(corrected) as test_rig:
            conduct_steps(torque_steps(test_rig, left), notebook, session.operator, session.show, {})

    readings, logs = robot.weigh(corrected, plan)
    fits = fit_joints(plan, readings, corrected)
    changes |= (fitted := fitted_changes(fits, session)) | arm_changes(configuration, plan, fits)
    done = [joint for joint in plan.joints if ("drive", joint, "torque_constant_nm_a") in fitted]
    changes |= calibration_records(configuration, drives, done, begun)
    applied, ending = apply_changes(target, changes, session)
    weighed = make_result(plan, readings, fits, applied, session.simulated)
    result = report_calibration(drives, entries, corrected, plan.joints, weighed)
    tables = [*result.tables, change_table(configuration, changes)]
    return replace(result, tables=tables, logs=logs, ending=ending)
