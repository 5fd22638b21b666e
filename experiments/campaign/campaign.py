"""Runs the trials of a campaign that are not in its notebook yet, and reports all of them.

Each trial is in the notebook as soon as it ends. The Parquet file is written at the end, and also where something ends
the campaign early: the same command continues it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import fmean, stdev

from experiments.campaign.campaign_file import Campaign, Trial
from experiments.campaign.points import Values
from experiments.campaign.trials_table import write_trials
from experiments.campaign.walk_trial import BROKEN, run_walk
from experiments.reports.counted_nouns import counted
from experiments.reports.report_page import Section
from experiments.reports.shown_values import value_shown
from experiments.reports.text_tables import Rows, number, table
from experiments.study.notebook import Entry, Notebook
from experiments.study.provenance import program_text, provenance
from experiments.study.workers import Workers, run_parallel
from experiments.trials.session import Finding, Session, Show
from firmware_host.software_version import build_metadata
from logs.catalogue.entry import TRIALS

SHOWN_POINTS = 30


@dataclass(frozen=True)
class PointResult:
    """The trials at one point; the speed is a mean over the seeds, with their standard deviation."""

    values: Values
    trials: int
    speed_m_s: float | None
    speed_sd_m_s: float | None
    strides: int
    stuck_strides: int
    faults: Sequence[str]
    not_started: int  # trials in which the robot was not armed or did not walk


@dataclass(frozen=True, kw_only=True)
class CampaignReport:
    experiment: str = "campaign"
    campaign: str
    trials: int
    seeds: int
    program: str
    results: str  # the Parquet file
    points: Sequence[PointResult]


def run_campaign(campaign: Campaign, session: Session, workers: Workers | None = None) -> Finding:
    """Raises NotebookError, WorkersError, OSError."""
    notebook = Notebook(session.folder, {"experiment": "campaign", **session.program} | campaign.identity)
    try:
        _run_trials(campaign.trials, notebook, session.show, workers)
    finally:
        _write(campaign, notebook, session.folder / TRIALS)
    report = _report(campaign, notebook.entries, program_text(session.program))
    text = _text(report)
    return Finding(report, f"Campaign {campaign.name}", [Section("Points", screen=text)], text)


def _run_trials(trials: Sequence[Trial], notebook: Notebook, show: Show, workers: Workers | None) -> None:
    left = [trial for trial in trials if trial.key not in notebook.entries]
    before = len(trials) - len(left)
    run_parallel(
        [partial(run_walk, trial.tables, trial.seed) for trial in left],
        lambda done, _: show(before + done, len(trials)),
        workers,
        keep=lambda index, entry: notebook.write(left[index].key, entry),
    )


def _write(campaign: Campaign, notebook: Notebook, path: Path) -> None:
    build, record = build_metadata(), provenance(__name__)
    rows = [
        notebook.entries[trial.key]
        | build
        | {"sources": record["sources"]}
        | {"file": f"{campaign.name}, {trial.key}", "run": campaign.name, "point": trial.point, "seed": trial.seed}
        | trial.values
        for trial in campaign.trials
        if trial.key in notebook.entries
    ]
    if rows:
        write_trials(path, rows, list(campaign.points[0]), {"campaign": campaign.name} | record)


def _report(campaign: Campaign, entries: Mapping[str, Entry], program: str) -> CampaignReport:
    by_point: list[list[Entry]] = [[] for _ in campaign.points]
    for trial in campaign.trials:
        by_point[trial.point - 1].append(entries[trial.key])
    return CampaignReport(
        campaign=campaign.name,
        trials=len(campaign.trials),
        seeds=campaign.seeds,
        program=program,
        results=TRIALS,
        points=[_point_result(*each) for each in zip(campaign.points, by_point, strict=True)],
    )


def _point_result(values: Values, entries: Sequence[Entry]) -> PointResult:
    speeds_m_s = [entry["speed_m_s"] for entry in entries if entry["speed_m_s"] is not None]
    return PointResult(
        values=values,
        trials=len(entries),
        speed_m_s=fmean(speeds_m_s) if speeds_m_s else None,
        speed_sd_m_s=stdev(speeds_m_s) if len(speeds_m_s) > 1 else None,
        strides=sum(entry["strides"] for entry in entries),
        stuck_strides=sum(entry["stuck_strides"] for entry in entries),
        faults=sorted({fault for entry in entries for fault in entry["faults"]}),
        not_started=sum(entry["state"] == BROKEN for entry in entries),
    )


def _text(report: CampaignReport) -> str:
    fastest = sorted(report.points, key=lambda point: -(point.speed_m_s or 0.0))[:SHOWN_POINTS]
    shown = report.points if len(report.points) <= SHOWN_POINTS else fastest
    which = "" if shown is report.points else f", the fastest {len(shown)}"
    title = f"{counted(report.trials, 'walk')} at {counted(len(report.points), 'point')}{which}; all are in {TRIALS}"
    return f"{title}\n{table(_rows(shown))}"


def _rows(points: Sequence[PointResult]) -> Rows:
    keys = list(points[0].values)
    head = [*keys, "speed (cm/s)", "sd", "strides", "stuck", "faults"]
    return [head, *([*(value_shown(point.values[key]) for key in keys), *_cells(point)] for point in points)]


def _cells(point: PointResult) -> list[str]:
    speeds = [None if speed is None else 100.0 * speed for speed in (point.speed_m_s, point.speed_sd_m_s)]
    faults = ", ".join([*point.faults, *([f"{point.not_started} not started"] if point.not_started else [])])
    return [*(number(speed, 2) for speed in speeds), str(point.strides), str(point.stuck_strides), faults or "-"]
