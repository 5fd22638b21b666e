"""The results of an experiment in one folder: a page, its pictures, its numbers and its logs.

The page is plain HTML with the pictures inside, so it can be sent as one file and printed in black and white.
"""

import base64
import gc
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import UTC, datetime
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any

from experiments.reports.text_tables import Rows, TitledRows
from firmware_host.software_version import software_version
from logs.files.whole_files import whole_file

FLAT: Mapping[str, Any] = {"flat": True}  # metadata of a field
PAGE, SUMMARY = "report.html", "summary.json"
STYLE = """\
body { font: 15px/1.5 Georgia, serif; max-width: 66em; margin: 2em auto; padding: 0 1.5em; color: #111 }
h1, h2, table, footer { font-family: Helvetica, Arial, sans-serif }
h1 { font-size: 1.6em; margin-bottom: 0 } h2 { font-size: 1.15em; margin-top: 2em }
p { max-width: 46em } .table { overflow-x: auto; margin: 1em 0 }
table { border-collapse: collapse; font-size: 0.8em; font-variant-numeric: tabular-nums }
table { border-bottom: 1.5px solid #111 } tr + tr td { border-top: 1px solid #ddd }
caption { text-align: left; font-weight: bold; padding-bottom: 0.3em }
th { text-align: left; border-top: 1.5px solid #111; border-bottom: 1px solid #111 }
pre { font-size: 0.78em; line-height: 1.35; overflow-x: auto }
th, td { padding: 0.25em 1.2em 0.25em 0; vertical-align: top; white-space: nowrap } td.long { white-space: normal }
thead { display: table-header-group } tr { break-inside: avoid }
figure { margin: 1em 0; break-inside: avoid } img { max-width: 100% }
figcaption, footer, .when { color: #444; font-size: 0.9em } footer { margin-top: 3em; border-top: 1px solid #ccc }
@page { size: A4; margin: 15mm }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 10.5px } h2, caption { break-after: avoid }
  pre { white-space: pre-wrap } .table { overflow: visible } th, td { padding-right: 0.8em } img { max-height: 240mm } }
"""
LONG = 32  # letters of a cell from which it may be broken into lines


@dataclass(frozen=True)
class Figure:
    name: str  # of its file, without the ending
    caption: str
    draw: Callable[[Path], Any]  # into a file of the kind that its ending says; may return the figure of matplotlib


@dataclass(frozen=True)
class Section:
    heading: str
    text: str = ""  # paragraphs are separated by an empty line
    screen: str = ""  # preformatted text
    rows: Rows = ()  # of a table, the head first
    figures: Sequence[Figure] = ()
    tables: Sequence[TitledRows] = ()  # further ones, each below its title


def write_report(
    folder: Path,
    report: Any,
    title: str,
    sections: Sequence[Section],
    logs: Sequence[Path] = (),
    also: Sequence[str] = (),
    watch: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> list[Path]:
    """Write everything and return the paths. Raises OSError.

    `report` becomes the summary; `also` are further endings for the pictures next to the page, such as .svg.
    """
    folder.mkdir(parents=True, exist_ok=True)
    summary, page = folder / SUMMARY, folder / PAGE
    _write(summary, json_pieces(report))
    del report  # it may be as large as a picture
    figures = [figure for section in sections for figure in section.figures]
    pictures: list[Path] = []
    for done, figure in enumerate(figures):
        watch("pictures drawn", done, len(figures))
        pictures += _draw(figure, [folder / f"{figure.name}{ending}" for ending in (".png", *also)])
        gc.collect()  # the parts of a picture refer to each other: the next one shall not stand next to them in memory
    _write(page, _page_lines(folder, title, sections, logs, also))
    return [page, summary, *pictures, *logs]


def _write(path: Path, pieces: Iterable[str]) -> None:
    with whole_file(path) as hidden, hidden.open("w", encoding="utf-8", errors="replace") as file:
        file.writelines(pieces)  # file names may be any bytes


def json_pieces(report: Any) -> Iterator[str]:
    """Yield the report as JSON and a line end. The lists of a mapping, which may be long, are encoded by the entry."""
    report = report if isinstance(report, Mapping) else to_json(report)
    if not isinstance(report, Mapping) or not report:
        yield f"{_encoded(report)}\n"
        return
    before = "{\n "
    for key, value in report.items():
        yield f"{before}{json.dumps(str(key))}: "
        yield from _entry_pieces(value)
        before = ",\n "
    yield "\n}\n"


def _entry_pieces(value: Any) -> Iterator[str]:
    if type(value) not in (list, tuple) or not value:
        yield _encoded(value, 1)
        return
    before = "[\n  "
    for each in value:
        yield f"{before}{_encoded(each, 2)}"
        before = ",\n  "
    yield "\n ]"


def _encoded(value: Any, level: int = 0) -> str:
    return json.dumps(to_json(value), indent=1, allow_nan=False).replace("\n", "\n" + " " * level)


def to_json(report: Any) -> Any:
    """Turn records into mappings by field name, and NaN into None, since JSON has no NaN.

    A field of a dataclass with `metadata={"key": ...}` has that key; the entries of a FLAT field stand next to those
    of its record.
    """
    if is_dataclass(report) and not isinstance(report, type):
        return _record_to_json(report)
    if isinstance(report, tuple) and hasattr(report, "_asdict"):
        report = report._asdict()
    if isinstance(report, Mapping):
        return {key: to_json(value) for key, value in report.items()}
    if isinstance(report, list | tuple):
        return [to_json(value) for value in report]
    return None if isinstance(report, float) and not isfinite(report) else report


def _record_to_json(record: Any) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for each in fields(record):
        value = to_json(getattr(record, each.name))
        entries |= value if "flat" in each.metadata else {each.metadata.get("key", each.name): value}
    return entries


def _draw(figure: Figure, paths: Sequence[Path]) -> Sequence[Path]:
    """Draw a picture once, and save it in its further forms where it can be saved again."""
    first, *others = paths
    with whole_file(first) as hidden:
        picture = figure.draw(hidden)
    for path in others:
        with whole_file(path) as hidden:
            figure.draw(hidden) if picture is None else _save_again(picture, hidden)
    return paths


def _save_again(picture: Any, path: Path) -> None:
    from matplotlib import rc_context  # slow to import

    picture.set_layout_engine("none")  # its parts stay where they are
    with rc_context({"pdf.fonttype": 42}):  # TrueType: journals refuse matplotlib's own Type 3
        picture.savefig(path)


def _page_lines(
    folder: Path, title: str, sections: Sequence[Section], logs: Sequence[Path], also: Sequence[str]
) -> Iterator[str]:
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    logs_text = f"Logs: {', '.join(escape(log.name) for log in logs)}." if logs else ""
    yield (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f"<style>\n{STYLE}</style></head><body>\n<h1>{escape(title)}</h1>\n"
        f'<p class="when">{made}, mudskipper {escape(software_version())}</p>\n'
    )
    for section in sections:
        yield from (f"{part}\n" for part in _section_parts(section, folder, also))
    yield f"<footer>Numbers: {SUMMARY}. {logs_text}</footer>\n</body></html>\n"


def _section_parts(section: Section, folder: Path, also: Sequence[str]) -> Iterator[str]:
    yield f"<h2>{escape(section.heading)}</h2>"
    yield from (f"<p>{escape(part)}</p>" for part in section.text.split("\n\n") if part)
    for title, rows in [("", section.rows)] * bool(section.rows) + [*section.tables]:
        yield _table(title, rows)
    if section.screen:
        yield f"<pre>{escape(section.screen)}</pre>"
    yield from (_figure(figure, folder, also) for figure in section.figures)


def _table(title: str, rows: Rows) -> str:
    head, *body = rows
    caption = f"<caption>{escape(title)}</caption>\n" if title else ""
    lines = "\n".join(_row(row, "td") for row in body)
    return f'<div class="table"><table>\n{caption}<thead>{_row(head, "th")}</thead>\n{lines}\n</table></div>'


def _row(cells: Sequence[str], tag: str) -> str:
    return "<tr>" + "".join(_cell(cell, tag) for cell in cells) + "</tr>"


def _cell(text: str, tag: str) -> str:
    kind = ' class="long"' if tag == "td" and len(text) > LONG else ""
    return f"<{tag}{kind}>{escape(text)}</{tag}>"


def _figure(figure: Figure, folder: Path, also: Sequence[str]) -> str:
    picture = base64.b64encode((folder / f"{figure.name}.png").read_bytes()).decode()
    caption = escape(figure.caption)
    others = f" Also as {' and '.join(f'{escape(figure.name)}{ending}' for ending in also)}." if also else ""
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{picture}">\n'
        f"<figcaption>{caption}{others}</figcaption></figure>"
    )
