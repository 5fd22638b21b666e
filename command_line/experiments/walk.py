"""`mudskipper experiment walk`: the walking robot over several muds, on hardware or simulated."""

from __future__ import annotations

import argparse

from command_line.experiments.conduct import conduct_bench, refuse
from experiments.reports.mud_names import mud_name
from experiments.trackway.bench import Mud
from experiments.trials.mud_trials import why_not_simulated
from experiments.walk.measurement import MUDS, SOFT, Plan
from experiments.walk.text import run_walk as run_plan


def run_walk(options: argparse.Namespace) -> int:
    muds = tuple(Mud(mud_name(name), length_cm / 100.0) for name, length_cm in options.mud or ())
    if not (muds or options.simulated):
        return refuse("no mud is named: give the muds of the track in order, --mud 47.6=61 --mud 49.5=61 --mud 51.2=61")
    if len({mud.name for mud in muds}) < len(muds):
        return refuse("--mud: two muds have the same name; give each its own")
    soft = tuple(dict.fromkeys(mud_name(name) for name in options.soft or ()))
    plan = Plan(
        muds=muds or MUDS,
        trials=options.trials,
        depth_m=options.depth / 100.0,
        soft=soft or (SOFT if options.simulated else ()),
        flipper=options.flipper,
        simulated=options.simulated,
    )
    names = [*(mud.name for mud in plan.muds), *plan.soft]
    refused = why_not_simulated(names) if options.simulated else None
    if refused:
        return refuse(refused)
    return conduct_bench(options, "trials", lambda session: run_plan(plan, session, options.truth))
