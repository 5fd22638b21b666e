"""`mudskipper log report`: makes a page of a run, or one that compares several, with pictures, tables and the logs."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Annotated

from command_line import exit_codes
from command_line.json_output import SCHEMAS, Answer
from command_line.logs.complaints import chosen_vertical, complain_of
from command_line.logs.log_options import Vertical
from command_line.screen import watched
from experiments.pictures.mud_layout import MudLayout, layout_of_lengths, layout_of_track
from experiments.run_report.page import report_of
from experiments.run_report.run import read_runs
from experiments.study.option import Option
from experiments.study.page import write_result
from experiments.study.results_folder import PAGE
from experiments.study.session import Ending
from experiments.study.values import folder, mud_length
from firmware_host.configuration.file_problems import why_not
from logs.files.log_error import LogError
from logs.files.whole_files import copy_whole

TERMINAL = 80  # letters in a line


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
        Option("log of this project, its segments, or a CSV file of the paper's authors; runs and trials are compared"),
    ],
    *,
    out: Annotated[Path | None, Option("(default: a folder named after the log)", metavar="DIR", parse=folder)] = None,
    mud: Muds = (),
    world: Annotated[Path | None, Option("of the simulated robot: names the muds", alternative="mud")] = None,
    vertical: Vertical = None,
) -> Answer:
    axis = chosen_vertical(vertical, files[0])
    layout = _layout(mud, world)
    with watched() as watch:
        runs = read_runs(files, layout, watch, axis)
        result, name = report_of(runs), "report" if len(runs) == 1 else "comparison"
        out = out or Path(f"{runs[0].name}-{name}")  # the user may have no right to write where the log is
        try:
            out.mkdir(parents=True, exist_ok=True)
            logs = [_copy(path, out) for path in files]
            summary = {"schema": f"log-{name}/{SCHEMAS[f'log-{name}']}"} | result.json()
            written = write_result(out, replace(result, logs=logs), summary, watch=watch)
        except OSError as problem:
            raise LogError(why_not(problem, out)) from None
    for run in runs:
        complain_of(run.paths[0], run.replay.findings)
    print(fill(result.texts["Result"].partition("\n\n")[0], TERMINAL), file=sys.stderr)
    print(f"written  {len(written)} files in {out}", file=sys.stderr)
    status = exit_codes.OK if result.ending is Ending.DONE else exit_codes.UNHEALTHY
    return Answer(summary, str(out / PAGE), status)


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
