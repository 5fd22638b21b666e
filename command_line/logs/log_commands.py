"""Commands that read logs: replay, plot, film, info."""

import argparse
import os
from functools import partial
from math import fsum, nan
from pathlib import Path

from command_line import exit_codes
from command_line.json_output import print_json
from command_line.logs.lab_findings import chosen_vertical, complain_of
from command_line.logs.refusals import UsageError, complain_of_end, explain_errors
from command_line.screen import STRIDE_HEAD, STRIDE_UNITS, Progress, complain, other_surface, stride_line, watched
from experiments.pictures.recorded_walk import RecordedWalk, read_walk
from experiments.pictures.stride_choice import Stride, choose_strides, duration_s, outcome_of, with_strides
from experiments.reports.shown_values import value_shown
from experiments.reports.style import save_picture
from experiments.reports.text_tables import table
from firmware_host.configuration.loading import load_configuration
from firmware_host.log.log_folder import ACTIVE, DONE
from firmware_host.operator.reports import known, map_report, stride_report
from logs.files.log_error import LogError
from logs.files.log_summary import log_summary
from logs.files.scanned_log import scan_logs
from logs.lab.lab_csv import is_lab_csv, read_lab_csv
from logs.lab.summary import finding_reports, lab_summary
from logs.replay import replay_files

Options = argparse.Namespace

LONGEST_FILM_S = 60.0


@explain_errors
def replay(options: Options) -> int:
    chosen_vertical(options)
    configuration = load_configuration(options.config) if options.config else None
    with watched() as watch:
        replayed = replay_files(options.files, configuration, options.method, watch, options.vertical)
    path = options.files[0]
    chosen_m = replayed.chosen_depths_m or [nan] * len(replayed.strides)
    strides = [
        stride_report(stride) | {"chosen_depth_m": known(depth_m)}
        for stride, depth_m in zip(replayed.strides, chosen_m, strict=True)
    ]
    if options.json:
        report = {"strides": strides, "map": map_report(replayed.map), "flippers": replayed.flippers}
        findings = finding_reports(path, replayed.findings)
        print_json("replay", report | {"complete": replayed.complete, "findings": findings})
        return exit_codes.OK
    complain_of(path, replayed.findings)
    print(f"{STRIDE_HEAD}  {'f_z in':>7} {'f_x':>6} {'f_z out':>7}\n{STRIDE_UNITS}  {'(N)':>7} {'(N)':>6} {'(N)':>7}")
    for report, stride in zip(strides, replayed.strides, strict=True):
        forces = f"{stride.insertion_force_n:7.1f} {stride.stance_force_n:6.1f} {stride.extraction_force_n:7.1f}"
        print(f"{stride_line(report, replayed.begin_s)}  {forces}{other_surface(report)}")
    if not strides:
        complain("no complete stride in this log")
    if replayed.segment:
        complain(
            f"the run's segments before {replayed.segment} are not given: "
            "the first strides can differ from those computed live"
        )
    complain_of_end(options.files, replayed.complete)
    return exit_codes.OK


@explain_errors
def plot(options: Options) -> int:
    path = options.out or _picture_path(options.files[0], ".png")
    walk = _walk_for_picture(options, path)
    if not walk.strides:
        complain("no complete stride in this log")
    from experiments.pictures.walk_plot import plot_walk  # matplotlib is slow to import

    plot_walk(walk, path)
    print(f"written  {path}")
    return exit_codes.OK


@explain_errors
def film(options: Options) -> int:
    path = options.out or _picture_path(options.files[0], "-strides.png")
    moving = path.suffix == ".gif"
    walk = _walk_for_picture(options, path)
    strides = _chosen_strides(options, walk, moving)
    walk = with_strides(walk, strides)
    if moving:
        from experiments.pictures.stride_film import draw_film

        progress = Progress("frames")
        try:
            draw_film(walk, strides, path, progress.show)
        finally:
            progress.clear()
    else:
        from experiments.pictures.stride_strip import draw_strip

        save_picture(partial(draw_strip, walk, strides), path)
    names = [f"{outcome_of(stride, walk.geometric_step_m)} {stride['index']}" for stride in strides]
    print(f"strides  {', '.join(names)}\nwritten  {path}")
    return exit_codes.OK


def _picture_path(log: Path, ending: str) -> Path:
    """Return the log's path with another ending, but not in active/, which the log leaves when it is finished."""
    name = log.name.removesuffix(".gz").removesuffix(".csv").removesuffix(".mcap") + ending
    if log.absolute().parent.name != ACTIVE:
        return log.with_name(name)
    done = log.absolute().parent.parent / DONE
    return done / name if os.access(done, os.W_OK) else Path(name)


def _walk_for_picture(options: Options, path: Path) -> RecordedWalk:
    """Read the walk and prints its limitations. Raises LogError, also for a picture that cannot be written."""
    with watched() as watch:
        walk = read_walk(options.files[0], options.walk, options.files[1:], watch, chosen_vertical(options))
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise LogError(f"{path} cannot be written; choose another path with --out")
    complain_of(options.files[0], walk.findings)
    if walk.walks > 1 and not options.walk:
        complain(f"the last of {walk.walks} walks in this log; --walk N takes another")
    if walk.missing:
        complain(f"not in this log: {', '.join(walk.missing)}")
    if walk.cut:
        complain(f"the walk may have {walk.cut}; give those files too")
    complain_of_end(options.files, walk.complete)
    return walk


def _chosen_strides(options: Options, walk: RecordedWalk, moving: bool) -> list[Stride]:
    """Return the requested strides, or all for a film, or the clearest of each kind. Raises LogError, UsageError."""
    by_number = {stride["index"]: stride for stride in walk.own_strides}
    if not by_number:
        raise LogError(f"{options.files[0]}: no complete stride in this log")
    for number in options.stride or ():
        if number not in by_number:
            raise UsageError(f"--stride {number}: this walk has {min(by_number)} to {max(by_number)}")
    if options.stride:
        strides = [by_number[number] for number in options.stride]
    else:
        strides = walk.own_strides if moving else choose_strides(walk)
    length_s = fsum(duration_s(walk, stride) for stride in strides)
    if moving and length_s > LONGEST_FILM_S:
        raise UsageError(f"{length_s:.0f} s of film are more than {LONGEST_FILM_S:.0f} s; choose with --stride")
    return strides


@explain_errors
def info(options: Options) -> int:
    vertical, path = chosen_vertical(options), options.files[0]
    if len(options.files) == 1 and is_lab_csv(path):
        lab = read_lab_csv(path, vertical)
        summary = lab_summary(path, lab)
        findings = lab.findings
    else:
        with watched() as watch:
            summary, findings = log_summary(scan_logs(options.files, watch)), ()
    if options.json:
        print_json("log-info", summary)
    else:
        print(table([(name, value_shown(value)) for name, value in summary.items() if name != "findings"]))
        complain_of(path, findings)
    return exit_codes.OK
