"""`mudskipper log report`: makes a page of a run, or one that compares several, with pictures, tables and the logs."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from command_line import exit_codes
from command_line.json_output import print_json
from command_line.logs.lab_findings import chosen_vertical, complain_of
from command_line.logs.refusals import explain_errors
from command_line.screen import watched
from experiments.pictures.mud_layout import MudLayout, layout_of_lengths, layout_of_track
from experiments.reports.report_page import PAGE, to_json, write_report
from experiments.run_report.comparison import ComparedRun, differences
from experiments.run_report.fit_quality import fits_report
from experiments.run_report.headline import headline_of, headline_sentences
from experiments.run_report.run import Run, read_run, read_sources
from experiments.run_report.sections import comparison_sections, comparison_sentences, run_sections
from firmware_host.operator.reports import map_report, stride_report
from logs.files.log_error import LogError, Watch
from logs.files.log_summary import log_summary
from logs.files.whole_files import copy_whole
from logs.lab.summary import finding_reports

ALSO = (".svg", ".pdf")  # of every picture, for papers
TERMINAL = 80  # letters in a line
Report = dict[str, Any]


@explain_errors
def log_report(options: argparse.Namespace) -> int:
    vertical = chosen_vertical(options)
    layout = _layout(options)
    with watched() as watch:
        runs = [_compared(read_run(source, layout, watch, vertical)) for source in read_sources(options.files, watch)]
        folder: Path = options.out or _report_folder(runs)
        written = _write(folder, runs, options.files, watch)
    for each in runs:
        complain_of(each.run.path, each.run.replay.findings)
    print(fill(_spoken(runs), TERMINAL), file=sys.stderr)
    if options.json:
        print_json(_schema(runs), to_json(_report_of(runs)))
    else:
        print(folder / PAGE)
    print(f"written  {len(written)} files in {folder}", file=sys.stderr)
    return exit_codes.OK


def _layout(options: argparse.Namespace) -> MudLayout | None:
    """Raises ConfigurationError for a wrong world."""
    if options.world:
        from simulation.harness.world import load_world  # slow to import

        return layout_of_track(load_world(options.world).track)
    return layout_of_lengths([(name, cm / 100.0) for name, cm in options.mud]) if options.mud else None


def _compared(run: Run) -> ComparedRun:
    return ComparedRun(run, headline_of(run))


def _spoken(runs: Sequence[ComparedRun]) -> str:
    """Returns the result for a terminal."""
    first, *others = runs
    return " ".join(comparison_sentences(runs) if others else headline_sentences(first.run, first.headline))


def _report_folder(runs: Sequence[ComparedRun]) -> Path:
    """Returns a path in the present folder: the user may not be permitted to write into the log folder."""
    return Path(f"{runs[0].run.name}-{'report' if len(runs) == 1 else 'comparison'}")


def _write(folder: Path, runs: Sequence[ComparedRun], files: Sequence[Path], watch: Watch) -> list[Path]:
    """Raises LogError where the folder cannot be written."""
    first = runs[0]
    if len(runs) == 1:
        title, sections = f"Log {files[0].name}", run_sections(first.run, first.headline)
    else:
        title, sections = f"Comparison of {len(runs)} runs", comparison_sections(runs)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        logs = [_copy(path, folder) for path in files]
        return write_report(folder, _report_of(runs), title, sections, logs, ALSO, watch)
    except OSError as problem:
        raise LogError(f"{problem.filename or folder}: {problem.strerror or problem}") from None


def _copy(log: Path, folder: Path) -> Path:
    copy = folder / log.name
    if copy.absolute() != log.absolute():
        copy_whole(log, copy)
    return copy


# the numbers


def _schema(runs: Sequence[ComparedRun]) -> str:
    return "log-report" if len(runs) == 1 else "log-comparison"


def _report_of(runs: Sequence[ComparedRun]) -> Report:
    if len(runs) == 1:
        return _run_report(runs[0])
    described = [{"run": each.run.name, "robot": each.run.robot, "headline": each.headline} for each in runs]
    return {"runs": described, "differences": differences(runs)}


def _run_report(each: ComparedRun) -> Report:
    run = each.run
    return {
        "log": [path.name for path in run.paths],
        "clock": "times of strides and events are by the log's own clock; the log begins at begin_s of it",
        "begin_s": run.replay.begin_s,
        "headline": each.headline,
        "muds_from": run.muds_from,
        "summary": log_summary(run.log) if run.log else {},
        "strides": [stride_report(stride) for stride in run.replay.strides],
        "fits": [fits_report(fits) for fits in run.replay.fits],
        "map": map_report(run.replay.map),
        "faults": [cause._asdict() for cause in run.causes],
        "events": run.log.events if run.log else [],
        "findings": finding_reports(run.path, run.replay.findings),
    }
