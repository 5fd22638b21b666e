"""The bench of trials in mud, for the commands that make some: a robot over its bed, on hardware or simulated."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from command_line.experiments.conduct_bench import Desk
from command_line.screen import table
from experiments.robot.bench_robot import BenchRobot, leave
from experiments.robot.daemon_robot import DaemonRobot
from experiments.trials.mud_trials import Bench, MudBed, PlannedTrial, PromptedBed, measured_of
from experiments.trials.notebook import Entry, Notebook
from firmware_host.configuration.configuration import Configuration
from simulation.mud.clay import clay_of_water

SEED = 1  # of what is simulated


def why_not_simulated(muds: Iterable[str]) -> str | None:
    """A sentence where one of these cannot be simulated."""
    try:
        [clay_of_water(float(mud)) for mud in muds]
    except ValueError as problem:
        return f"--mud: simulated muds are named after their water in percent: {problem}"
    return None


def open_bench(
    options: argparse.Namespace,
    desk: Desk,
    kept: dict[str, Any],
    simulated: Callable[[], tuple[BenchRobot, MudBed]],
    words: Callable[[PlannedTrial], str],
) -> Bench:
    """`kept`: what may not change where an experiment goes on; `words`: what a person is asked to prepare."""
    notebook = Notebook(desk.folder, kept)
    if options.simulated:
        return Bench(*simulated(), desk.operator, notebook)
    robot = DaemonRobot(options.socket)
    return Bench(robot, PromptedBed(robot, desk.operator, words), desk.operator, notebook)


def make_trials(
    bench: Bench, desk: Desk, run: Callable[[], None]
) -> tuple[Configuration, dict[str, Entry], list[Path]]:
    """The configuration they were made with, those that count, and the logs. Whatever ends them, the robot is left at
    rest. Raises BenchError where none counts.
    """
    try:
        configuration = bench.robot.configuration
        run()
    finally:
        logs = leave(bench.robot, desk.operator, desk.folder)
    return configuration, measured_of(bench.notebook), logs


def text_of_tables(tables: Iterable[tuple[str, Sequence[Sequence[str]]]]) -> str:
    """Each under its title."""
    return "\n\n".join(f"{title}\n{table(rows)}" for title, rows in tables)
