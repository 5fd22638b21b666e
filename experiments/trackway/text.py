"""The trackway's finding, simulated or at the bench: sections with tables and pictures, and tables for the screen.

The figures of walks against time, the paper's figure 8 B to E, come from the logs in the experiment's folder.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean

from experiments.pictures.recorded_walk import RecordedWalk, numbered_walk
from experiments.reports.counted_nouns import counted
from experiments.reports.mud_names import mud_label
from experiments.reports.mud_styles import file_name
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import number, table
from experiments.robot.log_copies import cut_log
from experiments.robot.prompt import Operator
from experiments.study.notebook import Notebook
from experiments.study.workers import Workers
from experiments.trackway import bench, simulation
from experiments.trackway.bench import BenchReport, LoggedTime
from experiments.trackway.report import PAPER_TABLE, SpeedCell, TrackwayReport
from experiments.trackway.simulation import SimulatedReport
from experiments.trials.mud_trials import open_bench, run_trials
from experiments.trials.session import Finding, Session
from firmware_host.log.log_folder import first_path, run_files
from logs.files.log_error import LogError
from logs.files.log_reader import read_log, read_logs

INSTRUCTIONS = (
    "Torque is off: level the mud, and put the sweep axes over the beginning of the first mud. Take your hands away: "
    "the robot walks next"
)
WALKS_AND_TABLE = (
    "Left, as in the paper's figure 8: the first walk of each gait. Right: Table I, the paper's three trials as grey "
    "bars and ours as dots, each with one standard deviation."
)
AGAINST_TIME = (
    "{}, as figure 8 B to E of the paper: forces, coefficients and depth, then position and steps, against time. The"
    " shade changes where the robot noticed another mud; 'mudskipper plot' draws the same of any walk."
)


def run_simulated(plan: simulation.Plan, session: Session, workers: Workers | None = None) -> Finding:
    return _finding(
        simulation.run(plan, Notebook(session.folder, {**plan.identity, **session.program}), session.show, workers)
    )


def run_at_bench(plan: bench.Plan, session: Session) -> Finding:
    """Make the trials and report them. Raises BenchError."""
    robot_bench = open_bench(session, plan.identity, lambda trial: INSTRUCTIONS)
    configuration, entries, logs = run_trials(robot_bench, session, lambda: bench.run(robot_bench, plan, session.show))
    report = bench.report_of(plan, entries, configuration.geometry.flipper_length_m)
    figures = walk_figures(bench.first_walks(plan, entries), session.folder, session.operator)
    return _finding(report, logs, figures)


def _finding(report: TrackwayReport, logs: Sequence[Path] = (), walks: Sequence[Figure] = ()) -> Finding:
    from experiments.trackway.plots import plot_trackway  # matplotlib takes its time

    text = trackway_text(report)
    table = Figure("trackway", WALKS_AND_TABLE, partial(plot_trackway, report))
    sections = [Section("Table I", screen=text, figures=[table])]
    if walks:
        sections.append(Section("Walks against time", "The first walk of each gait that counts.", figures=walks))
    return Finding(report, "The trackway: Table I of the paper", sections, text, logs)


def walk_figures(walks: Mapping[str, LoggedTime], folder: Path, operator: Operator) -> list[Figure]:
    """Make the figure of each walk whose log is there, and report to the operator why another walk has none."""
    from experiments.pictures.walk_plot import plot_walk

    figures = []
    for key, logged in walks.items():
        try:
            walk = logged_walk(folder, logged)
        except LogError as problem:
            operator.report(f"{key} is not drawn: {problem}")
        else:
            figures.append(Figure(f"figure8_{file_name(key)}", AGAINST_TIME.format(key), partial(plot_walk, walk)))
    return figures


def logged_walk(folder: Path, logged: LoggedTime) -> RecordedWalk:
    """Read a walk from the segments of its log that hold it; others may be missing. Raises LogError."""
    run, from_s, to_s = logged
    segments = run_files(folder / first_path(folder, run).name)
    held = [path for path in segments if len(cut_log(read_log(path, from_s=from_s), from_s, to_s).ticks)]
    if not held:
        raise LogError(f"its log is not in {folder}")
    return numbered_walk(held[0], cut_log(read_logs(held, from_s=from_s), from_s, to_s))


# tables


def trackway_text(report: TrackwayReport) -> str:
    parts = [_speeds_text(report), _failures_text(report)]
    if isinstance(report, SimulatedReport):
        parts.append(_best_text(report))
    short = sum(cell.short_trials for row in report.table.values() for cell in row.values())
    if isinstance(report, BenchReport) and report.left_out:
        parts.append(f"Trials left out: {report.left_out}.")
    if isinstance(report, BenchReport) and report.strides_without_position:
        parts.append(f"Strides not counted, because their start or end has no pose: {report.strides_without_position}.")
    if short:
        parts.append(f"Trials with fewer than three strides in a mud, all counted: {counted(short, 'time')}.")
    return "\n\n".join(parts)


def _speeds_text(report: TrackwayReport) -> str:
    rows = [["speed (cm/s)", *map(mud_label, report.settings.mud_length_cm), "all muds"]]
    for rule, row in report.table.items():
        over, cells = report.mean_over_muds[rule], list(row.values())
        rows.append([rule, *(_plus_minus(cell.mean, cell.sd) for cell in cells), number(over.mean, 2)])
        all_strides = [_plus_minus(cell.mean_all, cell.sd_all) for cell in cells]
        rows.append(["  all strides", *all_strides, number(over.mean_all, 2)])
        if rule in PAPER_TABLE:
            paper_mean = fmean(speed.mean for speed in PAPER_TABLE[rule].values())
            rows.append(["  paper", *(_paper_text(report, rule, mud) for mud in row), number(paper_mean, 2)])
    trials = counted(report.settings.seeds, "trial")
    return f"Table I: speed after the second stride in each mud, mean ± sd of {trials}\n{table(rows)}"


def _plus_minus(mean: float | None, sd: float | None) -> str:
    return number(mean, 2) if sd is None else f"{number(mean, 2)} ± {sd:.2f}"


def _paper_text(report: TrackwayReport, rule: str, mud: str) -> str:
    paper = PAPER_TABLE[rule].get(mud)
    if paper is None:
        return "-"
    within = report.within_one_sd.get(rule, {}).get(mud)
    verdict = "" if within is None else (", ours within" if within else ", ours outside")
    return f"{paper.mean:.1f} ± {paper.sd:.1f}{verdict}"


def _failures_text(report: TrackwayReport) -> str:
    rows = [["", *map(mud_label, report.settings.mud_length_cm), "ends"]]
    for rule, row in report.table.items():
        ends = ", ".join(f"{count} {end}" for end, count in report.ends[rule].items())
        rows.append([rule, *(_failures_of(cell) for cell in row.values()), ends])
    return "Failed strides, in brackets those after the second\n" + table(rows)


def _failures_of(cell: SpeedCell) -> str:
    named = [f"{count} ({cell.failures_after_second.get(name, 0)}) {name}" for name, count in cell.failures.items()]
    return f"{', '.join(named) or 'none'} of {cell.strides}"


def _best_text(report: SimulatedReport) -> str:
    best = report.best_constant_depth
    rows = [["", *map(mud_label, best), "all muds"]]
    rows.append(["depth", *(f"{each.depth_cm:g} cm" for each in best.values()), ""])
    speeds = [f"{each.mean:.2f} cm/s" for each in best.values()]
    rows.append(["speed", *speeds, f"{report.best_constant_mean_over_muds:.2f} cm/s"])
    for rule in report.settings.methods:
        rows.append([f"{rule} over best", *map(number, report.over_best[rule].values()), ""])
    return "Best constant depth in each mud alone\n" + table(rows)
