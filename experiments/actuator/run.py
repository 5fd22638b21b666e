"""The actuator calibration as the command line runs it: read the weights, fit each joint, apply the constants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.actuator.bench import ActuatorBench, RobotBench, SimulatedBench
from experiments.actuator.configuration_change import apply_fits, find_target
from experiments.actuator.fit import JointFit, fit_joint
from experiments.actuator.plan import Plan
from experiments.actuator.report import TITLE, make_sections, make_tables
from experiments.actuator.simulation import bench_configuration, truth_rows
from experiments.actuator.summary import list_left_out, make_report
from experiments.reports.report_page import Section
from experiments.reports.text_tables import text_of_tables
from experiments.robot.daemon_robot import DaemonRobot
from experiments.trials.session import Ending, Finding, Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration

TRUTH = "The simulated motors themselves"


@dataclass(frozen=True)
class Order:
    """The options of one calibration."""

    plan: Callable[[Configuration], Plan]  # its lever may be the flipper of the robot
    apply: bool
    configuration: Path | None  # the file to change
    seed: int  # of the simulated motors


def calibrate(session: Session, order: Order, default_configuration: Path) -> Finding:
    """Raises BenchError with what to do, ConfigurationError, NotebookError."""
    bench = _open_bench(session, order)
    simulated = session.socket is None
    file = order.configuration or default_configuration
    try:
        target = find_target(file, bench.configuration.text, session, simulated) if order.apply else None
        plan = order.plan(bench.configuration)
        readings = bench.calibrate(plan, session.folder, session.operator, session.show)
    finally:
        logs = bench.leave(session.folder, session.operator)
    drives = bench.configuration.drive
    fits = [
        fit
        for joint in plan.joints
        if (fit := fit_joint(joint, plan, readings[joint], drives[joint].torque_constant_nm_a)) is not None
    ]
    applied, ending = apply_fits(target, fits, session) if target else ("", Ending.DONE)
    tables, sections = make_tables(fits), make_sections(plan, readings, fits)
    if simulated:
        rows = truth_rows(fits)
        tables.append((TRUTH, rows))
        sections.append(Section(TRUTH, rows=rows))
    remarks = list_remarks(plan.joints, fits, len(list_left_out(plan, readings))) + [applied] * bool(applied)
    text = "\n\n".join([text_of_tables(tables), *(["\n".join(remarks)] if remarks else [])])
    report = make_report(plan, readings, fits, applied or None)
    return Finding(report, TITLE, sections, text, logs, ending)


def _open_bench(session: Session, order: Order) -> ActuatorBench:
    if session.socket is not None:
        return RobotBench(DaemonRobot(session.socket))
    configuration = load_configuration(order.configuration) if order.configuration else bench_configuration()
    return SimulatedBench(configuration, order.seed)


def list_remarks(joints: Sequence[str], fits: Sequence[JointFit], left_out: int) -> list[str]:
    fitted = {fit.joint for fit in fits}
    remarks = [f"{joint}: too few readings for a line" for joint in joints if joint not in fitted]
    remarks += [
        f"{fit.joint}: by the sign of the current the weights pull upwards: check drive.{fit.joint}.sign"
        for fit in fits
        if fit.direction > 0 and fit.joint.endswith("adduction")
    ]
    if left_out:
        remarks.append(f"{left_out} readings are left out: see the report")
    return remarks
