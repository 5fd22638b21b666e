"""Where the actuator calibration happens: at a robot, one joint after the other, or at simulated benches side by side.

Each joint has a notebook and a folder of its own below that of the results, so that a joint that is finished is not
touched when another one goes on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from experiments.actuator.calibration import TICK_S, Calibration, Show
from experiments.actuator.fit import Entry
from experiments.actuator.plan import Plan, require_possible, steps_of
from experiments.actuator.simulation import simulated_bench
from experiments.actuator.weight_handling import PersonsHand
from experiments.robot.bench_robot import BenchRobot, disarm, leave
from experiments.robot.prompt import GO_ON, AutomaticOperator, Operator
from experiments.trials.notebook import NAME, Notebook
from experiments.trials.parallel_trials import run_parallel
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration

FALLS = (
    "What hangs falls when the torque goes off: at a fault, and within two seconds where this program dies or its"
    " terminal closes. Put something soft right below it, and keep hands and feet from there."
)
REVISABLE = ("joints", "lever_tolerance_m", "weight_tolerance")
Readings = Mapping[str, Mapping[str, Entry]]  # by joint and step


class ActuatorBench(Protocol):
    @property
    def configuration(self) -> Configuration: ...

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        """Raises BenchError, NotebookError."""

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Torque off, and the logs in the folder, however it has ended."""


class RobotBench:
    """An ActuatorBench with a robot and a person."""

    def __init__(self, robot: BenchRobot) -> None:
        self._robot = robot

    @property
    def configuration(self) -> Configuration:
        return self._robot.configuration

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        require_possible(plan, self.configuration)
        self._let_go("The robot holds its pose", operator)
        hand, count = PersonsHand(operator, plan), len(steps_of(plan))
        readings: dict[str, Mapping[str, Entry]] = {}
        for number, joint in enumerate(plan.joints):
            notebook = Notebook(folder / joint, notes_of(plan, joint))
            if notebook.begun:
                operator.report(f"{joint}: {len(notebook.entries)} of {count} readings are there already.")
            if len(notebook.entries) < count:
                operator.report(FALLS)

            def show_all(done: int, total: int, before: int = number) -> None:
                show(before * total + done, len(plan.joints) * total)

            readings[joint] = Calibration(self._robot, joint, plan, hand, operator, notebook, show_all).run()
            self._let_go(f"{joint} is done", operator)
        return readings

    def _let_go(self, why: str, operator: Operator) -> None:
        """A joint is mounted with torque off, and nothing that hangs on it is dropped."""
        if self._robot.call("status")["mode"] == "hold":
            question = f"{why}. Take off what hangs and hold the flipper: torque goes off."
            operator.ask(question, {GO_ON: "it is held"}, lambda: self._robot.wait(TICK_S))
            disarm(self._robot)

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Ctrl-C in the middle may find a weight on the arm: it is asked for first, unless Ctrl-C comes again."""
        try:
            self._robot.wait(TICK_S)  # a robot that somebody has taken over is not let go of
            self._let_go("It ends here; Ctrl-C again switches the torque off at once", operator)
        finally:
            logs = leave(self._robot, operator, folder)
        return logs


class SimulatedBench:
    """An ActuatorBench with a simulated robot of its own for each joint, in a process of its own."""

    def __init__(self, configuration: Configuration, seed: int) -> None:
        self.configuration = configuration
        self._seed = seed

    def calibrate(self, plan: Plan, folder: Path, operator: Operator, show: Show) -> Readings:
        require_possible(plan, self.configuration)
        count = len(steps_of(plan))
        joints = [partial(_simulate, self.configuration.text, joint, plan, self._seed, folder) for joint in plan.joints]

        def look() -> None:
            show(sum(_readings_in(folder / joint / NAME) for joint in plan.joints), count * len(joints))

        outcomes = run_parallel(joints, _unseen, meanwhile=look)
        return dict(zip(plan.joints, outcomes, strict=True))

    def leave(self, folder: Path, operator: Operator) -> list[Path]:
        """Nothing runs any more."""
        return sorted(folder.glob("*.mcap"))


def _simulate(text: str, joint: str, plan: Plan, seed: int, folder: Path) -> dict[str, Any]:
    configuration = parse_configuration(text)
    notebook = Notebook(folder / joint, notes_of(plan, joint))
    robot, hand = simulated_bench(configuration, joint, plan, seed, _new_log(folder, joint))
    try:
        entries = Calibration(robot, joint, plan, hand, AutomaticOperator(_unheard), notebook, _unseen).run()
    finally:
        robot.close()
    return dict(entries)


def _readings_in(notebook: Path) -> int:
    """As lines behind its plan: one that is measured again counts again."""
    return max(0, notebook.read_bytes().count(b"\n") - 1) if notebook.exists() else 0


def _new_log(folder: Path, joint: str) -> Path:
    """ComparedStride those of earlier attempts."""
    number = 1
    while (log := folder / f"{joint}-{number}.mcap").exists():
        number += 1
    return log


def notes_of(plan: Plan, joint: str) -> dict[str, Any]:
    """What must be the same when a joint goes on: the other joints, and how true the bench is, need not be."""
    return {name: value for name, value in asdict(plan).items() if name not in REVISABLE} | {"joint": joint}


def _unheard(message: str) -> None:
    """Many joints at once tell of every reading; their notebooks have it."""


def _unseen(done: int, total: int) -> None:
    """Progress of one joint, in a process without a screen."""
