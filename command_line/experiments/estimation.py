"""`mudskipper experiment estimation`: its plan from the command line."""

import argparse
from collections.abc import Sequence
from dataclasses import replace

from command_line.experiments.conduct import conduct, refuse
from command_line.experiments.workers import workers_of
from experiments.estimation import evaluation
from experiments.estimation.evaluation import (
    LAYERS,
    SINGLE_WATERS,
    WALKING_WATERS,
    Plan,
    evaluate,
    report_of,
    with_layers,
)
from experiments.estimation.text import estimation_finding
from simulation.mud.clay import Clay, clay_of_water


def estimation(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse("the truth comes from a virtual load cell: this experiment runs with --simulated only")
    try:
        plan = plan_of(options)
    except ValueError as problem:
        return refuse(str(problem))
    return conduct(
        options,
        "trials",
        lambda show: estimation_finding(report_of(plan, evaluate(plan, show, workers_of(options)))),
        evaluation.__name__,
    )


def plan_of(options: argparse.Namespace) -> Plan:
    """Raises ValueError for an unknown mud or layer."""
    layers = LAYERS if options.layers is None else tuple(name for name in options.layers.split(",") if name)
    plan = with_layers(Plan(seeds=options.seeds), () if layers == ("none",) else layers)
    single = _muds(options, "single", SINGLE_WATERS)
    walking, measuring = (_muds(options, setup, WALKING_WATERS) for setup in ("walking", "measuring"))
    return replace(plan, single=single, walking=walking, measuring=measuring)


def _muds(options: argparse.Namespace, setup: str, waters: Sequence[float]) -> tuple[Clay, ...]:
    """Returns the muds of one setup: none where another was asked for."""
    if options.setup not in (setup, "all"):
        return ()
    if options.strength:
        return tuple(Clay(f"{strength_pa:g} Pa", strength_pa) for strength_pa in options.strength)
    return tuple(clay_of_water(water) for water in options.mud or waters)
