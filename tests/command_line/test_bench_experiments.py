"""`mudskipper experiment flipper` and `walk` ask no questions and leave a folder with all results."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main
from experiments.studies import walk
from experiments.walk.measurement import WalkTrials

FLIPPER = ["experiment", "flipper", "--simulated", "--mud", "49.5", "--trials", "1"]
WALK = ["experiment", "walk", "--simulated", "--mud", "51.2=20", "--trials", "1", "--soft", "51.2"]


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


def test_a_walk_reads_the_flippers_summary_as_its_truth(
    first: int, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(walk, "WalkTrials", partial(WalkTrials, soft_strides=2))
    assert main([*WALK, "--truth", str(folder / "summary.json"), "--out", str(tmp_path)]) == exit_codes.OK
    assert {"report.html", "summary.json", "figure6_trial1.png", "figure7_51.2.png"} <= names(tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["settings"]["muds"] == [["51.2", 0.2]]
    assert summary["settings"]["truth"] == "file"
