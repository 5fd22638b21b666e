"""A report is one self-contained page, with its numbers and pictures also in files of their own."""

from __future__ import annotations

import base64
import json
import re
import weakref
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from experiments.reports.report_page import Figure, Section, json_pieces, to_json, write_report

DOT = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGNgYGD4DwABBAEAwS2OUAAAAABJRU5ErkJggg=="
)


def draw_dot(path: Path) -> None:
    path.write_bytes(DOT)


SECTION = Section(
    "Torque < force & such",
    "First.\n\nSecond: k_p > 1.",
    "a  b < c",
    [["mud", "k_p"], ["48.5 %", "1.20 <N/cm³>"]],
    [Figure("dots", 'A "dot" & more', draw_dot)],
)


class Elements(HTMLParser):
    """Collects the text of a page, and checks that its elements are closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_contains_its_pictures_and_loads_nothing(tmp_path: Path) -> None:
    log = tmp_path / "a.mcap"
    written = write_report(tmp_path / "out", {"experiment": "x", "value": 1.5}, "Title", [SECTION], [log])
    assert [path.name for path in written] == ["report.html", "summary.json", "dots.png", "a.mcap"]
    page = written[0].read_text(encoding="utf-8")
    assert base64.b64encode(DOT).decode() in page
    assert not re.findall(r"(?:src|href)=\"(?!data:)", page)
    assert json.loads(written[1].read_text(encoding="utf-8")) == {"experiment": "x", "value": 1.5}
    assert written[2].read_bytes() == DOT


def test_pictures_can_have_further_forms_and_sections_further_tables(tmp_path: Path) -> None:
    titled = Section("Two", rows=[["a"], ["1"]], tables=[("Second < first", [["b"], ["2"]])], figures=SECTION.figures)
    seen: list[tuple[int, int]] = []
    written = write_report(
        tmp_path,
        {},
        "Title",
        [titled],
        also=(".svg", ".pdf"),
        watch=lambda what, done, total: seen.append((done, total)),
    )
    assert [path.name for path in written[2:]] == ["dots.png", "dots.svg", "dots.pdf"]
    assert seen == [(0, 1)]
    page = written[0].read_text(encoding="utf-8")
    assert page.count("<table>") == 2 and "<caption>Second &lt; first</caption>" in page
    assert "dots.svg and dots.pdf" in page


@pytest.mark.parametrize("whole_files", range(3))
def test_a_disk_that_fills_up_leaves_the_report_that_was_there_and_nothing_cut(
    whole_files: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full when the numbers, the picture or the page is written; a part of that file fits."""
    before = {path: path.read_bytes() for path in write_report(tmp_path, {"k": 1}, "Before", [SECTION])}
    opened, open_path = [0], Path.open

    def fill(path: Path, mode: str = "r", *further: Any, **options: Any) -> Any:
        opened[0] += "w" in mode
        if "w" not in mode or opened[0] <= whole_files:
            return open_path(path, mode, *further, **options)
        with open_path(path, "wb") as file:
            file.write(b"half")
        return open_path(Path("/dev/full"), mode, *further, **options)

    monkeypatch.setattr(Path, "open", fill)
    with pytest.raises(OSError, match="No space left"):
        write_report(tmp_path, {"k": 2}, "After", [SECTION])
    assert sorted(tmp_path.iterdir()) == sorted(before)
    assert (tmp_path / "report.html").read_bytes() == before[tmp_path / "report.html"]
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == {"k": 1 if whole_files == 0 else 2}
    assert (tmp_path / "dots.png").read_bytes() == DOT


def test_text_is_shown_as_it_is(tmp_path: Path) -> None:
    page = write_report(tmp_path, {}, "A < B", [SECTION])[0].read_text(encoding="utf-8")
    elements = Elements()
    elements.feed(page)
    assert not elements.open
    for text in ("A < B", "Torque < force & such", "Second: k_p > 1.", "a  b < c", "1.20 <N/cm³>", 'A "dot" & more'):
        assert text in elements.text


def test_numbers_that_are_not_finite_are_null_in_json(tmp_path: Path) -> None:
    report = {"experiment": "x", "k": [1.0, float("nan")], "deep": {"sd": float("inf"), "n": (2, float("nan"))}}
    _, summary, *_ = write_report(tmp_path, report, "Odd \udcff name", [])
    strict = json.loads(summary.read_text(encoding="utf-8"), parse_constant=lambda name: pytest.fail(name))
    assert strict == {"experiment": "x", "k": [1.0, None], "deep": {"sd": None, "n": [2, None]}}


class Picture:
    """Refers to itself, as a figure of matplotlib does through its parts."""

    def __init__(self) -> None:
        self.part = self


def test_a_picture_has_left_the_memory_when_the_next_one_is_drawn(tmp_path: Path) -> None:
    drawn: list[weakref.ref[Picture]] = []

    def draw(path: Path) -> Picture:
        assert [picture() for picture in drawn] == [None] * len(drawn)
        draw_dot(path)
        picture = Picture()
        drawn.append(weakref.ref(picture))
        return picture

    figures = [Figure(f"dots-{number}", "Dots", draw) for number in range(3)]
    write_report(tmp_path, {}, "Title", [Section("Dots", figures=figures)])
    assert len(drawn) == 3


@pytest.mark.parametrize(
    "report",
    [
        {},
        [],
        [{"a": 1}],
        "text",
        {"a": [], "b": (), "c": {}, "d": None, "e": float("nan")},
        {"strides": [{"k": 1.5, "fits": {"r": [1, [2, float("inf")]]}}, {}, [], "line\nend"], "last": ({"x": "ü"}, 2)},
        Section("Heading", rows=[["a"], ["b"]]),
    ],
)
def test_a_summary_that_is_written_by_the_entry_is_the_whole_one(report: object) -> None:
    assert "".join(json_pieces(report)) == json.dumps(to_json(report), indent=1, allow_nan=False) + "\n"
