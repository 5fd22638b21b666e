"""Options of `mudskipper experiment NAME`."""

import argparse
from pathlib import Path

from command_line.options.shared import DEFAULT_CONFIG, Commands, add, add_json, add_socket, add_vertical
from command_line.options.studies import add_studies
from control.records import JOINTS
from experiments.study.values import (
    between,
    depth_cm,
    folder,
    group_rule,
    lever_m,
    mud_length,
    weights_g,
    whole,
)

SEEDS, TRIALS, WORKERS = whole(1, 1000), whole(1, 100), whole(1, 1000)
STRENGTH_PA = between(50.0, 50000.0, "Pa")
STAGE_SPEED_M_S = between(0.001, 1.0, "m/s")
GRAVITY_M_S2 = between(9.7, 9.9, "m/s²")  # anywhere on Earth

LABLOGS = (
    "Evaluate the estimates from real logs by each method, without a known truth. A group is the logs of one mud, and "
    "one log is one trial (in .mcap, each walk is). first CV: coefficient of variation (sample standard deviation "
    "over mean) over trials of the first stroke's value, one flipper on a fixed base. later CV: the same of each "
    "trial's geometric mean over its later strokes. chi: scatter over claimed error, between trials and between "
    "strokes; 1 is right. Separation: difference of two groups' first strokes in pooled standard deviations. Left "
    "against right: median of the difference over its claimed error in walks; 0.67 is right. Logs without mud must "
    "give no values and no bounds. Sensitivity: the same logs with currents 5 ms late or early, and with 30 percent "
    "of the rows missing."
)


def add_experiment(experiment: argparse.ArgumentParser) -> None:
    names = experiment.add_subparsers(dest="name", required=True, metavar="name")
    add_studies(names)
    _add_actuator(names)
    _add_flipper(names)
    _add_walk(names)
    _add_lablogs(names)


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


def _add_flipper(names: Commands) -> None:
    flipper = add(
        names,
        "flipper",
        "experiments.mud_trials.run_flipper",
        "A single flipper on a fixed base: coefficients of muds.",
    )
    _add_bench(flipper)
    option = flipper.add_argument
    option("--mud", action="append", metavar="NAME", help="as its water in percent, repeatable")
    option("--trials", type=TRIALS, default=3, metavar="N", help="of each mud (default: 3)")
    option("--depth", type=depth_cm, default=3.0, metavar="CM", help="(default: 3)")
    option("--strides", type=TRIALS, default=1, metavar="N", help="of each trial (default: 1)")
    option("--flipper", choices=("left", "right"), default="right", help="in the mud (default: right)")
    option("--motors", type=int, choices=(2, 4), default=4, help="of the simulated robot: 2 for that flipper alone")
    option("--truth", type=Path, metavar="FILE", help="summary.json of a loadcell experiment")


def _add_walk(names: Commands) -> None:
    walk = add(
        names, "walk", "experiments.mud_trials.run_walk", "The walking robot over several muds: their coefficients."
    )
    _add_bench(walk)
    option = walk.add_argument
    option(
        "--mud",
        type=mud_length,
        action="append",
        metavar="NAME[=CM]",
        help="as its water in percent, and its length (default: 61), in the order of the trackway",
    )
    option("--trials", type=TRIALS, default=3, metavar="N", help="over the muds (default: 3)")
    option("--depth", type=depth_cm, default=3.0, metavar="CM", help="(default: 3)")
    option("--soft", action="append", metavar="NAME", help="mud for additional walks at 3 and at 5 cm, repeatable")
    option("--flipper", choices=("left", "right"), default="right", help="to evaluate (default: right)")
    option("--truth", type=Path, metavar="FILE", help="summary.json of a loadcell experiment")


def _add_lablogs(names: Commands) -> None:
    lablogs = add(names, "lablogs", "experiments.lablogs.lablogs", "Real logs: do estimates repeat as they claim?")
    lablogs.description = LABLOGS
    lablogs.add_argument("folders", type=Path, nargs="+", metavar="DIR", help="with logs: .csv, .csv.gz or .mcap")
    lablogs.add_argument(
        "--group",
        type=group_rule,
        action="append",
        metavar="PATTERN=NAME",
        help="put logs with such a file name into one group, repeatable (default: the label in the name, as 12.5N)",
    )
    lablogs.add_argument(
        "--air", action="append", metavar="PATTERN", help="logs without mud, repeatable (default: detected)"
    )
    add_vertical(lablogs, default="y")
    add_json(lablogs)
    _add_out(lablogs, "for report, figures and numbers")
