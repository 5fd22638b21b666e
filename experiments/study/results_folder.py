"""The folder of a study's results: a new one for each run, or a given one, where the study continues or begins again.

A study is finished where its page is written, the last of its files. Its summary says what computed it.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from experiments.study.notebook import NAME, NotebookError, count_entries
from experiments.study.provenance import program_text
from experiments.study.session import Ending

PAGE, SUMMARY, RESULTS = "report.html", "summary.json", "results.parquet"


class ResultFiles(NamedTuple):
    """The names of the page and of the numbers of a study."""

    page: str = PAGE
    summary: str = SUMMARY


USUAL = ResultFiles()


def make_folder(name: str) -> Path:
    """Make a folder, with a number after its name where that exists, and return it. Raises OSError."""
    for folder in _numbered(Path(name)):
        with suppress(FileExistsError):
            folder.mkdir()
            return folder
    raise AssertionError("numbers do not end")


def set_aside(folder: Path) -> Path | None:
    """Rename a folder with results; return its new path, or None where it has none. Raises OSError."""
    if not (count_entries(folder) or (folder / SUMMARY).exists()):
        return None
    return folder.rename(next(each for each in _numbered(folder.with_name(f"{folder.name}-old")) if not each.exists()))


def _numbered(path: Path) -> Iterator[Path]:
    return (path.with_name(path.name + (f"-{number}" if number > 1 else "")) for number in count(1))


def require_unfinished(folder: Path, experiment: str, options: Mapping[str, Any], files: ResultFiles = USUAL) -> None:
    """Raises NotebookError for results of another experiment, and for a finished one.

    One that was finished with other options, such as fewer trials, may continue: its notebook decides. So may one whose
    changes were not written to the configuration.
    """
    summary: dict[str, Any] = {}
    with suppress(OSError, ValueError):
        summary = dict(json.loads((folder / files.summary).read_bytes()))
    earlier = summary.get("experiment", experiment)
    if earlier != experiment:
        raise NotebookError(f"{folder} has the results of experiment {earlier}: choose another folder with --out")
    record = summary.get("provenance", {})
    is_whole = (folder / files.page).exists() and record.get("ending") != Ending.REFUSED.name.lower()
    if is_whole and options == record.get("options", options):
        raise NotebookError(
            f"{folder} has a finished experiment {experiment}, of {record.get('date', 'an unknown date')} by "
            f"{program_text(record)}: choose another folder with --out, or begin again with --restart, which renames "
            "this folder"
        )


def remove_unused(folder: Path) -> None:
    """Remove a new folder in which nothing was measured. Logs stay, and so does their folder."""
    if not (count_entries(folder) or (folder / SUMMARY).exists()):
        with suppress(OSError):
            for notebook in [*folder.rglob(NAME)]:  # a calibration of actuators has one for each joint
                notebook.unlink()
                if notebook.parent != folder:
                    notebook.parent.rmdir()
            folder.rmdir()
