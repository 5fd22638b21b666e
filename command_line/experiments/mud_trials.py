"""`mudskipper experiment flipper` and `walk`: trials in mud, on hardware or simulated."""

import argparse

from command_line.experiments.conduct import conduct_bench, refuse
from experiments.flipper import measurement as flipper
from experiments.flipper.text import run_flipper as run_flipper_plan
from experiments.reports.mud_names import mud_name
from experiments.trackway.bench import Mud
from experiments.trials.mud_trials import why_not_simulated
from experiments.walk import measurement as walk
from experiments.walk.text import run_walk as run_walk_plan

FLIPPER = ("experiments.flipper.report", "experiments.flipper.simulation")  # what computes the coefficients
WALK = ("experiments.walk.report", "experiments.walk.simulation")


def run_flipper(options: argparse.Namespace) -> int:
    muds = tuple(dict.fromkeys(mud_name(mud) for mud in options.mud or ()))
    if not (muds or options.simulated):
        return refuse("no mud is named: give the muds in the order of the trials, --mud 47.6 --mud 49.5")
    plan = flipper.Plan(
        muds=muds or flipper.MUDS,
        trials=options.trials,
        depth_m=options.depth / 100.0,
        strides=options.strides,
        flipper=options.flipper,
        simulated=options.simulated,
        motors=options.motors,
    )
    refused = why_not_simulated(plan.muds) if options.simulated else None
    if refused:
        return refuse(refused)
    return conduct_bench(options, "trials", lambda session: run_flipper_plan(plan, session, options.truth), *FLIPPER)


def run_walk(options: argparse.Namespace) -> int:
    muds = tuple(Mud(mud_name(name), length_cm / 100.0) for name, length_cm in options.mud or ())
    if not (muds or options.simulated):
        return refuse("no mud is named: give the muds of the track in order, --mud 47.6=61 --mud 49.5=61 --mud 51.2=61")
    if len({mud.name for mud in muds}) < len(muds):
        return refuse("--mud: two muds have the same name; give each its own")
    soft = tuple(dict.fromkeys(mud_name(name) for name in options.soft or ()))
    plan = walk.Plan(
        muds=muds or walk.MUDS,
        trials=options.trials,
        depth_m=options.depth / 100.0,
        soft=soft or (walk.SOFT if options.simulated else ()),
        flipper=options.flipper,
        simulated=options.simulated,
    )
    names = [*(mud.name for mud in plan.muds), *plan.soft]
    refused = why_not_simulated(names) if options.simulated else None
    if refused:
        return refuse(refused)
    return conduct_bench(options, "trials", lambda session: run_walk_plan(plan, session, options.truth), *WALK)
