"""The actuator calibration as the command line runs it: read the weights, fit each joint, apply the constants.

The bench is a robot, joint after joint, or a simulated robot for each joint. Each joint has a notebook and a folder of
its own, so that a finished joint stays as it is when another one continues.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from experiments.actuator.calibration import TICK_S, Calibration
from experiments.actuator.configuration_change import apply_fits, find_target
from experiments.actuator.fit import Entry, JointFit, fit_joint
from experiments.actuator.plan import Plan, require_possible, steps_of
from experiments.actuator.report import TITLE, Readings, list_left_out, make_report, make_sections, make_tables
from experiments.actuator.simulation import bench_configuration, simulated_bench, truth_rows
from experiments.actuator.weight_handling import ManualWeights
from experiments.reports.report_page import Section
from experiments.reports.text_tables import text_of_tables
from experiments.robot.bench_robot import BenchRobot, disarm, leave
from experiments.robot.daemon_robot import DaemonRobot
from experiments.robot.prompt import GO_ON, AutomaticOperator, Operator
from experiments.study.notebook import Notebook, count_entries
from experiments.study.workers import LocalWorkers, run_parallel
from experiments.trials.session import Ending, Finding, Session, Show
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration, parse_configuration
from firmware_host.configuration.toml_records import parse_document

TRUTH = "The simulated motors themselves"
FALLS = (
    "A hanging weight falls when the torque goes off: at a fault, and within two seconds after this program or its"
    " terminal ends. Put something soft below it, and keep hands and feet away."
)
REVISABLE = ("joints", "lever_tolerance_m", "weight_tolerance")


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


def _open_bench(session: Session, order: Order) -> RobotBench | SimulatedBench:
    if session.socket is not None:
        return RobotBench(DaemonRobot(session.socket), session.program)
    configuration = load_configuration(order.configuration) if order.configuration else bench_configuration()
    return SimulatedBench(configuration, order.seed, session.program)


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


class RobotBench:
    """A robot and an operator."""

    def __init__(self, robot: BenchRobot, program: Mapping[str, str] = {}) -> None:
        self._robot, self.configuration, self._program = robot, robot.configuration, program

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        """Return the readings by joint and step. Raises BenchError, NotebookError."""
        require_possible(plan, self.configuration)
        self._switch_torque_off("The robot holds its pose", operator)
        weights, steps = ManualWeights(operator, plan), len(steps_of(plan))
        readings: dict[str, Mapping[str, Entry]] = {}
        for number, joint in enumerate(plan.joints):
            notebook = Notebook(folder / joint, notebook_plan(plan, joint, self.configuration, self._program))
            if notebook.entries:
                operator.report(f"{joint}: {len(notebook.entries)} of {steps} readings are done already.")
            if len(notebook.entries) < steps:
                operator.report(FALLS)

            def show_all(done: int, total: int, before: int = number) -> None:
                show(before * total + done, len(plan.joints) * total)

            readings[joint] = Calibration(self._robot, joint, plan, weights, operator, notebook, show_all).run()
            self._switch_torque_off(f"{joint} is done", operator)
        return readings

    def _switch_torque_off(self, why: str, operator: Operator) -> None:
        """Ask the operator to take off the weight and hold the flipper first."""
        if self._robot.call("status")["mode"] == "hold":
            question = f"{why}. Take off the weight and hold the flipper: torque goes off."
            operator.ask(question, {GO_ON: "it is held"}, lambda: self._robot.wait(TICK_S))
            disarm(self._robot)

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Switch torque off and return the logs, however the calibration ended.

        A weight may hang after Ctrl-C: the operator is asked to take it off, unless Ctrl-C comes again.
        """
        try:
            self._robot.wait(TICK_S)  # raises for a robot that another program operates now
            self._switch_torque_off("The calibration ends; Ctrl-C again switches the torque off at once", operator)
        finally:
            logs = leave(self._robot, operator, folder)
        return logs


@dataclass(frozen=True)
class SimulatedBench:
    """A simulated robot for each joint, in a process of its own."""

    configuration: Configuration
    seed: int
    program: Mapping[str, str] = field(default_factory=dict)

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        require_possible(plan, self.configuration)
        same = {"simulated_seed": self.seed, **self.program}
        joints = [partial(_simulate, self.configuration.text, joint, plan, same, folder) for joint in plan.joints]

        def show_progress() -> None:
            show(sum(count_entries(folder / joint) for joint in plan.joints), len(steps_of(plan)) * len(joints))

        outcomes = run_parallel(joints, _discard, LocalWorkers(meanwhile=show_progress))
        return dict(zip(plan.joints, outcomes, strict=True))

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Return the logs; no robot runs any more."""
        return sorted(folder.glob("*.mcap"))


def _simulate(text: str, joint: str, plan: Plan, same: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    configuration = parse_configuration(text)
    notebook = Notebook(folder / joint, notebook_plan(plan, joint, configuration, same))
    robot, weights = simulated_bench(configuration, joint, plan, same["simulated_seed"], _new_log(folder, joint))
    try:
        entries = Calibration(robot, joint, plan, weights, AutomaticOperator(_discard), notebook, _discard).run()
    finally:
        robot.close()
    return dict(entries)


def _new_log(folder: Path, joint: str) -> Path:
    """Return a path next to the logs of earlier attempts."""
    logs = (folder / f"{joint}-{number}.mcap" for number in count(1))
    return next(log for log in logs if not log.exists())


def notebook_plan(plan: Plan, joint: str, configuration: Configuration, same: Mapping[str, Any]) -> dict[str, Any]:
    """Return what must be the same when a joint continues."""
    options = {name: value for name, value in asdict(plan).items() if name not in REVISABLE}
    return {"joint": joint, **options, **same, "configuration": parse_document(configuration.text)}


def _discard(*_: object) -> None:
    """Show no message and no progress of one process; every reading is in the notebook of its joint."""
