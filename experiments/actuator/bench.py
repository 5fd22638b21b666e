"""The joints of one calibration, each with its own notebook: on a robot, or on a simulated robot for each joint."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from experiments.actuator.plan import WeighingPlan, require_possible, steps_of
from experiments.actuator.report import Readings
from experiments.actuator.simulation import BuiltRobot, simulated_bench
from experiments.actuator.weighing import TICK_S, JointWeighing, WeightHandler
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


@contextmanager
def attended(robot: BenchRobot, session: Session) -> Iterator[list[Path]]:
    """Yield the logs, which are there in the end. Torque is off then, however the weighing ended.

    A weight may hang after Ctrl-C: the operator is asked to take it off, unless Ctrl-C comes again.
    """
    logs: list[Path] = []
    try:
        yield logs
    finally:
        try:
            robot.wait(TICK_S)  # raises for a robot that another program operates now
            _switch_torque_off(
                robot, session.operator, "The calibration ends; Ctrl-C again switches the torque off at once"
            )
        finally:
            logs += leave(robot, session.operator, session.folder)


def _switch_torque_off(robot: BenchRobot, operator: Operator, why: str) -> None:
    """Ask the operator to take off the weight and hold the flipper first."""
    if robot.call("status")["mode"] == "hold":
        question = f"{why}. Take off the weight and hold the flipper: torque goes off."
        operator.ask(question, {GO_ON: "it is held"}, lambda: robot.wait(TICK_S))
        disarm(robot)


def weigh_on_robot(robot: BenchRobot, plan: WeighingPlan, session: Session) -> Readings:
    """Return the readings by joint and step. Raises BenchError, NotebookError."""
    require_possible(plan, robot.configuration)
    operator, steps = session.operator, len(steps_of(plan))
    _switch_torque_off(robot, operator, "The robot holds its pose")
    readings: dict[str, Mapping[str, Entry]] = {}
    for joint in plan.joints:
        same = notebook_plan(plan, joint, robot.configuration, session.program)
        notebook, before = Notebook(session.folder / joint, same), len(readings) * steps
        if notebook.entries:
            operator.report(f"{joint}: {len(notebook.entries)} of {steps} readings are done already.")
        if len(notebook.entries) < steps:
            operator.report(FALLS)

        def show(done: int, total: int, before: int = before) -> None:
            session.show(before + done, len(plan.joints) * total)

        readings[joint] = JointWeighing(robot, WeightHandler(operator, plan, joint), notebook, show).run()
        _switch_torque_off(robot, operator, f"{joint} is done")
    return readings


def weigh_simulated(
    configuration: Configuration,
    plan: WeighingPlan,
    session: Session,
    seed: int,
    built: BuiltRobot | None = None,
    practises: bool = False,
) -> tuple[Readings, list[Path]]:
    """Return the readings and the logs: a robot for each joint in a process of its own.

    `built` is the robot where it differs from the configuration. Where the operator `practises`, the robots follow one
    another.
    """
    require_possible(plan, configuration)
    folder, same = session.folder, {"simulated_seed": seed, **session.program}
    weigh = partial(_weigh_simulated, configuration, plan, folder, same, built or BuiltRobot(configuration))
    if practises:
        readings = {joint: weigh(joint, session.operator) for joint in plan.joints}
    else:
        total = len(steps_of(plan)) * len(plan.joints)
        watch = lambda: session.show(sum(count_entries(folder / joint) for joint in plan.joints), total)  # noqa: E731
        found = run_parallel(
            [partial(weigh, joint) for joint in plan.joints], _discard, partial(run_locally, meanwhile=watch)
        )
        readings = dict(zip(plan.joints, found, strict=True))
    return readings, sorted(folder.glob("*.mcap"))


def _weigh_simulated(
    configuration: Configuration,
    plan: WeighingPlan,
    folder: Path,
    same: Mapping[str, Any],
    built: BuiltRobot,
    joint: str,
    operator: Operator | None = None,
) -> dict[str, Entry]:
    notebook = Notebook(folder / joint, notebook_plan(plan, joint, configuration, same))
    logs = (folder / f"{joint}-{number}.mcap" for number in count(1))  # next to those of earlier attempts
    log = next(log for log in logs if not log.exists())
    operator = operator or AutomaticOperator(_discard)
    robot, weights = simulated_bench(configuration, joint, plan, same["simulated_seed"], log, built, operator)
    try:
        return JointWeighing(robot, weights, notebook, _discard).run()
    finally:
        robot.close()


def notebook_plan(
    plan: WeighingPlan, joint: str, configuration: Configuration, same: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what must be the same when a joint continues."""
    options = {name: value for name, value in asdict(plan).items() if name not in REVISABLE}
    return {"joint": joint, **options, **same, "configuration": parse_document(configuration.text)}


def _discard(*_: object) -> None:
    """Show no message and no progress of one process; every reading is in the notebook of its joint."""
