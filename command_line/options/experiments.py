"""Options of `mudskipper experiment NAME`."""

import argparse
from pathlib import Path

from command_line.options.shared import DEFAULT_CONFIG, Commands, add, add_json, add_socket
from command_line.options.studies import add_studies
from control.records import JOINTS
from experiments.study.values import (
    between,
    folder,
    lever_m,
    weights_g,
    whole,
)

SEEDS, TRIALS, WORKERS = whole(1, 1000), whole(1, 100), whole(1, 1000)
STRENGTH_PA = between(50.0, 50000.0, "Pa")
STAGE_SPEED_M_S = between(0.001, 1.0, "m/s")
GRAVITY_M_S2 = between(9.7, 9.9, "m/s²")  # anywhere on Earth


def add_experiment(experiment: argparse.ArgumentParser) -> None:
    names = experiment.add_subparsers(dest="name", required=True, metavar="name")
    add_studies(names)
    _add_actuator(names)


def _add_report(experiment: argparse.ArgumentParser, simulated: str, out: str) -> None:
    option = experiment.add_argument
    option("--simulated", action="store_true", help=simulated)
    add_json(experiment)
    _add_out(experiment, out)


def _add_out(experiment: argparse.ArgumentParser, text: str) -> None:
    experiment.add_argument("--out", type=folder, metavar="DIR", help=text)
    experiment.add_argument(
        "--restart", action="store_true", help="begin again in that folder; its earlier results are kept as DIR-old"
    )


def _add_workers(experiment: argparse.ArgumentParser) -> None:
    workers = experiment.add_mutually_exclusive_group()
    workers.add_argument(
        "--workers", type=WORKERS, metavar="N", help="processes here (default: one for each processor)"
    )
    workers.add_argument(
        "--cluster", metavar="ADDRESS", help="of a Dask scheduler, whose workers run the trials instead"
    )


def _add_bench(experiment: argparse.ArgumentParser) -> None:
    """Add the options of an experiment at a robot with an operator, or in simulation without one."""
    _add_report(
        experiment,
        "robot and muds are simulated, without prompts",
        "for report, logs and measurements; continues there",
    )
    add_socket(experiment)


def _add_actuator(names: Commands) -> None:
    actuator = add(
        names, "actuator", "experiments.actuator.run_actuator", "Weights on a joint: torque constants and friction."
    )
    _add_report(
        actuator,
        "a simulated motor holds the weights, without prompts",
        "for report, pictures and log; continues there",
    )
    add_socket(actuator)
    option = actuator.add_argument
    option("--joint", action="append", choices=JOINTS, help="repeatable (default: right_adduction, right_sweep)")
    option("--lever", type=lever_m, metavar="CM", dest="lever_m", help="axle to weight (default: the flipper's length)")
    option(
        "--lever-tolerance",
        type=between(0.0, 50.0, "mm"),
        default=1.0,
        metavar="MM",
        dest="lever_tolerance_mm",
        help="of the lever (default: %(default)g)",
    )
    option("--weights", type=weights_g, metavar="G,G,...", help="in grams (default: the paper's)")
    option(
        "--weight-tolerance",
        type=between(0.0, 10.0, "%"),
        default=0.1,
        metavar="PERCENT",
        dest="weight_tolerance_percent",
        help="of the weights (default: %(default)g)",
    )
    option("--trials", type=TRIALS, default=5, metavar="N", help="passes through them (default: 5)")
    option("--gravity", type=GRAVITY_M_S2, metavar="M/S2", help="local gravity (default: 9.81)")
    option("--apply", action="store_true", help="write the fitted constants to the configuration, after a prompt")
    option("--config", type=Path, metavar="FILE", help=f"to change (default: {DEFAULT_CONFIG})")
    option("--seed", type=int, default=1, metavar="N", help="of the simulated motor")
