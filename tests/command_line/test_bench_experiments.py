"""`mudskipper experiment flipper` asks no questions and leaves a folder with all results."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main

FLIPPER = ["experiment", "flipper", "--simulated", "--mud", "49.5", "--trials", "1"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("flipper")


@pytest.fixture(scope="module")
def first(folder: Path) -> int:
    return main([*FLIPPER, "--out", str(folder)])


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_one_command_leaves_page_pictures_numbers_notebook_and_log(first: int, folder: Path) -> None:
    assert first == exit_codes.OK
    wanted = {"report.html", "summary.json", "figure4_49.5.png", "figure5.png", "notebook.jsonl", "simulated-001.mcap"}
    assert wanted <= names(folder)
    summary = json.loads((folder / "summary.json").read_text(), parse_constant=pytest.fail)  # NaN is not valid JSON
    assert summary["muds"][0]["mud"] == "49.5"


def test_without_its_page_the_same_command_measures_nothing_twice(
    first: int, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (folder / "notebook.jsonl").read_bytes()
    (folder / "report.html").unlink()
    assert main([*FLIPPER, "--json", "--out", str(folder)]) == exit_codes.OK
    assert (folder / "notebook.jsonl").read_bytes() == before
    assert json.loads(capsys.readouterr().out)["experiment"] == "flipper"
