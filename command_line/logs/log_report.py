"""`mudskipper log report`: makes a page of a log, with pictures and numbers, and a copy of the log next to it."""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from command_line import exit_codes
from command_line.json_output import print_json
from command_line.logs.lab_findings import complain_of
from command_line.logs.refusals import chosen_vertical, explain_errors
from command_line.logs.shown_values import value_shown
from command_line.screen import coefficient, watched
from experiments.pictures.recorded_walk import RecordedWalk, read_walk
from experiments.pictures.stride_choice import choose_strides
from experiments.reports.report_page import PAGE, Figure, Section, to_json, write_report
from experiments.reports.text_tables import number
from firmware_host.configuration.configuration import CaptureAxis
from firmware_host.log.whole_files import copy_whole
from firmware_host.log_reading.fault_history import read_causes
from firmware_host.log_reading.lab.body_track import VERTICAL_AXIS
from firmware_host.log_reading.lab.summary import finding_reports
from firmware_host.log_reading.log_reader import Log, LogError, Watch, begin_s, log_summary, read_logs
from firmware_host.log_reading.replay import Replay, replay_files
from firmware_host.operator.reports import map_report, stride_report

EVENTS_REPORTED = 200  # the last ones
SINCE = "Times count from the beginning of the log."
Report = dict[str, Any]


@explain_errors
def log_report(options: argparse.Namespace) -> int:
    chosen_vertical(options)
    folder: Path = options.out or _report_folder(options.files[0])
    folder.mkdir(parents=True, exist_ok=True)
    with watched() as watch:
        report, sections, replayed = _read_report(options.files, options.vertical, watch)
    logs = [_copy(path, folder) for path in options.files]
    complain_of(options.files[0], replayed.findings)
    written = write_report(folder, report, f"Log {options.files[0].name}", sections, logs)
    if options.json:
        print_json("log-report", to_json(report))
    else:
        print(folder / PAGE)
    print(f"written  {', '.join(map(str, written))}", file=sys.stderr)
    return exit_codes.OK


def _report_folder(log: Path) -> Path:
    """Returns a path in the present folder: the user may not be permitted to write into the log folder."""
    return Path(f"{log.name.removesuffix('.gz').removesuffix('.csv').removesuffix('.mcap')}-report")


def _copy(log: Path, folder: Path) -> Path:
    copy = folder / log.name
    if copy.absolute() != log.absolute():
        copy_whole(log, copy)
    return copy


def _read_report(
    files: Sequence[Path], vertical: CaptureAxis | None, watch: Watch
) -> tuple[Report, list[Section], Replay]:
    """Raises LogError."""
    ours = read_logs(files, watch) if files[0].suffix == ".mcap" else None
    replayed = replay_files(files, watch=watch, vertical=vertical)
    report: Report = {
        "log": [path.name for path in files],
        "clock": "times of strides and events are by the log's own clock; the log begins at begin_s of it",
        "begin_s": replayed.begin_s,
        "summary": log_summary(ours) if ours else {},
        "strides": [stride_report(stride) for stride in replayed.strides],
        "map": map_report(replayed.map),
        "faults": [cause._asdict() for cause in read_causes(ours.events, ours.configuration_text)] if ours else [],
        "events": ours.events if ours else [],
        "findings": finding_reports(files[0], replayed.findings),
    }
    sections = [*_walk_sections(files, vertical or VERTICAL_AXIS, watch), _strides_section(replayed)]
    if ours:
        return report, [_summary_section(ours), _faults_section(ours), *sections, _events_section(ours)], replayed
    return report, [_findings_section(replayed), *sections], replayed


def _findings_section(replayed: Replay) -> Section:
    rows = [["", ""], *([str(finding.kind), str(finding)] for finding in replayed.findings)]
    return Section("Findings", "What the reader noticed in the file." if replayed.findings else "None.", rows=rows)


def _summary_section(log: Log) -> Section:
    unfinished = "" if log.complete else "The log was not finished: everything up to where it ends was read."
    rows = [["", ""], *([name, value_shown(value)] for name, value in log_summary(log).items())]
    return Section("Contents of the log", unfinished, rows=rows)


def _walk_sections(files: Sequence[Path], vertical: CaptureAxis, watch: Watch) -> list[Section]:
    """Returns a section for each walk, or one message where the robot did not walk."""
    try:
        last = read_walk(files[0], 0, files[1:], watch, vertical)
    except LogError as problem:
        return [Section("Walks", f"{problem}.")]
    walks = [read_walk(files[0], count, files[1:], watch, vertical) for count in range(1, last.walks)] + [last]
    return [_walk_section(walk, count) for count, walk in enumerate(walks, 1)]


def _walk_section(walk: RecordedWalk, count: int) -> Section:
    from experiments.pictures.walk_plot import plot_walk  # matplotlib is slow to import

    begun = f"It begins {walk.begun_s:.2f} s after the log. Its pictures count from there, as 'mudskipper plot' does."
    missing = f"Not in this log: {', '.join(walk.missing)}." if walk.missing else ""
    cut = f"The walk may have {walk.cut}." if walk.cut else ""
    figures = [Figure(f"walk-{count}", "Forces, coefficients, depth, position and steps.", partial(plot_walk, walk))]
    if walk.own_strides:
        figures.append(Figure(f"strides-{count}", "The clearest stride of each outcome.", partial(_draw_strip, walk)))
    return Section(f"Walk {count}", "\n\n".join(filter(None, (begun, missing, cut))), figures=figures)


def _draw_strip(walk: RecordedWalk, path: Path) -> None:
    from experiments.pictures.stride_strip import draw_strip

    draw_strip(walk, choose_strides(walk), path)


def _strides_section(replayed: Replay) -> Section:
    if not replayed.strides:
        return Section("Strides", "No complete stride.")
    text = f"{SINCE} Coefficients have their standard errors; ≥ marks a lower bound, brackets mark an invalid one."
    head = ["flipper", "stride", "from (s)", "k_p (N/cm³)", "k_s (N/cm³)", "k_e (N/cm³)", "depth (cm)", "step (cm)", ""]
    rows = [_stride_row(stride_report(stride), replayed.begin_s) for stride in replayed.strides]
    return Section("Strides", text, rows=[head, *rows])


def _stride_row(stride: dict[str, Any], begin_s: float) -> list[str]:
    return [
        stride["flipper"],
        str(stride["index"]),
        f"{stride['t_start_s'] - begin_s:.2f}",
        *(coefficient(stride[name]) for name in ("k_p", "k_s", "k_e")),
        _in_cm(stride["depth_m"]),
        _in_cm(stride["step_m"]),
        "" if stride["released"] else "stuck",
    ]


def _in_cm(value_m: float | None) -> str:
    return number(None if value_m is None else 100.0 * value_m, 1)


def _faults_section(log: Log) -> Section:
    causes = read_causes(log.events, log.configuration_text)
    if not causes:
        return Section("Faults", "None.")
    head = ["first at (s)", "times", "cause", "parts", "consequences", "what to do"]
    rows = [
        [
            f"{cause.first_s - begin_s(log):.2f}",
            str(cause.times),
            cause.message,
            ", ".join(cause.subjects),
            ", ".join(cause.consequences),
            cause.what_to_do,
        ]
        for cause in causes
    ]
    return Section("Faults", f"{SINCE} Faults of one cause are one row.", rows=[head, *rows])


def _events_section(log: Log) -> Section:
    latest = log.events[-EVENTS_REPORTED:]
    omitted = f" The last {len(latest)} of {len(log.events)}." if len(latest) < len(log.events) else ""
    rows = [["at (s)", ""], *([f"{event['stamp_s'] - begin_s(log):.2f}", event["text"]] for event in latest)]
    return Section("Events", SINCE + omitted, rows=rows)
