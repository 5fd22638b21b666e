"""`mudskipper experiment flipper`: a single flipper on a fixed base, on hardware or simulated."""

from __future__ import annotations

import argparse

from command_line.bench import Desk, Finding, conduct_bench
from command_line.conduct import refuse
from command_line.screen import table
from experiments import flipper
from experiments.bench_robot import leave
from experiments.coefficient_table import load_truth, mud_name
from experiments.daemon_robot import DaemonRobot
from experiments.flipper_report import sections_of, text_of
from experiments.flipper_simulation import flipper_bench
from experiments.mud_trials import Bench, PlannedTrial, PromptedBed, require_some
from experiments.notebook import Notebook
from simulation.clay import clay_of_water

SEED = 1
PREPARE = (
    "Torque is off and the flippers have come down. Level the mud to its nominal height and give the flipper a fresh "
    "place, or re-mix the mud: the same hole loses 15 to 20 % a stroke. Take the hands away: the flipper moves next"
)


def run_flipper(options: argparse.Namespace) -> int:
    muds = tuple(dict.fromkeys(mud_name(mud) for mud in options.mud or ()))
    if not (muds or options.simulated):
        return refuse("name the muds that are there, one after the other: --mud 47.6 --mud 49.5")
    plan = flipper.Plan(
        muds or flipper.MUDS,
        options.trials,
        options.depth / 100.0,
        options.strides,
        options.flipper,
        options.simulated,
    )
    if options.simulated:
        try:
            [clay_of_water(float(mud)) for mud in plan.muds]
        except ValueError as problem:
            return refuse(f"--mud: simulated muds are named after their water in percent: {problem}")
    return conduct_bench(options, "trials", lambda desk: _find(options, plan, desk))


def _find(options: argparse.Namespace, plan: flipper.Plan, desk: Desk) -> Finding:
    truth = load_truth(options.truth) if options.truth else None
    notebook = Notebook(desk.folder, plan.kept)
    bench = _bench(options, plan, desk, notebook)
    try:
        configuration = bench.robot.configuration
        flipper.run(bench, plan, desk.show)
    finally:
        logs = leave(bench.robot, desk.person, desk.folder)
    require_some(notebook)
    report = flipper.report_of(plan, notebook.entries, configuration, truth)
    sections = sections_of(report, plan, notebook.entries, configuration)
    text = "\n\n".join(f"{title}\n{table(rows)}" for title, rows in text_of(report))
    return Finding(report, "A single flipper through muds", sections, text, logs)


def _bench(options: argparse.Namespace, plan: flipper.Plan, desk: Desk, notebook: Notebook) -> Bench:
    if options.simulated:
        return Bench(*flipper_bench(desk.folder, plan.muds, SEED), desk.person, notebook)
    robot = DaemonRobot(options.socket)
    return Bench(robot, PromptedBed(robot, desk.person, _words), desk.person, notebook)


def _words(trial: PlannedTrial) -> str:
    return PREPARE
