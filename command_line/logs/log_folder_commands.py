"""Commands on the log folder: list, recover, preserve."""

from pathlib import Path
from shutil import disk_usage
from typing import Annotated, Any

from mcap.exceptions import McapError
from mcap.reader import make_reader

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.logs.catalogue_commands import catalogued, chosen_folder, configured_folder
from command_line.logs.log_options import Folder
from command_line.operation.trial import KeyValues, trial_text
from command_line.robot_options import RobotConfiguration
from command_line.screen import complain, watched
from experiments.reports.text_tables import number, table
from experiments.study.option import Option
from firmware_host.log.log_folder import (
    BROKEN,
    DONE,
    ENDING,
    PART,
    PRESERVED,
    age_of,
    free_space,
    log_files,
    stored_files,
    unfinished_files,
)
from logs.annotation import annotate
from logs.catalogue.entry import LogEntry
from logs.files.log_error import DAMAGE, LogError
from logs.files.stored_logs import is_being_written, preserve, size_text, why_not_moved

BEING_WRITTEN = "being written"
SOUND = ("whole", "export", "copy", BEING_WRITTEN)

LEGEND = (
    "unfinished: cut off; broken: damaged, or left by a recovery that did not end.\n"
    "'mudskipper log recover' repairs what it can in active/, and 'log recover FILE' a broken one anywhere; remove "
    "files that it cannot repair, and those that are no logs"
)


def list_logs(folder: Folder = None, *, config: RobotConfiguration) -> Answer:
    folder = chosen_folder(folder, config)
    entries = catalogued(folder)
    paths = {*stored_files(folder), *log_files(folder, PRESERVED), *entries}
    logs = [describe(path, entries.get(path)) for path in sorted(paths, key=age_of)]
    space = free_space(folder)
    report = {
        "folder": str(folder),
        "logs": logs,
        "logs_bytes": sum(log["bytes"] for log in logs),
        "disk_bytes": disk_usage(folder).total,
        "free_bytes": space.free_bytes,
    }
    return Answer(report, _listing(report), schema="log-list")


def describe(path: Path, entry: LogEntry | None) -> dict[str, Any]:
    """Describe a log by its entry in the catalogue, or else by the summary at the file's end."""
    known = _described(entry) if entry else _summarised(path)
    return {"name": path.name, "place": path.parent.name, "preserved": path.parent.name == PRESERVED} | known


def _described(entry: LogEntry) -> dict[str, Any]:
    names = (
        "state", "reason", "bytes", "duration_s", "recovered",
        "robot", "started", "strides", "distance_m", "speed_m_s", "faults",
    )  # fmt: skip
    known = {name: getattr(entry, name) for name in names}
    return known | {"started": entry.started and f"{entry.started.isoformat()}+00:00", "faults": list(entry.faults)}


def _summarised(path: Path) -> dict[str, Any]:
    metadata, duration_s = _summary_of(path)
    return {
        "state": _state_of(path, duration_s is not None),
        "bytes": path.stat().st_size if path.exists() else 0,
        "duration_s": duration_s,
        "recovered": metadata.get("recovered") == "true",
    }


def _state_of(path: Path, has_summary: bool) -> str:
    if has_summary:
        return "whole"
    if is_being_written(path):
        return BEING_WRITTEN
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
    rows = [["log", "folder", "size (MB)", "length (s)", "strides", "speed (cm/s)", ""]]
    rows += [_listed(log) for log in report["logs"]]
    sizes = [size_text(report[name]) for name in ("logs_bytes", "free_bytes", "disk_bytes")]
    total = f"{sizes[0]} of logs, {sizes[1]} free of {sizes[2]}"
    unsound = any(log["state"] not in SOUND for log in report["logs"])
    return "\n".join([table(rows), *[LEGEND] * unsound, total])


def _listed(log: dict[str, Any]) -> list[str]:
    marks = ["recovered"] * log["recovered"] or [log["state"]] * (log["state"] != "whole")
    marks += [*filter(None, [log.get("reason")]), *log.get("faults", [])]
    strides, speed_m_s = log.get("strides"), log.get("speed_m_s")
    speed = number(None if speed_m_s is None else 100.0 * speed_m_s, 1)
    size = f"{log['bytes'] / 1e6:.1f}"
    return [log["name"], log["place"], size, number(log["duration_s"], 1), number(strides, 0), speed, ", ".join(marks)]


def recover(
    places: Annotated[tuple[Path, ...], Option("(default: the configured folder)", metavar="FILE|DIR")] = (),
    *,
    config: RobotConfiguration,
) -> Answer:
    given = places or (configured_folder(config),)
    named = {path for path in given if not path.is_dir()}
    paths = [path for each in given for path in ([each] if each in named else unfinished_files(each))]
    recovered, problems = _recover_each(paths, named)
    logs = [{"path": str(log.path), "rows": log.rows, "lost": log.lost, "note": log.note} for log in recovered]
    lines = [f"{log.path}: {log.note}" for log in recovered]
    complain(*problems)
    return Answer(
        {"recovered": logs, "problems": problems},
        "\n".join(lines or ["nothing was recovered" if problems else "nothing to recover"]),
        exit_codes.UNHEALTHY if problems else exit_codes.OK,
        "log-recover",
    )


def _recover_each(paths: list[Path], named: set[Path]) -> tuple[list[Any], list[str]]:
    """Recover the logs and return messages about the others. Skips unnamed files that are being written, or gone."""
    from logs.recovery import recover_log  # slow to import, and a listing does without it

    recovered, problems = [], []
    with watched() as watch:
        for done, path in enumerate(paths):
            watch("logs", done, len(paths))
            try:
                recovered.append(recover_log(path, watch))
            except LogError as problem:
                problems.append(str(problem))
            except BlockingIOError:
                if path in named:
                    problems.append(f"{path}: is being written; its writer will finish it")
            except OSError as problem:
                if path in named or path.exists():
                    problems.append(why_not_moved(path, problem))
    return recovered, problems


def annotate_log(file: Annotated[Path, Option("log of this project")], values: KeyValues) -> Answer:
    """Add the description to the log itself; its rows stay as they are."""
    try:
        trial = annotate(file, dict(values))
    except OSError as problem:
        raise LogError(why_not_moved(file, problem)) from None
    except LogError:
        raise
    except ValueError as problem:
        raise usage_error(str(problem)) from None
    return Answer({"log": str(file), "trial": trial}, trial_text({"": trial}), schema="log-annotate")


def preserve_log(
    files: Annotated[tuple[Path, ...], Option("log in done/ of a folder of logs")],
    *,
    undo: Annotated[bool, Option("include them again")] = False,
) -> int:
    """Preserve each log that can be moved, and reports the others."""
    status = exit_codes.OK
    for path in files:
        try:
            print(preserve(path, undo))
        except ValueError as problem:
            complain(str(problem))
            status = exit_codes.REFUSED
        except OSError as problem:
            complain(why_not_moved(path, problem))
            status = exit_codes.UNHEALTHY
    return status
