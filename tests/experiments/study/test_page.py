"""A page of results is one self-contained file, with its numbers and pictures also in files of their own."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from experiments.study.page import json_pieces, write_result
from experiments.study.result import Figure, Result, Table, to_json


def draw_line() -> Drawing:
    figure = Drawing(figsize=(1.0, 1.0))
    figure.subplots().plot([0.0, 1.0])
    return figure


TABLE = Table(
    "muds", "A < B", {"k_p": "N/cm³"}, DataFrame({"mud": ["48.5 <b>"], "k_p": [float("nan")]}), "Force & such"
)
RESULT = Result([TABLE], [Figure("line", 'A "line"', draw_line)], title="Title", notes=["Left out: 1."])


def test_the_page_contains_its_pictures_and_shows_text_as_it_is(tmp_path: Path) -> None:
    shown: list[tuple[int, int]] = []
    rows = [DataFrame({"a": [1, 2], "b": [[1], None], "c": [1, "x"]})]
    log = tmp_path / "a.mcap"
    result = Result(**vars(RESULT) | {"logs": [log]})
    written = write_result(tmp_path, result, {"k": 1}, rows, lambda what, done, total: shown.append((done, total)))
    names = ["report.html", "summary.json", "results.parquet", "line.png", "line.svg", "line.pdf", "a.mcap"]
    assert [path.name for path in written] == names and shown == [(0, 1)]
    assert [path.read_bytes()[:5] for path in written[3:6]] == [b"\x89PNG\r", b"<?xml", b"%PDF-"]
    assert b"/Type3" not in written[5].read_bytes()  # journals refuse such fonts
    page = written[0].read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=\"(?!data:)", page) and page.count("data:image/png") == 1
    assert "line.svg and line.pdf" in page
    for text in ("A &lt; B", "48.5 &lt;b&gt;", "Force &amp; such", "k_p (N/cm³)", ">-</td>", "Left out: 1."):
        assert text in page
    assert RESULT.text().splitlines()[0] == "A < B" and RESULT.json() == {"muds": [{"mud": "48.5 <b>", "k_p": None}]}


def test_a_section_shows_its_tables_below_its_first_paragraph_and_sections_keep_their_order(tmp_path: Path) -> None:
    tables = [Table(name, name, {}, DataFrame({"n": [1]}), section) for name, section in (("t1", "A"), ("t2", "C"))]
    texts = {"A": "found\n\nexplained", "C": "", "absent": "", "B": "method"}
    written = write_result(tmp_path, Result(tables, texts=texts, notes=["noted"]), {})
    page = written[0].read_text(encoding="utf-8").partition("</head>")[2]
    parts = (">A<", "found", ">t1<", "explained", ">C<", ">t2<", ">B<", "method", "noted")
    places = [page.index(text) for text in parts]
    assert places == sorted(places) and "absent" not in page


@pytest.mark.parametrize("whole_files", range(2))
def test_a_disk_that_fills_up_leaves_the_page_that_was_there_and_nothing_cut(
    whole_files: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full when the numbers or the page is written; a part of that file fits."""
    result = Result([TABLE], title="Before")
    before = {path: path.read_bytes() for path in write_result(tmp_path, result, {"k": 1})}
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
        write_result(tmp_path, result, {"k": 2})
    assert sorted(tmp_path.iterdir()) == sorted(before)
    assert (tmp_path / "report.html").read_bytes() == before[tmp_path / "report.html"]
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == {"k": 1 + whole_files}


@pytest.mark.parametrize(
    "summary",
    [
        {"a": [], "b": (), "c": {}, "d": None, "e": float("nan")},
        {"strides": [{"k": 1.5, "fits": {"r": [1, [2, float("inf")]]}}, {}, [], "line\nend"], "last": ({"x": "ü"}, 2)},
    ],
)
def test_a_summary_that_is_written_by_the_entry_is_the_whole_one(summary: dict[str, Any]) -> None:
    assert "".join(json_pieces(summary)) == json.dumps(to_json(summary), indent=1, allow_nan=False) + "\n"
