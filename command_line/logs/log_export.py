"""`mudskipper log export`: writes a log in a form that other programs read."""

import argparse
import os
import sys
from pathlib import Path

from command_line import exit_codes
from command_line.logs.refusals import UsageError, complain_of_end, explain_errors
from command_line.screen import watched
from logs.files.log_error import LogError
from logs.files.scanned_log import ScannedLog, scan_logs
from logs.files.whole_files import whole_file
from logs.lab.export import write_lab_csv

Options = argparse.Namespace


@explain_errors
def export(options: Options) -> int:
    _require_other_file(options)
    with watched() as watch:
        log = scan_logs(options.files, watch)
    write = _write_parquet if options.parquet else _write_csv
    for path in write(log, options):
        print(f"written  {path}", file=sys.stderr)
    complain_of_end(options.files, log.complete)
    return exit_codes.OK


def _require_other_file(options: Options) -> None:
    """Raises UsageError."""
    out: Path | None = options.out
    if out is not None and out.is_file() and any(out.samefile(path) for path in options.files if path.exists()):
        raise UsageError(f"{out} is the log itself; name another file")


def _stem(options: Options) -> str:
    return str(options.files[0].name).removesuffix(".mcap")


def _write_csv(log: ScannedLog, options: Options) -> list[Path]:
    if options.out is None:
        write_lab_csv(log, sys.stdout).raise_cut()
        return []
    path = Path(options.out)
    try:
        with whole_file(path) as hidden, hidden.open("w", encoding="utf-8") as out, watched() as watch:
            rows = write_lab_csv(log, out, watch)
    except OSError as problem:
        raise _not_written(path, problem) from None
    rows.raise_cut()
    return [path]


def _not_written(path: Path, problem: OSError) -> LogError:
    """Return the message for a file or folder that stays as it was; pyarrow's own text names no file."""
    reason = os.strerror(problem.errno) if problem.errno else str(problem)
    return LogError(f"{path}: nothing was written: {reason}")


def _write_parquet(log: ScannedLog, options: Options) -> list[Path]:
    """The present folder is the default: the user may not be permitted to write into the log folder."""
    from logs.parquet import write_parquet  # pyarrow is slow to import, and an extra

    folder: Path = options.out or Path()
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: --parquet writes three files; name a folder")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with watched() as watch:
            return write_parquet(log, folder, _stem(options), watch)
    except OSError as problem:
        raise _not_written(folder, problem) from None
