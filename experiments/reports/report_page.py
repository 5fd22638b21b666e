"""The results of an experiment in one folder: a page, its pictures, its numbers and its logs.

The page is plain HTML with the pictures inside, so it can be sent as one file and printed in black and white.
"""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import UTC, datetime
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any

from experiments.reports.text_tables import Rows as Rows
from firmware_host.log.whole_files import whole_file
from firmware_host.software_version import software_version

FLAT: Mapping[str, Any] = {"flat": True}  # metadata of a field
PAGE, SUMMARY = "report.html", "summary.json"
STYLE = """\
body { font: 15px/1.5 Georgia, serif; max-width: 62em; margin: 2em auto; padding: 0 1.5em; color: #111 }
h1, h2, table, footer { font-family: Helvetica, Arial, sans-serif }
h1 { font-size: 1.6em; margin-bottom: 0 } h2 { font-size: 1.15em; margin-top: 2em }
table { border-collapse: collapse; font-size: 0.85em; margin: 1em 0 }
th { text-align: left; border-bottom: 1.5px solid #111 } td { border-bottom: 1px solid #ccc }
pre { font-size: 0.78em; line-height: 1.35; overflow-x: auto }
th, td { padding: 0.25em 1.2em 0.25em 0; vertical-align: top; white-space: nowrap }
td:last-child { white-space: normal }
thead { display: table-header-group } tr { break-inside: avoid }
figure { margin: 1em 0; break-inside: avoid } img { max-width: 100% }
figcaption, footer, .when { color: #444; font-size: 0.9em } footer { margin-top: 3em; border-top: 1px solid #ccc }
@media print { body { margin: 0; max-width: none } h2 { break-after: avoid } pre { white-space: pre-wrap } }
"""


@dataclass(frozen=True)
class Figure:
    name: str  # of its file, without the ending
    caption: str
    draw: Callable[[Path], None]  # into a PNG file


@dataclass(frozen=True)
class Section:
    heading: str
    text: str = ""  # paragraphs are separated by an empty line
    screen: str = ""  # preformatted text
    rows: Rows = ()  # of a table, the head first
    figures: Sequence[Figure] = ()


def write_report(
    folder: Path, report: Any, title: str, sections: Sequence[Section], logs: Sequence[Path] = ()
) -> list[Path]:
    """Write everything and return the paths. `report` becomes the summary. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    summary, page = folder / SUMMARY, folder / PAGE
    _write(summary, json.dumps(to_json(report), indent=1, allow_nan=False) + "\n")
    pictures = [_draw(figure, folder) for section in sections for figure in section.figures]
    _write(page, _page(folder, title, sections, logs))
    return [page, summary, *pictures, *logs]


def _write(path: Path, text: str) -> None:
    with whole_file(path) as hidden:
        hidden.write_text(text, encoding="utf-8", errors="replace")  # file names may be any bytes


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


def _draw(figure: Figure, folder: Path) -> Path:
    path = _picture_path(figure, folder)
    with whole_file(path) as hidden:
        figure.draw(hidden)
    return path


def _picture_path(figure: Figure, folder: Path) -> Path:
    return folder / f"{figure.name}.png"


def _page(folder: Path, title: str, sections: Sequence[Section], logs: Sequence[Path]) -> str:
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    logs_text = f"Logs: {', '.join(escape(log.name) for log in logs)}." if logs else ""
    body = "\n".join(_section(section, folder) for section in sections)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f"<style>\n{STYLE}</style></head><body>\n<h1>{escape(title)}</h1>\n"
        f'<p class="when">{made}, mudskipper {escape(software_version())}</p>\n{body}\n'
        f"<footer>Numbers: {SUMMARY}. {logs_text}</footer>\n</body></html>\n"
    )


def _section(section: Section, folder: Path) -> str:
    paragraphs = [f"<p>{escape(part)}</p>" for part in section.text.split("\n\n") if part]
    figures = [_figure(figure, _picture_path(figure, folder)) for figure in section.figures]
    screen = [f"<pre>{escape(section.screen)}</pre>"] if section.screen else []
    parts = [f"<h2>{escape(section.heading)}</h2>", *paragraphs, *([_table(section.rows)] if section.rows else [])]
    return "\n".join([*parts, *screen, *figures])


def _table(rows: Rows) -> str:
    head, *body = rows
    lines = "\n".join(_row(row, "td") for row in body)
    return f"<table>\n<thead>{_row(head, 'th')}</thead>\n{lines}\n</table>"


def _row(cells: Sequence[str], tag: str) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def _figure(figure: Figure, path: Path) -> str:
    picture = base64.b64encode(path.read_bytes()).decode()
    caption = escape(figure.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{picture}">\n'
        f"<figcaption>{caption}</figcaption></figure>"
    )
