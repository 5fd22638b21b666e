"""The tables of the trackway experiment for the screen and for its page."""

from __future__ import annotations

from statistics import fmean

from experiments.reports.mud_names import mud_label
from experiments.reports.text_tables import number, table
from experiments.trackway.bench import BenchReport
from experiments.trackway.paper_table import PAPER_TABLE
from experiments.trackway.report import SpeedCell, TrackwayReport
from experiments.trackway.simulation import SimulatedReport
from firmware_host.operator.counted_nouns import counted


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
