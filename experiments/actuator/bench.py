"""The bench of the actuator calibration: a robot with an operator, or a simulated robot for each joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from experiments.actuator.calibration import TICK_S, Calibration
from experiments.actuator.plan import Plan, require_possible, steps_of
from experiments.actuator.report import Readings
from experiments.actuator.simulation import BuiltRobot, simulated_bench
from experiments.actuator.weight_handling import ManualWeights
from experiments.robot.bench_robot import BenchRobot, disarm, leave
from experiments.study.notebook import Entry, Notebook, count_entries
from experiments.study.prompt import GO_ON, AutomaticOperator, Operator
from experiments.study.session import Session
from experiments.study.workers import run_locally, run_parallel
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.toml_records import parse_document

FALLS = (
    "A hanging weight falls when the torque goes off: at a fault, and within two seconds after this program or its"
    " terminal ends. Put something soft below it, and keep hands and feet away."
)
REVISABLE = ("joints", "lever_tolerance_m", "weight_tolerance")


class RobotBench:
    def __init__(self, robot: BenchRobot, session: Session) -> None:
        self._robot, self._session, self._operator = robot, session, session.operator
        self.configuration = robot.configuration

    def calibrate(self, plan: Plan) -> Readings:
        """Return the readings by joint and step. Raises BenchError, NotebookError."""
        require_possible(plan, self.configuration)
        self._switch_torque_off("The robot holds its pose")
        weights, steps = ManualWeights(self._operator, plan), len(steps_of(plan))
        readings: dict[str, Mapping[str, Entry]] = {}
        for number, joint in enumerate(plan.joints):
            same = notebook_plan(plan, joint, self.configuration, self._session.program)
            notebook = Notebook(self._session.folder / joint, same)
            if notebook.entries:
                self._operator.report(f"{joint}: {len(notebook.entries)} of {steps} readings are done already.")
            if len(notebook.entries) < steps:
                self._operator.report(FALLS)
            readings[joint] = Calibration(
                robot=self._robot,
                joint=joint,
                plan=plan,
                weights=weights,
                operator=self._operator,
                notebook=notebook,
                show=partial(self._show, number, len(plan.joints)),
            ).run()
            self._switch_torque_off(f"{joint} is done")
        return readings

    def _show(self, joints_done: int, joints: int, done: int, total: int) -> None:
        self._session.show(joints_done * total + done, joints * total)

    def _switch_torque_off(self, why: str) -> None:
        """Ask the operator to take off the weight and hold the flipper first."""
        if self._robot.call("status")["mode"] == "hold":
            question = f"{why}. Take off the weight and hold the flipper: torque goes off."
            self._operator.ask(question, {GO_ON: "it is held"}, lambda: self._robot.wait(TICK_S))
            disarm(self._robot)

    def leave(self) -> list[Path]:
        """Switch torque off and return the logs, however the calibration ended.

        A weight may hang after Ctrl-C: the operator is asked to take it off, unless Ctrl-C comes again.
        """
        try:
            self._robot.wait(TICK_S)  # raises for a robot that another program operates now
            self._switch_torque_off("The calibration ends; Ctrl-C again switches the torque off at once")
        finally:
            logs = leave(self._robot, self._operator, self._session.folder)
        return logs


@dataclass(frozen=True)
class SimulatedBench:
    """A simulated robot for each joint, in a process of its own; one after the other where the operator practises."""

    configuration: Configuration
    seed: int
    session: Session
    built: BuiltRobot | None = None  # where it differs from the configuration
    practises: bool = False

    def calibrate(self, plan: Plan) -> Readings:
        require_possible(plan, self.configuration)
        folder, total = self.session.folder, len(steps_of(plan)) * len(plan.joints)
        same = {"simulated_seed": self.seed, **self.session.program}
        built = self.built or BuiltRobot(self.configuration)
        if self.practises:
            operator = self.session.operator
            return {
                joint: _simulate(self.configuration, joint, plan, same, folder, built, operator)
                for joint in plan.joints
            }
        joints = [partial(_simulate, self.configuration, joint, plan, same, folder, built) for joint in plan.joints]

        def show_progress() -> None:
            self.session.show(sum(count_entries(folder / joint) for joint in plan.joints), total)

        outcomes = run_parallel(joints, _discard, partial(run_locally, meanwhile=show_progress))
        return dict(zip(plan.joints, outcomes, strict=True))

    def leave(self) -> list[Path]:
        """Return the logs; no robot runs any more."""
        return sorted(self.session.folder.glob("*.mcap"))


def _simulate(
    configuration: Configuration,
    joint: str,
    plan: Plan,
    same: Mapping[str, Any],
    folder: Path,
    built: BuiltRobot,
    prompted: Operator | None = None,
) -> dict[str, Any]:
    notebook = Notebook(folder / joint, notebook_plan(plan, joint, configuration, same))
    logs = (folder / f"{joint}-{number}.mcap" for number in count(1))  # next to those of earlier attempts
    log = next(log for log in logs if not log.exists())
    prompts = ManualWeights(prompted, plan) if prompted else None
    robot, weights = simulated_bench(configuration, joint, plan, same["simulated_seed"], log, built, prompts)
    try:
        calibration = Calibration(
            robot=robot,
            joint=joint,
            plan=plan,
            weights=weights,
            operator=prompted or AutomaticOperator(_discard),
            notebook=notebook,
            show=_discard,
        )
        return dict(calibration.run())
    finally:
        robot.close()


def notebook_plan(plan: Plan, joint: str, configuration: Configuration, same: Mapping[str, Any]) -> dict[str, Any]:
    """Return what must be the same when a joint continues."""
    options = {name: value for name, value in asdict(plan).items() if name not in REVISABLE}
    return {"joint": joint, **options, **same, "configuration": parse_document(configuration.text)}


def _discard(*_: object) -> None:
    """Show no message and no progress of one process; every reading is in the notebook of its joint."""
