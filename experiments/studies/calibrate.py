"""The calibration of a robot, joint by joint: what answers on the buses, then hands, tiny torques and weights.

Hands come first, without torque: only with the right signs, zeros and velocities may a motor pull. Every step is in the
notebook of the folder, which belongs to this configuration and these drives.
"""

from dataclasses import replace
from getpass import getuser
from pathlib import Path
from typing import Annotated, Any

from control.records import JOINTS
from experiments.actuator.configuration_change import find_target
from experiments.actuator.plan import WeighingPlan, require_possible
from experiments.actuator.simulation import bench_configuration
from experiments.calibration.calibration import calibrate_robot
from experiments.calibration.report import FILES as FILES
from experiments.calibration.robots import CalibratedRobot, build_with_errors
from experiments.studies.actuator import Lever, LeverTolerance, Passes, WeightTolerance, parse_weights
from experiments.study.option import Option
from experiments.study.result import Result
from experiments.study.session import Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration, parse_configuration
from firmware_host.configuration.service_file import service_configuration
from simulation.harness.local_setup import with_simulated_watchdogs

HAS_ROBOT = False  # no daemon's, at its socket
WEIGHTS_G, TRIALS = (100.0, 200.0, 400.0), 2  # within the default limits.torque_nm at 12 cm


def study(
    session: Session,
    *,
    config: Annotated[Path | None, Option("of the robot, to change (default: that of the daemon)")] = None,
    joint: Annotated[tuple[str, ...], Option("to calibrate (default: all)", choices=JOINTS)] = (),
    operator: Annotated[str | None, Option("of the record (default: this user)")] = None,
    lever: Lever = None,
    lever_tolerance: LeverTolerance = 1.0,
    weights: Annotated[
        Any, Option("in grams (default: 100,200,400)", metavar="G,G,...", parse=parse_weights)
    ] = WEIGHTS_G,
    weight_tolerance: WeightTolerance = 0.1,
    trials: Passes = TRIALS,
    practise: Annotated[bool, Option("on a simulated robot whose errors are to be found; its hands obey")] = False,
    seed: Annotated[int, Option("of the simulated robot")] = 1,
) -> Result:
    """Signs, zeros, ranges, velocity, torque and friction of every joint, with hands and weights."""
    session = session._replace(simulated=session.simulated or practise)
    file = config or service_configuration()
    configuration = _simulated(config) if session.simulated else load_configuration(file)
    target = find_target(file, configuration.text, session)
    joints = joint or configuration.rig.joints
    plan = WeighingPlan(
        joints=tuple(dict.fromkeys(joints)),
        weights_g=weights,
        trials=trials,
        lever_m=lever / 100.0 if lever else configuration.geometry.flipper_length_m,
        lever_tolerance_m=lever_tolerance / 1000.0,
        weight_tolerance=weight_tolerance / 100.0,
        trusts_constant=False,
    )
    require_possible(plan, configuration)
    built = build_with_errors(configuration, seed) if session.simulated else None
    robot = CalibratedRobot(session, built, seed, practise)
    result = calibrate_robot(robot, configuration, plan, operator or getuser(), target)
    return replace(result, title=f"{result.title} (practised)") if practise else result


def _simulated(config: Path | None) -> Configuration:
    if config is None:
        return bench_configuration()
    return parse_configuration(with_simulated_watchdogs(load_configuration(config).text))
