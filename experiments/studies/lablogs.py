"""Estimates from real logs, of which the truth is unknown: do they repeat, and do their errors say how well?

Any folder of logs is evaluated by each method: trials of one mud against each other, muds against each other, the left
flipper against the right one, mud against air, and each log against itself with disturbed columns.
"""

from collections.abc import Sequence
from errno import ENOTDIR
from functools import partial
from pathlib import Path
from typing import Annotated

from experiments.lablogs import plots
from experiments.lablogs.estimates import EvaluatedLog, Refusal, join_estimates, read_log
from experiments.lablogs.log_choice import GroupRule, Paths, find_logs, groups_of, matches, parse_rule
from experiments.lablogs.report import DEFINITIONS, summary_of, tables_of
from experiments.study.option import Option, OptionError
from experiments.study.result import Figure, Result
from experiments.study.session import Ending
from experiments.study.trials import Trials
from firmware_host.configuration.configuration import CaptureAxis
from logs.lab.body_track import VERTICAL_AXIS

FIGURES = {
    plots.draw_strokes: "k_s by stroke and trial, with claimed errors.",
    plots.draw_scatter: "Scatter over claimed error of first and of later strokes, next to the normal distribution.",
    plots.draw_left_right: "The left against the right flipper in walks, with claimed errors.",
    plots.draw_sensitivity: "Disturbed over recorded values.",
}


Groups = Annotated[
    tuple[GroupRule, ...],
    Option(
        "put logs with such a file name into one group (default: the mud that the log names, or a label, as 12.5N)",
        metavar="PATTERN=NAME",
        parse=parse_rule,
        keyed=True,
    ),
]


VerticalAxis = Annotated[CaptureAxis, Option("axis of a CSV log's motion capture that points up", metavar="AXIS")]
SurfaceError = Annotated[
    float | None,
    Option("standard error of the mud's height (default: 5 for walks, else 1)", low=0.1, high=50, unit="mm"),
]


def study(
    trials: Trials,
    folders: Annotated[tuple[Path, ...], Option("with logs: .csv, .csv.gz or .mcap", metavar="DIR")],
    *,
    group: Groups = (),
    air: Annotated[tuple[str, ...], Option("logs without mud (default: detected)", metavar="PATTERN")] = (),
    vertical: VerticalAxis = VERTICAL_AXIS,
    surface_error: SurfaceError = None,
) -> Result:
    """Real logs: do estimates repeat as they claim?

    Evaluate the estimates from real logs by each method, without a known truth. A group is the logs of one mud, and one
    log is one trial (in .mcap, each walk is). first CV: coefficient of variation (sample standard deviation over mean)
    over trials of the first stroke's value, one flipper on a fixed base. later CV: the same of each trial's geometric
    mean over its later strokes. chi: scatter over claimed error, between trials and between strokes; 1 is right.
    Separation: difference of two groups' first strokes in pooled standard deviations. Left against right: median of the
    difference over its claimed error in walks; 0.67 is right. Logs without mud must give no values and no bounds.
    Sensitivity: the same logs with currents 5 ms late or early, and with 30 percent of the rows missing.
    """
    surface_error_m = None if surface_error is None else surface_error / 1000.0
    logs = _logs_in(folders, [*(rule.pattern for rule in group), *air])
    read_one = partial(read_log, vertical=vertical, surface_error_m=surface_error_m, air=air)
    read = trials.compute([partial(read_one, paths) for paths in logs])
    refused = [each for each in read if isinstance(each, Refusal)]
    measured = [each for each in read if isinstance(each, EvaluatedLog)]
    groups = groups_of([(log.name, log.mud) for log in measured], group)
    estimates = join_estimates(measured, groups)
    summary = summary_of(measured, groups, estimates, refused)
    return Result(
        tables=tables_of(summary),
        figures=[
            Figure(draw.__name__.removeprefix("draw_"), caption, partial(draw, estimates), "Figures")
            for draw, caption in FIGURES.items()
            if measured
        ],
        summary=summary,
        title="Estimates from real logs",
        texts={"Definitions": DEFINITIONS},
        ending=Ending.DONE if measured else Ending.UNHEALTHY,
    )


def _logs_in(folders: Sequence[Path], patterns: Sequence[str]) -> list[Paths]:
    """Return the logs. Raises OptionError for a folder without logs and a pattern that no log matches, and OSError."""
    for path in folders:
        if not path.exists():
            raise NotADirectoryError(ENOTDIR, "there is no such folder", str(path))
    logs = find_logs(folders)
    if not logs:
        raise OptionError(f"{folders[0]}: holds no log: no file whose name ends with .csv, .csv.gz or .mcap")
    for pattern in patterns:
        if not any(matches(paths[0].name, pattern) for paths in logs):
            raise OptionError(f"pattern {pattern!r}: no log has such a name")
    return logs
