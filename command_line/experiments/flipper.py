"""`mudskipper experiment flipper`: a single flipper on a fixed base, on hardware or simulated."""

from __future__ import annotations

import argparse

from command_line.experiments.conduct import conduct_bench, refuse
from experiments.flipper.measurement import MUDS, Plan
from experiments.flipper.text import run_flipper as run_plan
from experiments.reports.mud_names import mud_name
from experiments.trials.mud_trials import why_not_simulated


def run_flipper(options: argparse.Namespace) -> int:
    muds = tuple(dict.fromkeys(mud_name(mud) for mud in options.mud or ()))
    if not (muds or options.simulated):
        return refuse("no mud is named: give the muds in the order of the trials, --mud 47.6 --mud 49.5")
    plan = Plan(
        muds=muds or MUDS,
        trials=options.trials,
        depth_m=options.depth / 100.0,
        strides=options.strides,
        flipper=options.flipper,
        simulated=options.simulated,
    )
    refused = why_not_simulated(plan.muds) if options.simulated else None
    if refused:
        return refuse(refused)
    return conduct_bench(options, "trials", lambda session: run_plan(plan, session, options.truth))
