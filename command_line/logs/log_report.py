"""`mudskipper log report`: makes a page of a run, or one that compares several, with pictures, tables and the logs."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Annotated, Any

from command_line import exit_codes
from command_line.json_output import print_json
from command_line.logs.lab_findings import chosen_vertical, complain_of
from command_line.logs.log_options import Vertical
from command_line.screen import watched
from command_line.shared_options import Json
from experiments.pictures.mud_layout import MudLayout, layout_of_lengths, layout_of_track
from experiments.reports.error_table import COEFFICIENTS
from experiments.run_report.page import comparison_result, comparison_sentences, run_result
from experiments.run_report.results import Entry, differences, headline_of, headline_sentences
from experiments.run_report.run import Run, read_runs
from experiments.study.option import Option
from experiments.study.page import write_result
from experiments.study.result import to_json
from experiments.study.results_folder import PAGE
from experiments.study.values import folder, mud_length
from firmware_host.operator.reports import known, map_report, stride_report
from logs.files.log_error import LogError
from logs.files.log_summary import log_summary
from logs.files.whole_files import copy_whole
from logs.lab.summary import finding_reports

TERMINAL = 80  # letters in a line
FIT = ("r_squared", "r_squared_about_mean", "rms_residual_nm")


Muds = Annotated[
    tuple[tuple[str, float], ...],
    Option(
        "mud and its length (default: 61), in the order of the track",
        metavar="NAME[=CM]",
        parse=mud_length,
        alternative="mud",
    ),
]


def log_report(
    files: Annotated[
        tuple[Path, ...],
        Option("log of this project, its segments, or a CSV file of the paper's authors; several runs are compared"),
    ],
    *,
    out: Annotated[Path | None, Option("(default: a folder named after the log)", metavar="DIR", parse=folder)] = None,
    mud: Muds = (),
    world: Annotated[Path | None, Option("of the simulated robot: names the muds", alternative="mud")] = None,
    vertical: Vertical = None,
    json: Json = False,
) -> int:
    axis = chosen_vertical(vertical, files[0])
    layout = _layout(mud, world)
    with watched() as watch:
        runs = read_runs(files, layout, watch, axis)
        headlines = [headline_of(run) for run in runs]
        if len(runs) == 1:
            name, report = "report", _run_report(runs[0], headlines[0])
            result, sentences = run_result(runs[0], headlines[0]), headline_sentences(runs[0], headlines[0])
        else:
            name, report = "comparison", _comparison_report(runs, headlines)
            result, sentences = comparison_result(runs, headlines), comparison_sentences(runs, headlines)
        out = out or Path(f"{runs[0].name}-{name}")  # the user may have no right to write where the log is
        try:
            out.mkdir(parents=True, exist_ok=True)
            logs = [_copy(path, out) for path in files]
            written = write_result(out, replace(result, logs=logs), report, watch=watch)
        except OSError as problem:
            raise LogError(f"{problem.filename or out}: {problem.strerror or problem}") from None
    for run in runs:
        complain_of(run.paths[0], run.replay.findings)
    print(fill(" ".join(sentences), TERMINAL), file=sys.stderr)
    if json:
        print_json(f"log-{name}", to_json(report))
    else:
        print(out / PAGE)
    print(f"written  {len(written)} files in {out}", file=sys.stderr)
    whole = all(headline["complete"] for headline in headlines)
    return exit_codes.OK if whole else exit_codes.UNHEALTHY


def _layout(mud: Sequence[tuple[str, float]], world: Path | None) -> MudLayout | None:
    """Raises ConfigurationError for a wrong world."""
    if world:
        from simulation.harness.world import load_world  # slow to import

        return layout_of_track(load_world(world).track)
    return layout_of_lengths([(name, cm / 100.0) for name, cm in mud]) if mud else None


def _copy(log: Path, folder: Path) -> Path:
    copy = folder / log.name
    if copy.absolute() != log.absolute():
        copy_whole(log, copy)
    return copy


# the numbers


def _run_report(run: Run, headline: Entry) -> dict[str, Any]:
    return {
        "log": [path.name for path in run.paths],
        "clock": "times of strides and events are by the log's own clock; the log begins at begin_s of it",
        "begin_s": run.replay.begin_s,
        "headline": headline,
        "muds_from": run.muds_from,
        "summary": log_summary(run.log) if run.log else {},
        "strides": [stride_report(stride) for stride in run.replay.strides],
        "fits": [{name: _fit_report(getattr(fits, name)()) for name in COEFFICIENTS} for fits in run.replay.fits],
        "map": map_report(run.replay.map),
        "faults": [cause._asdict() for cause in run.causes],
        "events": run.log.events if run.log else [],
        "findings": finding_reports(run.paths[0], run.replay.findings),
    }


def _fit_report(samples: Any) -> dict[str, Any] | None:
    """Return the quality of a fit; None for a coefficient without one."""
    if samples is None:
        return None
    return {name: known(getattr(samples, name)) for name in FIT} | {"samples": len(samples.torques_nm)}


def _comparison_report(runs: Sequence[Run], headlines: Sequence[Entry]) -> dict[str, Any]:
    described = [
        {"run": run.name, "robot": run.robot, "headline": headline}
        for run, headline in zip(runs, headlines, strict=True)
    ]
    return {"runs": described, "differences": differences(runs, headlines)}
