"""Estimates from real logs, of which the truth is unknown: do they repeat, and do their errors say how well?

Any folder of logs is evaluated by each method: trials of one mud against each other, muds against each other, the left
flipper against the right one, mud against air, and each log against itself with disturbed columns.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from experiments.lablogs import plots
from experiments.lablogs.lab_trial import LabTrial, Refusal, read_trial
from experiments.lablogs.log_choice import GroupRule, Paths, find_logs, group_of, group_trials, matches, parse_rule
from experiments.lablogs.report import report_of
from experiments.lablogs.tables import DEFINITIONS, FIGURES, tables_of
from experiments.study.option import Option, OptionError
from experiments.study.result import Figure, Result
from experiments.study.session import Ending
from experiments.study.trials import Trials
from firmware_host.configuration.configuration import CaptureAxis
from logs.lab.body_track import VERTICAL_AXIS

TITLE = "Estimates from real logs"
FIGURE_SECTION = "Figures"


def study(
    trials: Trials,
    folders: Annotated[tuple[Path, ...], Option("with logs: .csv, .csv.gz or .mcap", metavar="DIR")],
    *,
    group: Annotated[
        tuple[GroupRule, ...],
        Option(
            "put logs with such a file name into one group (default: the label in the name, as 12.5N)",
            metavar="PATTERN=NAME",
            parse=parse_rule,
        ),
    ] = (),
    air: Annotated[tuple[str, ...], Option("logs without mud (default: detected)", metavar="PATTERN")] = (),
    vertical: Annotated[
        CaptureAxis, Option("axis of a CSV log's motion capture that points up", metavar="AXIS")
    ] = VERTICAL_AXIS,
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
    logs = _logs_in(folders, [*(rule.pattern for rule in group), *air])
    read = trials.compute([partial(read_trial, paths, vertical=vertical) for paths in logs])
    refused = [each for each in read if isinstance(each, Refusal)]
    measured = [each for each in read if isinstance(each, LabTrial)]
    if air:
        in_air = [any(matches(each.name, pattern) for pattern in air) for each in measured]
        measured = [each._replace(in_mud=not dry) for each, dry in zip(measured, in_air, strict=True)]
    grouped = [(each, group_of(each.name, group)) for each in measured]
    groups = group_trials(grouped)
    report = report_of(grouped, groups, refused)
    mud = [each for each in measured if each.in_mud]
    draw = {
        "strokes": partial(plots.draw_strokes, groups),
        "scatter": partial(plots.draw_scatter, groups),
        "left_right": partial(plots.draw_left_right, mud),
        "sensitivity": partial(plots.draw_sensitivity, mud),
    }
    return Result(
        tables=tables_of(report),
        figures=[Figure(name, caption, draw[name], FIGURE_SECTION) for name, caption in FIGURES.items()],
        summary=report,
        title=TITLE,
        texts={"Definitions": DEFINITIONS},
        ending=Ending.DONE if report.logs else Ending.UNHEALTHY,
    )


def _logs_in(folders: Sequence[Path], patterns: Sequence[str]) -> list[Paths]:
    """Return the logs. Raises OptionError for a folder without logs, and for a pattern that no log matches."""
    for path in folders:
        if not path.exists():
            raise OptionError(f"{path}: no such folder")
    logs = find_logs(folders)
    if not logs:
        raise OptionError(f"{folders[0]}: holds no log: no file whose name ends with .csv, .csv.gz or .mcap")
    for pattern in patterns:
        if not any(matches(paths[0].name, pattern) for paths in logs):
            raise OptionError(f"pattern {pattern!r}: no log has such a name")
    return logs
