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
from experiments.actuator.bench import RobotBench, SimulatedBench
from experiments.actuator.configuration_change import apply_fits, find_target
from experiments.actuator.fit import fit_joint
from experiments.actuator.plan import PAPER_TRIALS, PAPER_WEIGHTS_G, Plan
from experiments.actuator.report import list_left_out, list_remarks, make_result
from experiments.actuator.simulation import bench_configuration
from experiments.robot.daemon_robot import DaemonRobot
from experiments.study.option import Option
from experiments.study.result import Result
from experiments.study.session import Ending, Session
from firmware_host.configuration.loading import load_configuration

INSTALLED = Path("/etc/mudskipper/mudskipper.toml")


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


def study(
    session: Session,
    *,
    joint: Annotated[tuple[str, ...], Option("to calibrate", choices=JOINTS)] = ("right_adduction", "right_sweep"),
    lever: Lever = None,
    lever_tolerance: Annotated[float, Option("of the lever", low=0.0, high=50.0, unit="mm")] = 1.0,
    weights: Weights = PAPER_WEIGHTS_G,
    weight_tolerance: Annotated[float, Option("of the weights", low=0.0, high=10.0, unit="%", metavar="PERCENT")] = 0.1,
    trials: Annotated[int, Option("passes through them", low=1, high=100)] = PAPER_TRIALS,
    gravity: Annotated[float, Option("local gravity", low=9.7, high=9.9, unit="m/s²", metavar="M/S2")] = GRAVITY_M_S2,
    apply: Annotated[bool, Option("write the fitted constants to the configuration, after a prompt")] = False,
    config: Annotated[Path | None, Option(f"to change (default: {INSTALLED})")] = None,
    seed: Annotated[int, Option("of the simulated motor")] = 1,
) -> Result:
    """Weights on a joint: torque constants and friction."""
    if session.simulated:
        configuration = load_configuration(config) if config else bench_configuration()
        bench: RobotBench | SimulatedBench = SimulatedBench(configuration, seed, session)
    else:
        assert session.socket is not None
        bench = RobotBench(DaemonRobot(session.socket), session)
    try:
        configuration = bench.configuration
        target = find_target(config or INSTALLED, configuration.text, session) if apply else None
        plan = Plan(
            joints=tuple(dict.fromkeys(joint)),
            weights_g=weights,
            trials=trials,
            lever_m=lever / 100.0 if lever else configuration.geometry.flipper_length_m,
            gravity_m_s2=gravity,
            lever_tolerance_m=lever_tolerance / 1000.0,
            weight_tolerance=weight_tolerance / 100.0,
        )
        readings = bench.calibrate(plan)
    finally:
        logs = bench.leave()
    fits = [
        fit
        for name in plan.joints
        if (fit := fit_joint(name, plan, readings[name], configuration.drive[name].torque_constant_nm_a)) is not None
    ]
    applied, ending = apply_fits(target, fits, session) if target else ("", Ending.DONE)
    notes = [*list_remarks(plan.joints, fits, len(list_left_out(plan, readings))), *filter(None, [applied])]
    result = make_result(plan, readings, fits, applied or None, session.simulated)
    return replace(result, notes=notes, logs=logs, ending=ending)
