"""The shape of a study: from one file in a folder to a command with options, resuming, a page, tables and JSON."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

import experiments.studies
from command_line import exit_codes
from command_line.main import main
from experiments.study import catalogue, provenance
from tests.folders import ROOT

PAGE = (ROOT / "docs" / "how-to" / "extend.md").read_text(encoding="utf-8")
STUDY = PAGE.partition("<!-- study -->")[2].partition("```python\n")[2].partition("```")[0]
NAME = "stroke-length"
COMMAND = ["experiment", NAME, "--simulated"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Provide a working directory, and the study of the guide in the folder of studies."""
    studies = tmp_path / "experiments" / "studies"
    studies.mkdir(parents=True)
    (studies / "stroke_length.py").write_text(STUDY, encoding="utf-8")
    monkeypatch.setitem(catalogue.FOLDERS, "experiments.studies", studies)
    monkeypatch.setattr(experiments.studies, "__path__", [str(studies)])
    monkeypatch.setattr(provenance, "source_digest", lambda *modules: "0123")  # the file is not in the product
    catalogue.find_studies.cache_clear()
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    catalogue.find_studies.cache_clear()
    sys.modules.pop("experiments.studies.stroke_length", None)


def test_one_file_is_a_command_with_its_table_page_and_numbers(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*COMMAND, "--json", "--workers", "1", "--depth", "2", "--depth", "5"]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    assert report["schema"] == f"experiment-{NAME}/1" and report["experiment"] == NAME
    assert report["provenance"]["options"]["depth"] == [2.0, 5.0]
    assert [row["depth_cm"] for row in report["strokes"]] == [2.0, 5.0]
    assert all(row["step_cm"] > 0.0 for row in report["strokes"])
    out = folder / f"mudskipper-{NAME}"
    assert json.loads((out / "summary.json").read_text()) == report
    assert ">5</td>" in (out / "report.html").read_text()
    assert list(pd.read_parquet(out / "results.parquet")["depth_cm"]) == [2.0, 5.0]
    for ending in ("png", "svg", "pdf"):
        assert (out / f"strokes.{ending}").stat().st_size > 1000
    notebook = (out / "notebook.jsonl").read_bytes()
    assert main([*COMMAND, "--depth", "2", "--depth", "5", "--out", str(out)]) == exit_codes.REFUSED  # it is finished
    again = [*COMMAND, "--depth", "5", "--depth", "5", "--out", str(out)]
    assert main(again) == exit_codes.OK  # its rows are there already, and one of them counts once
    assert list(pd.read_parquet(out / "results.parquet")["depth_cm"]) == [5.0]
    printed = capsys.readouterr().out.splitlines()
    assert printed[1].split() == ["depth_cm", "(cm)", "step_cm", "(cm)", "failed"] and printed[2].split()[0] == "5"
    assert (out / "notebook.jsonl").read_bytes() == notebook


@pytest.mark.parametrize(
    "wrong", ["", "--simulated --depth 30", "--simulated --depth deep", "--simulated --seeds 0", "--simulated --fog 1"]
)
def test_options_outside_of_their_declaration_are_refused(wrong: str, folder: Path) -> None:
    try:
        status: object = main(["experiment", NAME, *wrong.split()])
    except SystemExit as ended:
        status = ended.code
    assert status == exit_codes.USAGE
    assert not list(folder.glob("mudskipper-*"))


def test_a_study_whose_annotations_are_text_is_refused(folder: Path) -> None:
    """Its options would vanish without a word."""
    path = folder / "experiments" / "studies" / "stroke_length.py"
    path.write_text(f"from __future__ import annotations\n{STUDY}", encoding="utf-8")
    with pytest.raises(TypeError, match="from __future__ import annotations"):
        main(COMMAND)
