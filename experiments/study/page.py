"""Writes the results of a study into its folder: a page, its pictures, its numbers.

The page is plain HTML with the pictures inside, so it can be sent as one file and printed in black and white. Every
picture is also there in SVG, PDF and PNG, and all have one style.
"""

import base64
import gc
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import rc_context

from experiments.reports.style import STYLE
from experiments.study.result import Figure, Result, Rows, Table, to_json
from experiments.study.results_folder import RESULTS
from firmware_host.software_version import software_version
from logs.files.whole_files import whole_file

ENDINGS = (".png", ".svg", ".pdf")
PAGE_STYLE = """\
body { font: 15px/1.5 Georgia, serif; max-width: 66em; margin: 2em auto; padding: 0 1.5em; color: #111 }
h1, h2, table, footer { font-family: Helvetica, Arial, sans-serif }
h1 { font-size: 1.6em; margin-bottom: 0 } h2 { font-size: 1.15em; margin-top: 2em }
p { max-width: 46em } .table { overflow-x: auto; margin: 1em 0 }
table { border-collapse: collapse; font-size: 0.8em; font-variant-numeric: tabular-nums }
table { border-bottom: 1.5px solid #111 } tr + tr td { border-top: 1px solid #ddd }
caption { text-align: left; font-weight: bold; padding-bottom: 0.3em }
th { text-align: left; border-top: 1.5px solid #111; border-bottom: 1px solid #111 }
th, td { padding: 0.25em 1.2em 0.25em 0; vertical-align: top; white-space: nowrap } th, td.long { white-space: normal }
th { vertical-align: bottom } .number { text-align: right }
thead { display: table-header-group } tr { break-inside: avoid }
figure { margin: 1em 0; break-inside: avoid; overflow-x: auto } img { max-width: 100% }
figcaption, footer, .when { color: #444; font-size: 0.9em } footer { margin-top: 3em; border-top: 1px solid #ccc }
@media screen and (max-width: 44em) { body { padding: 0 1em } img { max-width: none; width: 44em } }
@page { size: A4; margin: 15mm }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 10.5px } h2, caption { break-after: avoid }
  .table { overflow: visible } th, td { padding-right: 0.8em } img { max-height: 240mm } }
"""
LONG = 32  # letters of a cell from which it may be broken into lines
NUMBER = re.compile(r"[+-]?\d+(\.\d+)?( %)?|-")
Watch = Callable[[str, int, int], None]


def write_result(
    folder: Path,
    result: Result,
    summary: Mapping[str, Any],
    measured: Sequence[pd.DataFrame] = (),
    watch: Watch = lambda what, done, total: None,
) -> list[Path]:
    """Write everything and return the paths; the page is the last, so a folder with a page is whole. Raises OSError.

    `measured` are the rows of the study with their measurements.
    """
    folder.mkdir(parents=True, exist_ok=True)
    page, numbers = folder / result.files.page, folder / result.files.summary
    written = [numbers]
    _write(numbers, json_pieces(summary))
    if measured:
        with whole_file(folder / RESULTS) as hidden:
            _flat(pd.concat(measured, ignore_index=True)).to_parquet(hidden)
        written.append(folder / RESULTS)
    for done, figure in enumerate(result.figures):
        watch("pictures drawn", done, len(result.figures))
        written += _draw(figure, folder)
        gc.collect()  # the parts of a picture refer to each other: the next one shall not stand next to them in memory
    _write(page, (f"{line}\n" for line in _page(folder, result)))
    return [page, *written, *result.logs]


def _write(path: Path, pieces: Iterable[str]) -> None:
    with whole_file(path) as hidden, hidden.open("w", encoding="utf-8", errors="replace") as file:
        file.writelines(pieces)  # file names may be any bytes


def _flat(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with lists, mappings and columns of several types as JSON."""
    mixed = [name for name in rows.columns if len({type(value) for value in rows[name].dropna()}) > 1]
    nested = [name for name in rows.columns if any(isinstance(value, list | tuple | dict) for value in rows[name])]
    return rows.assign(**{name: rows[name].map(lambda value: json.dumps(to_json(value))) for name in {*mixed, *nested}})


def json_pieces(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield a summary as JSON and a line end. Lists, which may be long, are encoded by the entry."""
    before = "{\n "
    for key, value in summary.items():
        yield f"{before}{json.dumps(str(key))}: "
        if isinstance(value, list | tuple) and value and not hasattr(value, "_asdict"):
            yield f"[\n  {_encoded(value[0], 2)}"
            yield from (f",\n  {_encoded(each, 2)}" for each in value[1:])
            yield "\n ]"
        else:
            yield _encoded(value, 1)
        before = ",\n "
    yield "\n}\n"


def _encoded(value: Any, level: int) -> str:
    return json.dumps(to_json(value), indent=1, allow_nan=False).replace("\n", "\n" + " " * level)


def _draw(figure: Figure, folder: Path) -> list[Path]:
    """Draw a picture once, and save it in every form."""
    paths = [folder / f"{figure.name}{ending}" for ending in ENDINGS]
    with rc_context(STYLE):
        drawing = figure.draw()
        for path in paths:
            with whole_file(path) as hidden:
                drawing.savefig(hidden)
            with rc_context({"figure.constrained_layout.use": False}):
                drawing.set_layout_engine()  # none: its parts stay where they are, and no draw has to find them
    return paths


def _page(folder: Path, result: Result) -> Iterator[str]:
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    title, version = escape(result.title), escape(software_version())
    yield f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
    yield '<meta name="viewport" content="width=device-width">'
    yield f"<style>\n{PAGE_STYLE}</style></head><body>\n<h1>{title}</h1>"
    yield f'<p class="when">{made}, mudskipper {version}</p>'
    parts: list[Table | Figure] = [*result.tables, *result.figures]
    for section in dict.fromkeys([*result.texts, *(part.section for part in parts)]):
        own = [part for part in parts if part.section == section]
        yield from _section(section, result.texts.get(section, ""), own, folder)
    yield from ["<h2>Remarks</h2>"] * bool(result.notes)
    yield from (f"<p>{escape(note)}</p>" for note in result.notes)
    logs = f"Logs: {', '.join(escape(log.name) for log in result.logs)}." if result.logs else ""
    yield f"<footer>Numbers: {result.files.summary}. {logs}</footer>\n</body></html>"


def _section(section: str, text: str, parts: Sequence[Table | Figure], folder: Path) -> Iterator[str]:
    paragraphs = [f"<p>{escape(each)}</p>" for each in text.split("\n\n") if each]
    yield from [f"<h2>{escape(section)}</h2>"] * bool(parts or paragraphs)
    yield from paragraphs[:1]  # the others explain what is shown
    yield from (_table(part) if isinstance(part, Table) else _figure(part, folder) for part in parts)
    yield from paragraphs[1:]


def _table(table: Table) -> str:
    cells: Rows = table.cells()
    caption = f"<caption>{escape(table.title)}</caption>\n" if table.title else ""
    is_number = [all(map(NUMBER.fullmatch, column[1:])) for column in zip(*cells, strict=True)]
    head, *lines = (_row(row, "td" if number else "th", is_number) for number, row in enumerate(cells))
    body = "\n".join(lines)
    return f'<div class="table"><table>\n{caption}<thead>{head}</thead>\n{body}\n</table></div>'


def _row(cells: Sequence[str], tag: str, is_number: Sequence[bool]) -> str:
    kinds = [
        ' class="number"' if number else ' class="long"' if len(cell) > LONG else ""
        for cell, number in zip(cells, is_number, strict=True)
    ]
    texts = [f"<{tag}{kind}>{escape(cell)}</{tag}>" for cell, kind in zip(cells, kinds, strict=True)]
    return f"<tr>{''.join(texts)}</tr>"


def _figure(figure: Figure, folder: Path) -> str:
    picture = base64.b64encode((folder / f"{figure.name}.png").read_bytes()).decode()
    caption, name = escape(figure.caption), escape(figure.name)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{picture}">\n'
        f"<figcaption>{caption} Also as {name}.svg and {name}.pdf.</figcaption></figure>"
    )
