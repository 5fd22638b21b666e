"""The calibration of actuators by hanging weights: read the weights, fit each joint, apply the constants.

The bench is a robot, joint after joint, or a simulated robot for each joint. Each joint has a notebook and a folder of
its own, so that a finished joint stays as it is when another one continues.
"""

from argparse import ArgumentTypeError
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from control.parameters.arm_mass import GRAVITY_M_S2
from control.records import JOINTS
from experiments.actuator.bench import attended, weigh_on_robot, weigh_simulated
from experiments.actuator.configuration_change import apply_changes, find_target, fitted_changes
from experiments.actuator.fit import fit_joints
from experiments.actuator.plan import PAPER_TRIALS, PAPER_WEIGHTS_G, WeighingPlan
from experiments.actuator.report import make_result
from experiments.actuator.simulation import bench_configuration
from experiments.robot.daemon_robot import DaemonRobot
from experiments.study.option import Option
from experiments.study.result import Result
from experiments.study.session import Ending, Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.service_file import service_configuration


def parse_weights(text: str) -> tuple[float, ...]:
    """Raises ArgumentTypeError."""
    try:
        weights_g = tuple(sorted({float(part) for part in text.split(",") if part.strip()}))
    except ValueError:
        weights_g = ()
    if len(weights_g) < 2 or not all(1.0 <= weight_g <= 5000.0 for weight_g in weights_g):
        raise ArgumentTypeError(f"{text}: must be two weights or more, from 1 to 5000 g, such as 100,200,400")
    return weights_g


Lever = Annotated[
    float | None, Option("axle to weight (default: the flipper's length)", low=1.0, high=100.0, unit="cm")
]
Weights = Annotated[Any, Option("in grams (default: the paper's)", metavar="G,G,...", parse=parse_weights)]
LeverTolerance = Annotated[float, Option("of the lever", low=0.0, high=50.0, unit="mm")]
WeightTolerance = Annotated[float, Option("of the weights", low=0.0, high=10.0, unit="%", metavar="PERCENT")]
Passes = Annotated[int, Option("passes through them", low=1, high=100)]


def study(
    session: Session,
    *,
    joint: Annotated[tuple[str, ...], Option("to calibrate", choices=JOINTS)] = ("right_adduction", "right_sweep"),
    lever: Lever = None,
    lever_tolerance: LeverTolerance = 1.0,
    weights: Weights = PAPER_WEIGHTS_G,
    weight_tolerance: WeightTolerance = 0.1,
    trials: Passes = PAPER_TRIALS,
    gravity: Annotated[float, Option("local gravity", low=9.7, high=9.9, unit="m/s²", metavar="M/S2")] = GRAVITY_M_S2,
    apply: Annotated[bool, Option("write the fitted constants to the configuration, after a prompt")] = False,
    config: Annotated[Path | None, Option("to change (default: that of the daemon)")] = None,
    seed: Annotated[int, Option("of the simulated motor")] = 1,
) -> Result:
    """Weights on a joint: torque constants and friction."""

    def prepare(configuration: Configuration) -> tuple[Path | None, WeighingPlan]:
        """Return the file to change, and the plan for this robot."""
        file = config or service_configuration()
        return find_target(file, configuration.text, session) if apply else None, WeighingPlan(
            joints=tuple(dict.fromkeys(joint)),
            weights_g=weights,
            trials=trials,
            lever_m=lever / 100.0 if lever else configuration.geometry.flipper_length_m,
            gravity_m_s2=gravity,
            lever_tolerance_m=lever_tolerance / 1000.0,
            weight_tolerance=weight_tolerance / 100.0,
        )

    if session.simulated:
        configuration = load_configuration(config) if config else bench_configuration()
        target, plan = prepare(configuration)
        readings, logs = weigh_simulated(configuration, plan, session, seed)
    else:
        assert session.socket is not None
        robot = DaemonRobot(session.socket)
        with attended(robot, session) as logs:
            configuration = robot.configuration
            target, plan = prepare(configuration)
            readings = weigh_on_robot(robot, plan, session)
    fits = fit_joints(plan, readings, configuration)
    applied, ending = None, Ending.DONE
    if target:
        applied, ending = apply_changes(target, fitted_changes(fits, session), session)
    return replace(make_result(plan, readings, fits, applied, session.simulated), logs=logs, ending=ending)
