"""Commands that look after the folder of the logs: list, recover, preserve."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader

from command_line import exit_codes
from command_line.json_output import print_json
from command_line.screen import QUIET_S, Progress, complain, size_text
from experiments.reports.text_tables import number, table
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.log.log_folder import (
    BROKEN,
    DONE,
    ENDING,
    PART,
    PRESERVED,
    disk_bytes,
    free_space,
    log_files,
    preserve,
    stored_files,
    unfinished_files,
    why_not_moved,
)
from firmware_host.log_reading.log_reader import DAMAGE, LogError
from firmware_host.log_reading.recovery import Recovered, recover_log

Options = argparse.Namespace

LEGEND = (
    "unfinished: still being written, or cut off; broken: damaged, or left by a recovery that did not end.\n"
    "'mudskipper log recover' puts in order what it can; remove what resists it, and what is no log"
)


def list_logs(options: Options) -> int:
    folder = options.folder or _configured_folder(options.config)
    if folder is None:
        return exit_codes.CONFIGURATION
    if not folder.is_dir():
        complain(f"{folder}: there is no such folder")
        return exit_codes.UNHEALTHY
    logs = [describe(path) for path in [*stored_files(folder), *log_files(folder, PRESERVED)]]
    space = free_space(folder)
    report = {
        "folder": str(folder),
        "logs": logs,
        "logs_bytes": sum(log["bytes"] for log in logs),
        "disk_bytes": disk_bytes(folder),
        "free_bytes": space.free_bytes,
    }
    if options.json:
        print_json("log-list", report)
    else:
        print(_listing(report))
    return exit_codes.OK


def _configured_folder(path: Path) -> Path | None:
    try:
        return Path(load_configuration(path).log.directory)
    except ConfigurationError as problem:
        complain(*problem.problems)
        return None


def describe(path: Path) -> dict[str, Any]:
    """Describes a log by the summary at the file's end, without reading its rows."""
    metadata, duration_s = _summary_of(path)
    return {
        "name": path.name,
        "place": path.parent.name,
        "state": _state_of(path, duration_s is not None),
        "bytes": path.stat().st_size if path.exists() else 0,
        "duration_s": duration_s,
        "preserved": path.parent.name == PRESERVED,
        "recovered": metadata.get("recovered") == "true",
    }


def _state_of(path: Path, has_summary: bool) -> str:
    if has_summary:
        return "whole"
    if path.name.endswith(BROKEN) or path.parent.name in (DONE, PRESERVED):
        return "broken"
    return "unfinished" if path.name.endswith((ENDING, PART)) else "no log"


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
    rows, odd = [["log", "place", "size (MB)", "length (s)", ""]], False
    for log in report["logs"]:
        odd = odd or log["state"] != "whole"
        marks = "recovered" if log["recovered"] else log["state"].removeprefix("whole")
        size = f"{log['bytes'] / 1e6:.1f}"
        rows.append([log["name"], log["place"], size, number(log["duration_s"], 1), marks])
    sizes = [size_text(report[name]) for name in ("logs_bytes", "free_bytes", "disk_bytes")]
    total = f"{sizes[0]} of logs, {sizes[1]} free of {sizes[2]}"
    return "\n".join([table(rows), *[LEGEND] * odd, total])


def recover(options: Options) -> int:
    places = options.places or [_configured_folder(options.config)]
    if None in places:
        return exit_codes.CONFIGURATION
    named = {place for place in places if not place.is_dir()}
    paths = [path for place in places for path in ([place] if place in named else unfinished_files(place))]
    recovered, resisted = _recover_each(paths, named)
    if options.json:
        logs = [{"path": str(log.path), "rows": log.rows, "lost": log.lost, "note": log.note} for log in recovered]
        print_json("log-recover", {"recovered": logs, "problems": resisted})
    else:
        for log in recovered:
            print(f"{log.path}: {log.note}")
        if not recovered and not resisted:
            print("nothing to recover")
    complain(*resisted)
    return exit_codes.UNHEALTHY if resisted else exit_codes.OK


def _recover_each(paths: list[Path], named: set[Path]) -> tuple[list[Recovered], list[str]]:
    """Skips the files of living writers, unless the operator named them."""
    recovered, resisted = [], []
    progress = Progress("", QUIET_S)
    for done, path in enumerate(paths):
        progress.follow("logs", done, len(paths))
        try:
            recovered.append(recover_log(path, progress.follow))
        except LogError as problem:
            resisted.append(str(problem))
        except BlockingIOError:
            if path in named:
                resisted.append(f"{path}: is being written; its writer will finish it")
        except OSError as problem:
            resisted.append(why_not_moved(path, problem))
    progress.clear()
    return recovered, resisted


def preserve_log(options: Options) -> int:
    """Each that can be, whatever becomes of the others."""
    status = exit_codes.OK
    for path in options.files:
        try:
            print(preserve(path, options.undo))
        except ValueError as problem:
            complain(str(problem))
            status = exit_codes.REFUSED
        except OSError as problem:
            complain(why_not_moved(path, problem))
            status = exit_codes.UNHEALTHY
    return status
