"""`mudskipper experiment flipper`: a single flipper on a fixed base, on hardware or simulated."""

from __future__ import annotations

import argparse
from functools import partial

from command_line.experiments.conduct import conduct_bench, refuse
from experiments.flipper import measurement as flipper
from experiments.flipper.report import sections_of, text_of
from experiments.flipper.simulation import flipper_bench
from experiments.reports.mud_names import mud_name
from experiments.reports.text_tables import text_of_tables
from experiments.trials.mud_trials import SEED, make_trials, open_bench, why_not_simulated
from experiments.trials.session import Finding, Session
from experiments.trials.truth_file import load_truth

PREPARE = (
    "Torque is off and the flippers have come down. Level the mud to its nominal height and give the flipper a fresh "
    "place, or re-mix the mud: the same hole loses 15 to 20 % a stroke. Take the hands away: the flipper moves next"
)


def run_flipper(options: argparse.Namespace) -> int:
    muds = tuple(dict.fromkeys(mud_name(mud) for mud in options.mud or ()))
    if not (muds or options.simulated):
        return refuse("name the muds that are there, one after the other: --mud 47.6 --mud 49.5")
    plan = flipper.Plan(
        muds or flipper.MUDS,
        options.trials,
        options.depth / 100.0,
        options.strides,
        options.flipper,
        options.simulated,
    )
    refused = why_not_simulated(plan.muds) if options.simulated else None
    if refused:
        return refuse(refused)
    return conduct_bench(options, "trials", lambda session: _find(options, plan, session))


def _find(options: argparse.Namespace, plan: flipper.Plan, session: Session) -> Finding:
    truth = load_truth(options.truth) if options.truth else None
    simulated = partial(flipper_bench, session.folder, plan.muds, SEED)
    bench = open_bench(session, plan.kept, simulated, lambda trial: PREPARE)
    configuration, entries, logs = make_trials(bench, session, lambda: flipper.run(bench, plan, session.show))
    report = flipper.report_of(plan, entries, configuration, truth) | {"left_out": bench.notebook.left_out}
    sections = sections_of(report, plan, entries, configuration)
    return Finding(report, "A single flipper through muds", sections, text_of_tables(text_of(report)), logs)
