"""`mudskipper experiment estimation`: its plan from the command line, and its tables."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from command_line.experiments.conduct import conduct, refuse
from experiments.estimation.evaluation import (
    LAYERS,
    SINGLE_WATERS,
    WALKING_WATERS,
    Plan,
    evaluate,
    report_of,
    with_layers,
)
from experiments.reports.error_table import PlateRow
from experiments.reports.mud_names import mud_text
from experiments.reports.text_tables import number, table
from experiments.trials.session import Finding, screen_finding
from simulation.mud.clay import Clay, clay_of_water


def estimation(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse("the truth comes from a virtual load cell: this experiment runs with --simulated only")
    try:
        plan = plan_of(options)
    except ValueError as problem:
        return refuse(str(problem))
    return conduct(options, "trials", lambda show: _finding(report_of(plan, evaluate(plan, show))))


def _finding(report: dict[str, Any]) -> Finding:
    return screen_finding("estimation", report, text_of(report), partial(_plot, report))


def _plot(report: dict[str, Any], path: Path) -> None:
    from experiments.estimation.plots import plot_errors  # matplotlib takes its time

    plot_errors(report, path)


def plan_of(options: argparse.Namespace) -> Plan:
    """Raises ValueError for a mud or a layer that there is not."""
    layers = LAYERS if options.layers is None else tuple(name for name in options.layers.split(",") if name)
    plan = with_layers(Plan(seeds=options.seeds), () if layers == ("none",) else layers)
    single = _muds(options, SINGLE_WATERS) if options.setup in ("single", "both") else ()
    walking = _muds(options, WALKING_WATERS) if options.setup in ("walking", "both") else ()
    return replace(plan, single=single, walking=walking)


def _muds(options: argparse.Namespace, waters: Sequence[float]) -> tuple[Clay, ...]:
    if options.strength:
        return tuple(Clay(f"{strength_pa:g} Pa", strength_pa) for strength_pa in options.strength)
    return tuple(clay_of_water(water) for water in options.mud or waters)


def text_of(report: dict[str, Any]) -> str:
    head = ["setup", "mud", "", "method", "median", "p95", "bias", "in 95 %", "strides", "bounds", "hold", "not valid"]
    rows = [
        [
            row.setup,
            mud_text(row.mud),
            row.coefficient,
            row.method,
            *(_percent(getattr(row, name)) for name in ("median", "p95", "bias", "coverage")),
            str(row.strides),
            str(row.bounds),
            _percent(row.bounds_hold),
            str(row.not_valid),
        ]
        for row in report["errors"]
    ]
    return "\n\n".join([table([head, *rows]), _plates_text(report["plates"]), _boundaries_text(report["boundaries"])])


def _plates_text(plates: Sequence[PlateRow]) -> str:
    head = ["setup", "mud", "", "upright / leaning plate", "estimate / upright", "share of the lean"]
    rows = [
        [
            row.setup,
            mud_text(row.mud),
            row.coefficient,
            number(row.upright_over_leaning),
            number(row.estimate_over_upright),
            _percent(row.lean_fraction),
        ]
        for row in plates
    ]
    return "The paper's upright plate (section II-E)\n" + table([head, *rows])


def _boundaries_text(boundaries: Sequence[dict[str, Any]]) -> str:
    if not boundaries:
        return "Boundaries: none walked over"
    head = ["from", "to", "crossings", "followed within two strides", "most strides"]
    rows = [
        [
            mud_text(row["from"]),
            mud_text(row["to"]),
            str(row["crossings"]),
            _percent(row["within_two"]),
            str(row["most_strides"]),
        ]
        for row in boundaries
    ]
    return "Mud boundaries\n" + table([head, *rows])


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"
