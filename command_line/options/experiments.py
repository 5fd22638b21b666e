"""Options of `mudskipper experiment NAME`."""

import argparse
from pathlib import Path

from command_line.options.shared import Commands, add, add_json, add_socket, add_vertical
from command_line.options.studies import add_studies
from experiments.study.values import (
    depth_cm,
    folder,
    group_rule,
    mud_length,
    whole,
)

TRIALS = whole(1, 100)

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


def _add_bench(experiment: argparse.ArgumentParser) -> None:
    """Add the options of an experiment at a robot with an operator, or in simulation without one."""
    _add_report(
        experiment,
        "robot and muds are simulated, without prompts",
        "for report, logs and measurements; continues there",
    )
    add_socket(experiment)


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
