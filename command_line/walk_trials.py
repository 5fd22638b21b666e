"""`mudskipper experiment walk`: the walking robot over several muds, on hardware or simulated."""

from __future__ import annotations

import argparse

from command_line.bench import Desk, Finding, conduct_bench
from command_line.conduct import refuse
from command_line.screen import table
from experiments import walk_mapping
from experiments.bench_robot import leave
from experiments.coefficient_table import load_truth, mud_name
from experiments.daemon_robot import DaemonRobot
from experiments.mud_trials import Bench, PlannedTrial, PromptedBed, require_some
from experiments.notebook import Notebook
from experiments.trackway_trials import Mud
from experiments.walk_mapping_pages import sections_of, text_of
from experiments.walk_mapping_report import report_of
from experiments.walk_simulation import walking_bench
from simulation.clay import clay_of_water

SEED = 1
TRACKWAY = (
    "Torque is off. Re-mix the surface of all muds and level it to its nominal height, and put the robot so that the "
    "sweep axes are over the beginning of the first mud. Take the hands away: the robot walks next"
)
SOFT = (
    "Torque is off. Re-mix and level the soft mud, and put the robot where it has at least 80 cm of it ahead. Take the "
    "hands away: the robot walks next"
)


def run_walk(options: argparse.Namespace) -> int:
    muds = tuple(Mud(mud_name(name), length_cm / 100.0) for name, length_cm in options.mud or ())
    if not (muds or options.simulated):
        return refuse("name the muds of the trackway in their order: --mud 47.6=61 --mud 49.5=61 --mud 51.2=61")
    if len({mud.name for mud in muds}) < len(muds):
        return refuse("--mud: each mud needs a name of its own")
    soft = tuple(dict.fromkeys(mud_name(name) for name in options.soft or ()))
    plan = walk_mapping.Plan(
        muds or walk_mapping.MUDS,
        options.trials,
        options.depth / 100.0,
        soft or (walk_mapping.SOFT if options.simulated else ()),
        flipper=options.flipper,
        simulated=options.simulated,
    )
    if options.simulated:
        try:
            [clay_of_water(float(name)) for name in (*(mud.name for mud in plan.muds), *plan.soft)]
        except ValueError as problem:
            return refuse(f"--mud: simulated muds are named after their water in percent: {problem}")
    return conduct_bench(options, "trials", lambda desk: _find(options, plan, desk))


def _find(options: argparse.Namespace, plan: walk_mapping.Plan, desk: Desk) -> Finding:
    truth = load_truth(options.truth) if options.truth else None
    notebook = Notebook(desk.folder, plan.kept)
    bench = _bench(options, plan, desk, notebook)
    try:
        configuration = bench.robot.configuration
        walk_mapping.run(bench, plan, desk.show)
    finally:
        logs = leave(bench.robot, desk.person, desk.folder)
    require_some(notebook)
    report = report_of(plan, notebook.entries, configuration, truth)
    sections = sections_of(report, plan, notebook.entries, configuration, truth)
    text = "\n\n".join(f"{title}\n{table(rows)}" for title, rows in text_of(report))
    return Finding(report, "The walking robot over several muds", sections, text, logs)


def _bench(options: argparse.Namespace, plan: walk_mapping.Plan, desk: Desk, notebook: Notebook) -> Bench:
    if options.simulated:
        return Bench(*walking_bench(desk.folder, plan, SEED), desk.person, notebook)
    robot = DaemonRobot(options.socket)
    return Bench(robot, PromptedBed(robot, desk.person, _words), desk.person, notebook)


def _words(trial: PlannedTrial) -> str:
    return TRACKWAY if trial.key.startswith("walk/") else SOFT
