"""Runs the trackway experiment in a session, simulated or at the bench, and makes its finding."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from experiments.reports.report_page import Figure, Section
from experiments.robot.bench_robot import leave
from experiments.robot.daemon_robot import DaemonRobot
from experiments.trackway import bench, simulation
from experiments.trackway.report import TrackwayReport
from experiments.trackway.text import trackway_text
from experiments.trackway.walk_figures import walk_figures
from experiments.trials.notebook import Notebook
from experiments.trials.session import Finding, Session

WALKS_AND_TABLE = (
    "Left, as in the paper's figure 8: the first walk of each gait. Right: Table I, the paper's three trials as grey "
    "bars and ours as dots, each with one standard deviation."
)


def run_simulated(plan: simulation.Plan, session: Session) -> Finding:
    return _finding(simulation.run(plan, Notebook(session.folder, plan.identity), session.show))


def run_at_bench(plan: bench.Plan, session: Session) -> Finding:
    notebook = Notebook(session.folder, plan.identity)
    assert session.socket is not None
    robot = DaemonRobot(session.socket)
    try:
        report = bench.run(plan, bench.PromptedTrackway(robot, session.operator), notebook, session.show)
    finally:
        logs = leave(robot, session.operator, session.folder)
    figures = walk_figures(bench.first_walks(plan, notebook), session.folder, session.operator)
    return _finding(report, logs, figures)


def _finding(report: TrackwayReport, logs: Sequence[Path] = (), walks: Sequence[Figure] = ()) -> Finding:
    from experiments.trackway.plots import plot_trackway  # matplotlib takes its time

    text = trackway_text(report)
    table = Figure("trackway", WALKS_AND_TABLE, partial(plot_trackway, report))
    sections = [Section("Table I", screen=text, figures=[table])]
    if walks:
        sections.append(Section("Walks against time", "The first walk of each gait that counts.", figures=walks))
    return Finding(report, "The trackway: Table I of the paper", sections, text, logs)
