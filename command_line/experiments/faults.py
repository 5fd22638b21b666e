"""`mudskipper experiment faults`: its plan from the command line, and its table."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from command_line import exit_codes
from command_line.experiments.conduct import conduct, refuse
from command_line.screen import GREEN, RED, coloured, number, table
from experiments.faults import matrix as faults
from experiments.faults.phases import PHASES
from experiments.reports.side_by_side import Show


def run_faults(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse("what fails here is a simulated robot: this experiment runs with --simulated only")
    try:
        plan = faults.Plan(
            tuple(dict.fromkeys(options.fault or faults.FAULTS)),
            tuple(dict.fromkeys(options.phase or PHASES)),
            options.seeds,
        )
    except ValueError as problem:
        return refuse(str(problem))
    if not plan.places:
        return refuse("none of these faults can come about in these phases")
    seen: list[dict[str, Any]] = []

    def run(show: Show) -> dict[str, Any]:
        seen.append(faults.run(plan, show))
        return seen[0]

    conduct(options, "cells", run, faults_text, _plot)
    return exit_codes.OK if seen[0]["ok"] == len(seen[0]["cells"]) else exit_codes.UNHEALTHY


def _plot(report: dict[str, Any], path: Path) -> None:
    from experiments.faults.plots import plot_faults  # matplotlib takes its time

    plot_faults(report, path)


def faults_text(report: dict[str, Any]) -> str:
    head = ["fault", "reaction", "ok", "slowest (ticks)", "bound (ticks)", "peak torque (N·m)", "travel (rad)"]
    rows = [
        [
            row["way"],
            row["reaction"].replace("_", " "),
            f"{row['ok']}/{row['cells']}",
            _ticks(row["slowest_ticks"]),
            _ticks(row["bound_ticks"]),
            number(row["peak_torque_nm"], 2),
            number(row["travel_rad"], 2),
        ]
        for row in report["faults"]
    ]
    return "\n".join([table([head, *rows]), "", *_failed(report), _verdict(report)])


def _ticks(ticks: int | None) -> str:
    return "-" if ticks is None else str(ticks)


def _failed(report: dict[str, Any]) -> list[str]:
    return [
        f"{cell['way']} in {cell['phase']}, seed {cell['seed']}: {'; '.join(cell['why'])}"
        for cell in report["cells"]
        if not cell["ok"]
    ]


def _verdict(report: dict[str, Any]) -> str:
    ok, cells = report["ok"], len(report["cells"])
    return coloured(f"{ok} of {cells} cells ok", GREEN if ok == cells else RED)
