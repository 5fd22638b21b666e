"""`mudskipper experiment trackway`, `sweep` and `mud-fit`: their plans from the command line, and their tables."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

from command_line.experiments.conduct import conduct, conduct_bench, refuse
from experiments.reports.mud_names import mud_label, mud_name
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import number, table
from experiments.robot.bench_robot import leave
from experiments.robot.daemon_robot import DaemonRobot
from experiments.trackway import comparison as trackway
from experiments.trackway import depth_sweep, mud_fit
from experiments.trackway import trials as trackway_trials
from experiments.trackway.mud_fit import cells_beside_paper
from experiments.trackway.paper_table import ADAPTIVE, PAPER_TABLE
from experiments.trackway.trials import AskedTrackway, first_walks
from experiments.trackway.walk_figures import walk_figures
from experiments.trials.notebook import Notebook
from experiments.trials.session import Finding, Session, screen_finding
from firmware_host.operator.counted_nouns import counted

WALKS_AND_TABLE = (
    "Left, as in the paper's figure 8: the first walk of each gait. Right: Table I, the paper's three trials as grey "
    "bars and ours as dots, each with one standard deviation."
)
SIMULATED_ONLY = "the muds are those of the simulator: this experiment runs with --simulated only"


def run_trackway(options: argparse.Namespace) -> int:
    if not options.simulated:
        return _walk_at_the_bench(options)
    if options.mud:
        return refuse("--mud is for a real trackway: the simulated one has the paper's muds")
    try:
        rules = trackway.rules_of(_unique(options.method) or ["default"])
    except ValueError as problem:
        return refuse(str(problem))
    plan = trackway.Plan(
        rules=rules,
        seeds=options.trials or trackway.Plan.seeds,
        compartment_m=options.compartment or trackway.Plan.compartment_m,
    )
    return conduct_bench(
        options, "walks", lambda session: _found(trackway.run(plan, Notebook(session.folder, plan.kept), session.show))
    )


def _walk_at_the_bench(options: argparse.Namespace) -> int:
    """On the robot of a daemon, over muds that a person has prepared."""
    if options.method:
        return refuse("--method is for --simulated: a robot chooses its depths as its configuration says")
    if options.compartment:
        return refuse("--compartment is for --simulated: the length of a real mud stands with it, as in --mud 48.5=61")
    lengths_cm = options.mud or [(name, 100.0 * trackway.Plan.compartment_m) for name in PAPER_TABLE[ADAPTIVE]]
    muds = tuple(trackway_trials.Mud(mud_name(name), length_cm / 100.0) for name, length_cm in lengths_cm)
    if len({mud.name for mud in muds}) < len(muds):
        return refuse("--mud: each needs a name of its own")
    plan = trackway_trials.Plan(muds, options.trials or trackway_trials.Plan.trials)
    return conduct_bench(options, "walks", lambda session: _walked(plan, session))


def _walked(plan: trackway_trials.Plan, session: Session) -> Finding:
    notebook = Notebook(session.folder, plan.kept)
    assert session.socket is not None
    robot = DaemonRobot(session.socket)
    try:
        report = trackway_trials.run(plan, AskedTrackway(robot, session.operator), notebook, session.show)
    finally:
        logs = leave(robot, session.operator, session.folder)
    return _found(report, logs, walk_figures(first_walks(plan, notebook), session.folder, session.operator))


def _found(report: dict[str, Any], logs: Sequence[Path] = (), walks: Sequence[Figure] = ()) -> Finding:
    text = trackway_text(report)
    figure = Figure("trackway", WALKS_AND_TABLE, partial(_plot_trackway, report))
    sections = [Section("Table I", screen=text, figures=[figure])]
    sections += [Section("Along the way", "Of each gait the first walk that counts.", figures=walks)] * bool(walks)
    return Finding(report, "The trackway: Table I of the paper", sections, text, logs)


def run_sweep(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse(SIMULATED_ONLY)
    plan = depth_sweep.Plan(seeds=options.seeds)
    if options.strength:
        plan = replace(plan, strengths_pa=tuple(sorted(set(options.strength))))
    if options.method:
        plan = replace(plan, methods=tuple(_unique(options.method)))
    try:
        plan.method_walks()
    except ValueError as problem:
        return refuse(str(problem))
    return conduct(options, "walks", lambda show: _sweep_finding(depth_sweep.run(plan, show)))


def _sweep_finding(report: dict[str, Any]) -> Finding:
    return screen_finding(report["experiment"], report, sweep_text(report), partial(_plot_sweep, report))


def run_mud_fit(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse(SIMULATED_ONLY)
    plan = mud_fit.Plan(seeds=options.seeds)
    return conduct(options, "walks", lambda show: _fit_finding(mud_fit.run(plan, show)))


def _fit_finding(report: dict[str, Any]) -> Finding:
    return screen_finding(report["experiment"], report, fit_text(report))


def _unique(names: list[str] | None) -> list[str]:
    return list(dict.fromkeys(names or []))


def _plot_trackway(report: dict[str, Any], path: Path) -> None:
    from experiments.trackway.plots import plot_trackway  # matplotlib takes its time

    plot_trackway(report, path)


def _plot_sweep(report: dict[str, Any], path: Path) -> None:
    from experiments.trackway.plots import plot_sweep  # matplotlib takes its time

    plot_sweep(report, path)


# the trackway


def trackway_text(report: dict[str, Any]) -> str:
    parts = [_speeds_text(report), _failures_text(report)]
    if "best_constant_depth" in report:
        parts.append(_best_text(report))
    short = sum(cell["short_trials"] for row in report["table"].values() for cell in row.values())
    if report.get("left_out"):
        parts.append(f"Trials left out: {report['left_out']}.")
    if report.get("strides_without_place"):
        parts.append(
            f"Strides that began where the body was not seen, or ended so, not counted: "
            f"{report['strides_without_place']}."
        )
    if short:
        parts.append(f"Fewer than three strides in a mud, all of them counted: {counted(short, 'time')}.")
    return "\n\n".join(parts)


def _speeds_text(report: dict[str, Any]) -> str:
    muds = list(report["settings"]["mud_length_cm"])
    head = ["speed (cm/s)", *map(mud_label, muds), "all muds"]
    rows = [head]
    for rule, row in report["table"].items():
        over = report["mean_over_muds"][rule]
        rows.append([rule, *(_plus_minus(row[mud], "") for mud in muds), number(over["mean"], 2)])
        rows.append(["  all strides", *(_plus_minus(row[mud], "_all") for mud in muds), number(over["mean_all"], 2)])
        if rule in report["paper"]:
            reported = fmean(each["mean"] for each in report["paper"][rule].values())
            rows.append(["  paper", *(_paper_text(report, rule, mud) for mud in muds), number(reported, 2)])
    trials = counted(report["settings"]["seeds"], "trial")
    return f"Table I: speed after the second stride in each mud, mean ± sd of {trials}\n{table(rows)}"


def _plus_minus(cell: Mapping[str, Any], which: str) -> str:
    mean, sd = cell["mean" + which], cell["sd" + which]
    return number(mean, 2) if sd is None else f"{number(mean, 2)} ± {sd:.2f}"


def _paper_text(report: dict[str, Any], rule: str, mud: str) -> str:
    reported = report["paper"][rule].get(mud)
    if reported is None:
        return "-"
    inside = report["within_one_sd"].get(rule, {}).get(mud)
    verdict = "" if inside is None else (", ours within" if inside else ", ours outside")
    return f"{reported['mean']:.1f} ± {reported['sd']:.1f}{verdict}"


def _failures_text(report: dict[str, Any]) -> str:
    muds = list(report["settings"]["mud_length_cm"])
    rows = [["", *map(mud_label, muds), "ends"]]
    for rule, row in report["table"].items():
        ends = ", ".join(f"{count} {end}" for end, count in report["ends"][rule].items())
        rows.append([rule, *(_failed(row[mud]) for mud in muds), ends])
    return "Failed strides, in brackets those after the second\n" + table(rows)


def _failed(cell: Mapping[str, Any]) -> str:
    later = cell["failures_after_second"]
    named = [f"{count} ({later.get(name, 0)}) {name}" for name, count in cell["failures"].items()]
    return f"{', '.join(named) or 'none'} of {cell['strides']}"


def _best_text(report: dict[str, Any]) -> str:
    best = report["best_constant_depth"]
    rows = [["", *map(mud_label, best), "all muds"]]
    rows.append(["depth", *(f"{each['depth_cm']:g} cm" for each in best.values()), ""])
    means = [f"{each['mean']:.2f} cm/s" for each in best.values()]
    rows.append(["speed", *means, f"{report['best_constant_mean_over_muds']:.2f} cm/s"])
    for rule in report["settings"]["methods"]:
        rows.append([f"{rule} over it", *(number(ratio) for ratio in report["over_best"][rule].values()), ""])
    return "Best constant depth in each mud alone\n" + table(rows)


# the sweep


def sweep_text(report: dict[str, Any]) -> str:
    methods = report["settings"]["methods"]
    rows = [["strength", "best depth", "speed (cm/s)", *(_sweep_head(method) for method in methods)]]
    for row in report["strengths"]:
        cells = [_sweep_cell(row["methods"][method]) for method in methods]
        rows.append(
            [f"{row['strength_pa']:g} Pa", f"{row['best']['depth_cm']:g} cm", f"{row['best']['mean']:.2f}", *cells]
        )
    title = "Speed at the best constant depth, and where each method settles (after its second stride)"
    return f"{title}\n{table(rows)}"


def _sweep_head(method: str) -> str:
    return f"{method}: depth, speed (cm/s), share of best, failed"


def _sweep_cell(settled: Mapping[str, Any]) -> str:
    failed = sum(settled["failures"].values())
    fault = ", fault" if settled["faults"] else ""
    fraction = settled["share_of_best"]
    return (
        f"{number(settled['depth_cm'], 2)} cm  {settled['mean']:5.2f}  "
        f"{'-' if fraction is None else f'{100.0 * fraction:3.0f} %'}  {failed}/{settled['strides']}{fault}"
    )


# the fit


def fit_text(report: dict[str, Any]) -> str:
    return "\n\n".join([_values_text(report), _cells_text(report), _damping_text(report)])


def _values_text(report: dict[str, Any]) -> str:
    fitted, present = report["fitted"], report["present"]
    rows = [["", "fitted", "chi² within 1 of it", "present"]]
    for mud, strength_pa in fitted["strength_pa"].items():
        low, high = fitted["strength_range_pa"][mud]
        rows.append(
            [
                mud_label(mud),
                f"{strength_pa:.0f} Pa",
                f"{low:.0f} to {high:.0f} Pa",
                f"{present['strength_pa'][mud]:.0f} Pa",
            ]
        )
    damping, today = fitted["rail_damping_n_s_m"], present["rail_damping_n_s_m"]
    rows.append(["rail damping", f"{damping:g} N·s/m", "", f"{today:g} N·s/m"])
    rows.append(["chi²", f"{fitted['chi2']:.2f}", "", f"{present['chi2']:.2f}"])
    return "Fitted to the six fixed-depth cells of Table I\n" + table(rows)


def _cells_text(report: dict[str, Any]) -> str:
    rows = [["speed (cm/s)", "mud", "paper", "fitted", "present"]]
    for (rule, mud, speed, paper), (_, _, today, _) in zip(
        cells_beside_paper(report["fitted"]), cells_beside_paper(report["present"]), strict=True
    ):
        rows.append([rule, mud_label(mud), f"{paper.mean:.1f} ± {paper.sd:.1f}", f"{speed:.2f}", f"{today:.2f}"])
    return table(rows)


def _damping_text(report: dict[str, Any]) -> str:
    rows = [["rail damping (N·s/m)", "least chi²"]]
    rows += [[damping, f"{chi2:.2f}"] for damping, chi2 in report["chi2_of_damping"].items()]
    return table(rows)
