"""`mudskipper experiment faults`: its plan from the command line, and its table."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from command_line.experiments.conduct import conduct, refuse
from experiments.faults import matrix as faults
from experiments.faults.phases import PHASES
from experiments.reports.text_tables import number, table
from experiments.trials.session import Ending, Finding, screen_finding


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
    return conduct(options, "cells", lambda show: _finding(faults.run(plan, show)))


def _finding(report: dict[str, Any]) -> Finding:
    ending = Ending.DONE if report["ok"] == len(report["cells"]) else Ending.UNHEALTHY
    return screen_finding("faults", report, faults_text(report), partial(_plot, report), ending)


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
    return f"{ok} of {cells} cells ok"
