"""The two benches of the actuator calibration: a robot, joint after joint, or a simulated robot for each joint.

Each joint has a notebook and a folder of its own, so that a finished joint stays as it is when another one continues.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from experiments.actuator.calibration import TICK_S, Calibration
from experiments.actuator.fit import Entry
from experiments.actuator.plan import Plan, require_possible, steps_of
from experiments.actuator.simulation import simulated_bench
from experiments.actuator.weight_handling import ManualWeights
from experiments.robot.bench_robot import BenchRobot, disarm, leave
from experiments.robot.prompt import GO_ON, AutomaticOperator, Operator
from experiments.trials.notebook import NAME, Notebook
from experiments.trials.parallel_trials import run_parallel
from experiments.trials.session import Show
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration

FALLS = (
    "A hanging weight falls when the torque goes off: at a fault, and within two seconds after this program or its"
    " terminal ends. Put something soft below it, and keep hands and feet away."
)
REVISABLE = ("joints", "lever_tolerance_m", "weight_tolerance")
Readings = Mapping[str, Mapping[str, Entry]]  # by joint and step


class ActuatorBench(Protocol):
    @property
    def configuration(self) -> Configuration: ...

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        """Return the readings by joint and step. Raises BenchError, NotebookError."""

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Switch torque off and return the logs, however the calibration ended."""


class RobotBench:
    """An ActuatorBench with a robot and an operator."""

    def __init__(self, robot: BenchRobot) -> None:
        self._robot = robot

    @property
    def configuration(self) -> Configuration:
        return self._robot.configuration

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        require_possible(plan, self.configuration)
        self._switch_torque_off("The robot holds its pose", operator)
        weights, steps = ManualWeights(operator, plan), len(steps_of(plan))
        readings: dict[str, Mapping[str, Entry]] = {}
        for number, joint in enumerate(plan.joints):
            notebook = Notebook(folder / joint, notebook_plan(plan, joint))
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
        """A weight may hang after Ctrl-C: the operator is asked to take it off, unless Ctrl-C comes again."""
        try:
            self._robot.wait(TICK_S)  # raises for a robot that another program operates now
            self._switch_torque_off("The calibration ends; Ctrl-C again switches the torque off at once", operator)
        finally:
            logs = leave(self._robot, operator, folder)
        return logs


class SimulatedBench:
    """An ActuatorBench with a simulated robot for each joint, in a process of its own."""

    def __init__(self, configuration: Configuration, seed: int) -> None:
        self.configuration = configuration
        self._seed = seed

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        require_possible(plan, self.configuration)
        joints = [partial(_simulate, self.configuration.text, joint, plan, self._seed, folder) for joint in plan.joints]

        def show_progress() -> None:
            show(sum(_readings_in(folder / joint / NAME) for joint in plan.joints), len(steps_of(plan)) * len(joints))

        outcomes = run_parallel(joints, _discard, meanwhile=show_progress)
        return dict(zip(plan.joints, outcomes, strict=True))

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Return the logs; no robot runs any more."""
        return sorted(folder.glob("*.mcap"))


def _simulate(text: str, joint: str, plan: Plan, seed: int, folder: Path) -> dict[str, Any]:
    configuration = parse_configuration(text)
    notebook = Notebook(folder / joint, notebook_plan(plan, joint))
    robot, weights = simulated_bench(configuration, joint, plan, seed, _new_log(folder, joint))
    try:
        entries = Calibration(robot, joint, plan, weights, AutomaticOperator(_discard), notebook, _discard).run()
    finally:
        robot.close()
    return dict(entries)


def _readings_in(notebook: Path) -> int:
    """Return the number of lines after the plan; a repeated reading counts again."""
    return max(0, notebook.read_bytes().count(b"\n") - 1) if notebook.exists() else 0


def _new_log(folder: Path, joint: str) -> Path:
    """Return a path next to the logs of earlier attempts."""
    logs = (folder / f"{joint}-{number}.mcap" for number in count(1))
    return next(log for log in logs if not log.exists())


def notebook_plan(plan: Plan, joint: str) -> dict[str, Any]:
    """Return the options that must be the same when a joint continues."""
    return {name: value for name, value in asdict(plan).items() if name not in REVISABLE} | {"joint": joint}


def _discard(*_: object) -> None:
    """Show no message and no progress of one process; every reading is in the notebook of its joint."""
