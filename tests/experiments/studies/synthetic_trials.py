"""Trials whose measurements are made up by the test, in place of simulated walks."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from pandas import DataFrame

from experiments.study.trials import Trials


class SyntheticTrials(Trials):
    """Owns the rows that a study asked for; `measure` returns the measurements of each."""

    def __init__(self, measure: Callable[..., dict[str, Any]]) -> None:
        super().__init__(Path(), {}, lambda done, total: None)
        self.measure = measure
        self.rows: list[dict[str, Any]] = []

    def run(self, function: Callable[..., Any], rows: Any, **shared: Any) -> DataFrame:
        asked = [dict(row) for row in rows]
        self.rows += asked
        return DataFrame([row | self.measure(**row) for row in asked])
