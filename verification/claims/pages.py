"""Fills the figures of the documentation from the results.

A figure in a page stands behind its template, which Markdown does not show:

    <!--= {trackway/table/3 cm/48.5/mean:.2f} cm/s -->7.45 cm/s<!--/-->

A field in braces is the name of a result, the path of its figure, and a format of Python's. With % the figure is
multiplied by 100, with M divided by a million; the unit is left to the template. A pattern of several figures gives
their range, "2 to 4". A template over several lines is a block, such as a whole table. Its line
`{for 3 cm; 5 cm} | $ | {trackway/table/$/48.5/mean:.2f} |` stands for a line for each of these names, in place of $.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from verification.claims.results import ROOT, Figure, Result, matches

MARKED = re.compile(r"<!--=(?P<template>.*?)-->(?P<text>.*?)<!--/-->", re.DOTALL)
FIELD = re.compile(r"\{(?P<name>[^{}/]+)/(?P<pattern>[^{}]+?)(?::(?P<format>[^:{}]*))?\}")
ROWS = re.compile(r"^\{for (?P<names>[^{}]+)\} *(?P<row>.*)$", re.MULTILINE)
SCALES = {"%": 100.0, "M": 1e-6}  # by the last letter of a format
UNKNOWN = "–"


def pages(root: Path = ROOT) -> Iterator[Path]:
    """Yield every page of the documentation, also those outside of its folder."""
    yield from sorted(root.glob("*.md"))
    yield from sorted(path for path in (root / "docs").rglob("*.md") if "generated" not in path.parts)


def fill(text: str, results: Mapping[str, Result], *, markers: bool = True) -> str:
    """Return a page with the figures of the results. Raises ValueError for a field without a figure."""

    def replace(marked: re.Match[str]) -> str:
        template = marked["template"]
        filled = FIELD.sub(lambda field: _value(field, results), _with_rows(template))
        return f"<!--={template}-->{filled}<!--/-->" if markers else filled

    return MARKED.sub(replace, text)


def _with_rows(template: str) -> str:
    """Return a template without the spaces around it, with a line for each name of a line that begins with `{for`."""

    def repeat(line: re.Match[str]) -> str:
        return "\n".join(line["row"].replace("$", name.strip()) for name in line["names"].split(";"))

    return ROWS.sub(repeat, template.strip(" "))


def _value(field: re.Match[str], results: Mapping[str, Result]) -> str:
    result = results.get(field["name"])
    found = [figure for path, figure in result["figures"].items() if matches(path, field["pattern"])] if result else []
    if not found:
        raise ValueError(f"no result has the figure {field['name']}/{field['pattern']}")
    numbers = sorted(each for each in found if isinstance(each, int | float))
    ends = [numbers[0], numbers[-1]] if len(found) > 1 and numbers else found[:1]
    texts = [_text(each, field["format"] or "") for each in ends]
    return " to ".join(dict.fromkeys(texts))


def _text(figure: Figure, form: str) -> str:
    if figure is None:
        return UNKNOWN
    if form[-1:] in SCALES and isinstance(figure, int | float):
        return format(SCALES[form[-1]] * figure, form[:-1] + "f")
    return format(figure, form)


def pages_of(name: str, path: str, root: Path = ROOT) -> list[str]:
    """Return the pages that show a figure of a result."""
    return [
        str(page.relative_to(root))
        for page in pages(root)
        if any(
            field["name"] == name and matches(path, field["pattern"])
            for marked in MARKED.finditer(page.read_text(encoding="utf-8"))
            for field in FIELD.finditer(_with_rows(marked["template"]))
        )
    ]


def rewrite_pages(results: Mapping[str, Result], root: Path = ROOT) -> list[str]:
    """Fill all pages and return those that changed."""
    changed = []
    for page in pages(root):
        text = page.read_text(encoding="utf-8")
        if (filled := fill(text, results)) != text:
            page.write_text(filled, encoding="utf-8")
            changed.append(str(page.relative_to(root)))
    return changed
