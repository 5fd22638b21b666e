"""Runs the rows of a study: every row is parameters for one function, which returns measurements.

A row's measurements are in the folder's notebook as soon as it ends, so the same command continues an interrupted
study, and a finished one with further rows. A row is known by its function and its parameters.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pandas import DataFrame

from experiments.study.notebook import Entry, Notebook
from experiments.study.session import Show
from experiments.study.workers import Result, Workers, run_locally, run_parallel

Row = Mapping[str, Any]


class Trials:
    """The rows of one study, its folder, and what runs them."""

    def __init__(self, folder: Path, plan: Mapping[str, Any], show: Show, workers: Workers = run_locally) -> None:
        """`plan` has what must be the same when the study continues."""
        self.folder = folder  # exists
        self.measured: list[DataFrame] = []  # of each call of `run`, also of one that was interrupted
        self._plan, self._show, self._workers = dict(plan), show, workers
        self._notebook: Notebook | None = None
        self._ended = 0  # rows of earlier calls

    def require_same(self, **values: Any) -> None:
        """Refuse to continue a folder in which these were different, such as a file that was read.

        It must be called before the first row is run.
        """
        self._plan |= values

    def run(self, function: Callable[..., Entry], rows: DataFrame | Iterable[Row], **shared: Any) -> DataFrame:
        """Call `function(**row, **shared)` for each row; return parameters and measurements in the order of the rows.

        A row that is given again, as by a repeated option, counts once. The function must belong to a module, and what
        it returns must be a mapping that JSON can hold. `shared` is no part of what a row is known by. Raises
        NotebookError, WorkersError, OSError.
        """
        ordered = rows.to_dict("records") if isinstance(rows, DataFrame) else [dict(row) for row in rows]
        by_key = {f"{function.__name__} {json.dumps(row, default=str)}": row for row in ordered}
        self._notebook = notebook = self._notebook or Notebook(self.folder, self._plan)
        left = {key: row for key, row in by_key.items() if key not in notebook.entries}
        names = list(left)
        before = self._ended + len(by_key) - len(left)
        try:
            run_parallel(
                [partial(function, **row, **shared) for row in left.values()],
                lambda done, total: self._show(before + done, before + total),
                self._workers,
                keep=lambda index, entry: notebook.write(names[index], entry),
            )
        finally:
            ended = [row | notebook.entries[key] for key, row in by_key.items() if key in notebook.entries]
            self.measured.append(DataFrame(ended))
        self._ended += len(by_key)
        return self.measured[-1]

    def compute(self, calls: Sequence[Callable[[], Result]]) -> list[Result]:
        """Return the result of each call, which need not be JSON and is not kept for a continued study."""
        return run_parallel(calls, self._show, self._workers)
