"""`mudskipper experiment walk`: the walking robot over several muds, on hardware or simulated."""

from __future__ import annotations

import argparse
from functools import partial

from command_line.experiments.conduct import conduct_bench, refuse
from experiments.reports.mud_names import mud_name
from experiments.reports.text_tables import text_of_tables
from experiments.trackway.bench import Mud
from experiments.trials.mud_trials import SEED, PlannedTrial, make_trials, open_bench, why_not_simulated
from experiments.trials.session import Finding, Session
from experiments.trials.truth_file import load_truth
from experiments.walk import measurement as walk_mapping
from experiments.walk.pages import sections_of, text_of
from experiments.walk.report import report_of
from experiments.walk.simulation import walking_bench

TRACKWAY = (
    "Torque is off. Re-mix the surface of all muds and level it to its nominal height, and put the robot so that the "
    "sweep axes are over the beginning of the first mud. Take the hands away: the robot walks next"
)
SOFT = (
    "Torque is off. Re-mix and level the soft mud, and put the robot where it has at least 80 cm of it ahead. Take the "
    "hands away: the robot walks next"
)


def run_walk(options: argparse.Namespace) -> int:
    muds = tuple(Mud(mud_name(name), length_cm / 100.0) for name, length_cm in options.mud or ())
    if not (muds or options.simulated):
        return refuse("name the muds of the trackway in their order: --mud 47.6=61 --mud 49.5=61 --mud 51.2=61")
    if len({mud.name for mud in muds}) < len(muds):
        return refuse("--mud: each mud needs a name of its own")
    soft = tuple(dict.fromkeys(mud_name(name) for name in options.soft or ()))
    plan = walk_mapping.Plan(
        muds or walk_mapping.MUDS,
        options.trials,
        options.depth / 100.0,
        soft or (walk_mapping.SOFT if options.simulated else ()),
        flipper=options.flipper,
        simulated=options.simulated,
    )
    names = [*(mud.name for mud in plan.muds), *plan.soft]
    refused = why_not_simulated(names) if options.simulated else None
    if refused:
        return refuse(refused)
    return conduct_bench(options, "trials", lambda session: _find(options, plan, session))


def _find(options: argparse.Namespace, plan: walk_mapping.Plan, session: Session) -> Finding:
    truth = load_truth(options.truth) if options.truth else None
    bench = open_bench(session, plan.kept, partial(walking_bench, session.folder, plan, SEED), _words)
    configuration, entries, logs = make_trials(bench, session, lambda: walk_mapping.run(bench, plan, session.show))
    report = report_of(plan, entries, configuration, truth) | {"left_out": bench.notebook.left_out}
    sections = sections_of(report, plan, entries, configuration, truth)
    return Finding(report, "The walking robot over several muds", sections, text_of_tables(text_of(report)), logs)


def _words(trial: PlannedTrial) -> str:
    return TRACKWAY if trial.key.startswith("walk/") else SOFT
