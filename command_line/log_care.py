"""Commands that look after the folder of the logs: list, recover, preserve."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader

from command_line import exit_codes
from command_line.screen import Progress, complain, number, table
from firmware_host.configuration import ConfigurationError, load_configuration
from firmware_host.log_folder import ACTIVE, DONE, KEPT, disk_bytes, free_space, log_files, preserve, unfinished_files
from firmware_host.log_reader import DAMAGE, LogError
from firmware_host.log_recovery import Recovered, recover_log

Options = argparse.Namespace

PATIENCE_S = 2.0  # before progress is shown


def list_logs(options: Options) -> int:
    folder = options.folder or _configured_folder(options.config)
    if folder is None:
        return exit_codes.CONFIGURATION
    if not folder.is_dir():
        complain(f"{folder}: there is no such folder")
        return exit_codes.UNHEALTHY
    logs = [describe(path) for path in log_files(folder, ACTIVE, DONE, KEPT)]
    space = free_space(folder)
    report = {
        "folder": str(folder),
        "logs": logs,
        "logs_bytes": sum(log["bytes"] for log in logs),
        "disk_bytes": disk_bytes(folder),
        "free_bytes": space.free_bytes,
    }
    print(json.dumps(report) if options.json else _listing(report))
    return exit_codes.OK


def _configured_folder(path: Path) -> Path | None:
    try:
        return Path(load_configuration(path).log.directory)
    except ConfigurationError as problem:
        for sentence in problem.problems:
            complain(sentence)
        return None


def describe(path: Path) -> dict[str, Any]:
    """Of the summary at the file's end, without reading its rows; nothing is known of a file without one."""
    metadata, duration_s = _summary_of(path)
    return {
        "name": path.name,
        "place": path.parent.name,
        "bytes": path.stat().st_size if path.exists() else 0,
        "duration_s": duration_s,
        "preserved": path.parent.name == KEPT,
        "recovered": metadata.get("recovered") == "true",
    }


def _summary_of(path: Path) -> tuple[dict[str, str], float | None]:
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                return {}, None
            times_ns = summary.statistics.message_start_time, summary.statistics.message_end_time
            metadata = next((record.metadata for record in reader.iter_metadata()), {})
            return metadata, (times_ns[1] - times_ns[0]) / 1e9
    except (*DAMAGE, McapError, OSError):
        return {}, None


def _listing(report: dict[str, Any]) -> str:
    rows = [["log", "place", "MB", "s", ""]]
    for log in report["logs"]:
        marks = "recovered" if log["recovered"] else ""
        size = f"{log['bytes'] / 1e6:.1f}"
        rows.append([log["name"], log["place"], size, number(log["duration_s"], 1), marks])
    total = f"{report['logs_bytes'] / 1e6:.1f} MB of logs, {report['free_bytes'] / 1e9:.1f} GB free"
    return f"{table(rows)}\n{total} of {report['disk_bytes'] / 1e9:.1f}"


def recover(options: Options) -> int:
    places = options.places or [_configured_folder(options.config)]
    if None in places:
        return exit_codes.CONFIGURATION
    paths = [path for place in places for path in (unfinished_files(place) if place.is_dir() else [place])]
    recovered, resisted = _recover_each(paths)
    if options.json:
        logs = [{"path": str(log.path), "rows": log.rows, "lost": log.lost, "note": log.note} for log in recovered]
        print(json.dumps({"recovered": logs, "problems": resisted}))
    else:
        for log in recovered:
            print(f"{log.path}: {log.note}")
        if not paths:
            print("nothing to recover")
    for sentence in resisted:
        complain(sentence)
    return exit_codes.UNHEALTHY if resisted else exit_codes.OK


def _recover_each(paths: list[Path]) -> tuple[list[Recovered], list[str]]:
    recovered, resisted = [], []
    progress, started_s = Progress("logs"), time.monotonic()
    for done, path in enumerate(paths):
        if time.monotonic() - started_s > PATIENCE_S:
            progress.show(done, len(paths))
        try:
            recovered.append(recover_log(path))
        except LogError as problem:
            resisted.append(str(problem))
        except BlockingIOError:
            resisted.append(f"{path}: is being written; its writer will finish it")
        except OSError as problem:
            resisted.append(f"{path}: {problem.strerror or problem}")
    progress.clear()
    return recovered, resisted


def preserve_log(options: Options) -> int:
    try:
        print(preserve(options.file, options.undo))
    except ValueError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    return exit_codes.OK
