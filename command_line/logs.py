"""Commands that read logs: replay, info, export."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from command_line import exit_codes
from command_line.screen import STRIDE_HEAD, STRIDE_UNITS, complain, stride_line
from firmware_host.configuration import ConfigurationError, load_configuration
from firmware_host.lab_csv import write_lab_csv
from firmware_host.log_reader import LogError, log_summary, read_log
from firmware_host.replay import Replay, replay_file
from firmware_host.reports import map_report, stride_report

Options = argparse.Namespace


def replay(options: Options) -> int:
    try:
        configuration = load_configuration(options.config) if options.config else None
        replayed = replay_file(options.file, configuration, options.method)
    except ConfigurationError as problem:
        for sentence in problem.problems:
            complain(sentence)
        return exit_codes.CONFIGURATION
    except LogError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    _show_replay(replayed, options.json)
    return exit_codes.OK


def _show_replay(replayed: Replay, as_json: bool) -> None:
    strides = [stride_report(stride) for stride in replayed.strides]
    if as_json:
        report = {"strides": strides, "map": map_report(replayed.map), "flippers": replayed.flippers}
        print(json.dumps(report | {"complete": replayed.complete}))
        return
    print(f"{STRIDE_HEAD}  {'f_z in':>7} {'f_x':>6} {'f_z out':>7}\n{STRIDE_UNITS}  {'N':>7} {'N':>6} {'N':>7}")
    for report, stride in zip(strides, replayed.strides, strict=True):
        forces = f"{stride.insertion_force_n:7.1f} {stride.stance_force_n:6.1f} {stride.extraction_force_n:7.1f}"
        print(f"{stride_line(report)}  {forces}")
    if not strides:
        complain("no complete stride in this log")
    if not replayed.complete:
        complain("the log is not finished: its writer was cut off; everything up to there was read")


def info(options: Options) -> int:
    try:
        summary = log_summary(read_log(options.file))
    except LogError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    if options.json:
        print(json.dumps(summary))
    else:
        for name, value in summary.items():
            print(f"{name:16} {value}")
    return exit_codes.OK


def export(options: Options) -> int:
    try:
        log = read_log(options.file)
    except LogError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    if options.out is None:
        write_lab_csv(log, sys.stdout)
        return exit_codes.OK
    if options.out.exists() and options.out.samefile(options.file):
        complain(f"{options.out} is the log itself; name another file")
        return exit_codes.USAGE
    with Path(options.out).open("w", encoding="utf-8") as out:
        write_lab_csv(log, out)
    return exit_codes.OK
