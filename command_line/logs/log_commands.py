"""Commands that read logs: replay, plot, film, info."""

import os
from collections.abc import Sequence
from functools import partial
from math import fsum, nan
from pathlib import Path
from typing import Annotated, Literal

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.logs.complaints import chosen_vertical, complain_of, complain_of_end
from command_line.logs.log_options import MOST, LogFiles, Segments, Vertical, Walk
from command_line.screen import STRIDE_HEAD, STRIDE_UNITS, complain, other_surface, stride_line, watched
from experiments.pictures.recorded_walk import RecordedWalk, read_walk
from experiments.pictures.stride_choice import Stride, choose_strides, duration_s, outcome_of, with_strides
from experiments.reports.style import save_picture
from experiments.reports.text_tables import table, value_shown
from experiments.reports.validity_text import why_not_valid
from experiments.study.option import Option
from experiments.study.values import picture
from firmware_host.configuration.configuration import CaptureAxis
from firmware_host.configuration.loading import load_configuration
from firmware_host.log.log_folder import ACTIVE, DONE
from firmware_host.operator.reports import known, map_report, stride_report
from logs.files.log_error import LogError
from logs.files.log_summary import log_summary
from logs.files.scanned_log import scan_logs
from logs.lab.lab_csv import is_lab_csv, log_name, read_lab_csv
from logs.lab.summary import finding_reports, lab_summary
from logs.replay import replay_files

LONGEST_FILM_S = 60.0


def replay(
    files: LogFiles,
    *,
    config: Annotated[Path | None, Option("use this configuration (default: the one in the log)")] = None,
    method: Annotated[
        Literal["default", "paper"] | None, Option("estimate by this method (default: the configured one)")
    ] = None,
    vertical: Vertical = None,
) -> Answer:
    chosen_vertical(vertical, files[0])
    configuration = load_configuration(config) if config else None
    with watched() as watch:
        replayed = replay_files(files, configuration, method, watch, vertical)
    path = files[0]
    chosen_m = replayed.chosen_depths_m or [nan] * len(replayed.strides)
    strides = [
        stride_report(stride) | {"chosen_depth_m": known(depth_m)}
        for stride, depth_m in zip(replayed.strides, chosen_m, strict=True)
    ]
    complain_of(path, replayed.findings)
    lines = [f"{STRIDE_HEAD}  {'f_z in':>7} {'f_x':>6} {'f_z out':>7}"]
    lines.append(f"{STRIDE_UNITS}  {'(N)':>7} {'(N)':>6} {'(N)':>7}")
    for report, stride in zip(strides, replayed.strides, strict=True):
        forces = f"{stride.insertion_force_n:7.1f} {stride.stance_force_n:6.1f} {stride.extraction_force_n:7.1f}"
        lines.append(f"{stride_line(report, replayed.begin_s)}  {forces}{other_surface(report)}")
    lines += why_not_valid(strides)
    if not strides:
        complain("no complete stride in this log")
    if replayed.segment:
        complain(
            f"the run's segments before {replayed.segment} are not given: "
            "the first strides can differ from those computed live"
        )
    complain_of_end(files, replayed.complete)
    report = {"strides": strides, "map": map_report(replayed.map), "flippers": replayed.flippers}
    report |= {"complete": replayed.complete, "findings": finding_reports(path, replayed.findings)}
    return Answer(report, "\n".join(lines), schema="replay")


def plot(
    files: LogFiles,
    *,
    out: Annotated[Path | None, Option("or .svg, .pdf", metavar="PNG", parse=picture(".png", ".svg", ".pdf"))] = None,
    walk: Walk = 0,
    vertical: Vertical = None,
) -> int:
    path = out or _picture_path(files[0], ".png")
    recorded = _walk_for_picture(files, walk, vertical, path)
    if not recorded.strides:
        complain("no complete stride in this log")
    from experiments.pictures.walk_plot import plot_walk  # matplotlib is slow to import

    plot_walk(recorded, path)
    print(f"written  {path}")
    return exit_codes.OK


def film(
    files: LogFiles,
    *,
    out: Annotated[
        Path | None, Option(".png for a strip, .gif for a film", metavar="FILE", parse=picture(".png", ".gif"))
    ] = None,
    stride: Annotated[tuple[int, ...], Option("number in the replay", low=0, high=MOST)] = (),
    walk: Walk = 0,
    vertical: Vertical = None,
) -> int:
    path = out or _picture_path(files[0], "-strides.png")
    moving = path.suffix == ".gif"
    recorded = _walk_for_picture(files, walk, vertical, path)
    strides = _chosen_strides(files[0], stride, recorded, moving)
    recorded = with_strides(recorded, strides)
    if moving:
        from experiments.pictures.stride_film import draw_film

        with watched() as watch:
            draw_film(recorded, strides, path, partial(watch, "frames"))
    else:
        from experiments.pictures.stride_strip import draw_strip

        save_picture(partial(draw_strip, recorded, strides), path)
    names = [f"{each['index']} ({outcome_of(recorded, each)})" for each in strides]
    print(f"strides  {', '.join(names)}\nwritten  {path}")
    return exit_codes.OK


def _picture_path(log: Path, ending: str) -> Path:
    """Return the log's path with another ending, but not in active/, which the log leaves when it is finished."""
    name = log_name(log) + ending
    if log.absolute().parent.name != ACTIVE:
        return log.parent / name  # also of a folder that is given by mistake
    done = log.absolute().parent.parent / DONE
    return done / name if os.access(done, os.W_OK) else Path(name)


def _walk_for_picture(files: Sequence[Path], number: int, vertical: CaptureAxis | None, path: Path) -> RecordedWalk:
    """Read the walk and prints its limitations. Raises LogError, also for a picture that cannot be written."""
    with watched() as watch:
        walk = read_walk(files[0], number, files[1:], watch, chosen_vertical(vertical, files[0]))
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise LogError(f"{path} cannot be written; choose another path with --out")
    complain_of(files[0], walk.findings)
    if walk.walks > 1 and not number:
        complain(f"the last of {walk.walks} walks in this log; --walk N takes another")
    if walk.missing:
        complain(f"not in this log: {', '.join(walk.missing)}")
    if walk.cut:
        complain(f"the walk may have {walk.cut}; give those files too")
    complain_of_end(files, walk.complete)
    return walk


def _chosen_strides(file: Path, numbers: Sequence[int], walk: RecordedWalk, moving: bool) -> list[Stride]:
    """Return the requested strides, or all for a film, or the clearest of each kind. Raises LogError, CommandError."""
    by_number = {stride["index"]: stride for stride in walk.own_strides}
    if not by_number:
        raise LogError(f"{file}: no complete stride in this log")
    for number in numbers:
        if number not in by_number:
            raise usage_error(f"--stride {number}: this walk has {min(by_number)} to {max(by_number)}")
    if numbers:
        strides = [by_number[number] for number in numbers]
    else:
        strides = walk.own_strides if moving else choose_strides(walk)
    length_s = fsum(duration_s(walk, stride) for stride in strides)
    if moving and length_s > LONGEST_FILM_S:
        raise usage_error(f"{length_s:.0f} s of film are more than {LONGEST_FILM_S:.0f} s; choose with --stride")
    return strides


def info(files: Segments, *, vertical: Vertical = None) -> Answer:
    axis, path = chosen_vertical(vertical, files[0]), files[0]
    if len(files) == 1 and is_lab_csv(path):
        lab = read_lab_csv(path, axis)
        summary = lab_summary(path, lab)
        findings = lab.findings
    else:
        with watched() as watch:
            summary, findings = log_summary(scan_logs(files, watch)), ()
    complain_of(path, findings)
    text = table([(name, value_shown(value)) for name, value in summary.items() if name != "findings"])
    return Answer(summary, text, schema="log-info")
