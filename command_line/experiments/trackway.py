"""`mudskipper experiment trackway`, `sweep` and `mud-fit`: their plans from the command line."""

import argparse
from dataclasses import replace

from command_line.experiments.conduct import conduct, conduct_bench, refuse
from command_line.experiments.workers import workers_of
from experiments.mud_fit import mud_fit
from experiments.mud_fit.mud_fit import fit_finding
from experiments.reports.mud_names import mud_name
from experiments.sweep import sweep
from experiments.sweep.text import sweep_finding
from experiments.trackway import bench, simulation
from experiments.trackway.report import ADAPTIVE, PAPER_TABLE
from experiments.trackway.text import run_at_bench, run_simulated

SIMULATED_ONLY = "the muds are those of the simulator: this experiment runs with --simulated only"


def run_trackway(options: argparse.Namespace) -> int:
    if not options.simulated:
        return _run_at_bench(options)
    if options.mud:
        return refuse("--mud is for a real trackway: the simulated one has the paper's muds")
    try:
        rules = simulation.rules_of(_unique(options.method) or ["default"])
    except ValueError as problem:
        return refuse(str(problem))
    plan = simulation.Plan(
        rules=rules,
        seeds=options.trials or simulation.Plan.seeds,
        compartment_m=options.compartment or simulation.Plan.compartment_m,
    )
    return conduct_bench(
        options, "walks", lambda session: run_simulated(plan, session, workers_of(options)), simulation.__name__
    )


def _run_at_bench(options: argparse.Namespace) -> int:
    if options.method:
        return refuse("--method is for --simulated: a real robot uses the method of its configuration")
    if options.workers or options.cluster:
        return refuse("--workers and --cluster are for --simulated: a real robot walks alone")
    if options.compartment:
        return refuse("--compartment is for --simulated: a real mud has its length with its name, --mud 48.5=61")
    lengths_cm = options.mud or [(name, 100.0 * simulation.Plan.compartment_m) for name in PAPER_TABLE[ADAPTIVE]]
    muds = tuple(bench.Mud(mud_name(name), length_cm / 100.0) for name, length_cm in lengths_cm)
    if len({mud.name for mud in muds}) < len(muds):
        return refuse("--mud: two muds have the same name; give each its own")
    plan = bench.Plan(muds, options.trials or bench.Plan.trials)
    return conduct_bench(options, "walks", lambda session: run_at_bench(plan, session), bench.__name__)


def run_sweep(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse(SIMULATED_ONLY)
    plan = sweep.Plan(seeds=options.seeds)
    if options.strength:
        plan = replace(plan, strengths_pa=tuple(sorted(set(options.strength))))
    if options.method:
        plan = replace(plan, methods=tuple(_unique(options.method)))
    try:
        plan.method_walks()
    except ValueError as problem:
        return refuse(str(problem))
    return conduct(
        options, "walks", lambda show: sweep_finding(sweep.run(plan, show, workers_of(options))), sweep.__name__
    )


def run_mud_fit(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse(SIMULATED_ONLY)
    plan = mud_fit.Plan(seeds=options.seeds)
    return conduct(options, "walks", lambda show: fit_finding(mud_fit.run(plan, show)), mud_fit.__name__)


def _unique(names: list[str] | None) -> list[str]:
    return list(dict.fromkeys(names or []))
