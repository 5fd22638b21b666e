"""`mudskipper log export`: writes a log in a form that other programs read."""

import os
import sys
from pathlib import Path
from typing import Annotated

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.logs.complaints import complain_of_end
from command_line.logs.log_options import Segments
from command_line.screen import watched
from experiments.study.option import Option
from logs.files.log_error import LogError
from logs.files.scanned_log import ScannedLog, scan_logs
from logs.files.whole_files import whole_file
from logs.lab.export import write_lab_csv


def export(
    files: Segments,
    *,
    csv: Annotated[bool, Option("the columns of the authors' plotter, to standard output", alternative="form")] = False,
    parquet: Annotated[
        bool, Option("tables of ticks, strides and events, into this folder", alternative="form")
    ] = False,
    out: Annotated[Path | None, Option("write this file, for --parquet into this folder", metavar="PATH")] = None,
) -> int:
    if not (csv or parquet):
        raise usage_error("one of --csv and --parquet is required")
    if out is not None and out.is_file() and any(out.samefile(path) for path in files if path.exists()):
        raise usage_error(f"{out} is the log itself; name another file")
    with watched() as watch:
        log = scan_logs(files, watch)
    written = _write_parquet(log, files[0], out or Path()) if parquet else _write_csv(log, out)
    for path in written:
        print(f"written  {path}", file=sys.stderr)
    complain_of_end(files, log.complete)
    return exit_codes.OK


def _write_csv(log: ScannedLog, path: Path | None) -> list[Path]:
    if path is None:
        write_lab_csv(log, sys.stdout)
        return []
    try:
        with whole_file(path) as hidden, hidden.open("w", encoding="utf-8") as out, watched() as watch:
            write_lab_csv(log, out, watch)
    except OSError as problem:
        raise _not_written(path, problem) from None
    return [path]


def _not_written(path: Path, problem: OSError) -> LogError:
    """Return the message for a file or folder that stays as it was; pyarrow's own text names no file."""
    reason = os.strerror(problem.errno) if problem.errno else str(problem)
    return LogError(f"{path}: nothing was written: {reason}")


def _write_parquet(log: ScannedLog, file: Path, folder: Path) -> list[Path]:
    """The present folder is the default: the user may not be permitted to write into the log folder."""
    from logs.parquet import write_parquet  # pyarrow is slow to import, and an extra

    if folder.exists() and not folder.is_dir():
        raise usage_error(f"{folder}: --parquet writes three files; name a folder")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with watched() as watch:
            return write_parquet(log, folder, file.name.removesuffix(".mcap"), watch)
    except OSError as problem:
        raise _not_written(folder, problem) from None
