"""The result of a study: tables and figures, which are rendered once as screen text, as a page and as JSON."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from experiments.reports.text_tables import table as aligned
from experiments.reports.text_tables import value_shown
from experiments.study.results_folder import USUAL, ResultFiles
from experiments.study.session import Ending

Rows = list[list[str]]  # the head first


@dataclass(frozen=True)
class Table:
    """The rows of a data frame. Numbers are formatted with four digits; a cell that is text is shown as it is."""

    name: str  # its key in JSON
    title: str
    units: Mapping[str, str]  # by column
    rows: DataFrame
    section: str = "Result"  # heading of its part of the page
    on_page_only: bool = False

    def cells(self) -> Rows:
        """Return the text of all cells, the head first."""
        head = [f"{name} ({self.units[name]})" if name in self.units else str(name) for name in self.rows.columns]
        return [head, *([_cell(value) for value in row] for row in self.rows.itertuples(index=False, name=None))]

    def text(self) -> str:
        """Return the table for a screen, below its title."""
        return f"{self.title}\n{aligned(self.cells())}".lstrip("\n")


@dataclass(frozen=True)
class Figure:
    """A picture, which is drawn in the one style of all studies (page.py)."""

    name: str  # of its files, without the ending
    caption: str
    draw: Callable[[], Drawing]
    section: str = "Result"


@dataclass(frozen=True)
class Result:
    """What a study found. Without a `summary` its JSON has the rows of the tables."""

    tables: Sequence[Table] = ()
    figures: Sequence[Figure] = ()
    summary: Any = None  # a mapping, or a record that `to_json` accepts
    title: str = ""  # of the page
    texts: Mapping[str, str] = field(default_factory=dict)  # paragraphs of the page, by section
    notes: Sequence[str] = ()  # sentences below the tables
    logs: Sequence[Path] = ()
    ending: Ending = Ending.DONE
    files: ResultFiles = USUAL

    def text(self) -> str:
        """Return all tables and notes for a screen."""
        return "\n\n".join([*(table.text() for table in self.tables if not table.on_page_only), *self.notes])

    def json(self) -> dict[str, Any]:
        """Return the summary as JSON has it."""
        if self.summary is not None:
            return dict(to_json(self.summary))
        return {table.name: to_json(table.rows.to_dict("records")) for table in self.tables}


def _cell(value: Any) -> str:
    return "-" if isinstance(value, float) and not isfinite(value) else value_shown(to_json(value))


def to_json(value: Any) -> Any:
    """Turn records into mappings by field name, numbers of numpy into plain ones, and NaN into None."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {each.name: getattr(value, each.name) for each in fields(value)}
    elif isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {key: to_json(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(each) for each in value]
    if hasattr(value, "tolist"):  # of numpy
        return to_json(value.tolist())
    return None if isinstance(value, float) and not isfinite(value) else value
