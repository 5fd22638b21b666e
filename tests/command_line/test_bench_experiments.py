"""`mudskipper experiment flipper` asks no questions and leaves a folder with all results."""

import json
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main

pytestmark = pytest.mark.usefixtures("png_alone")

FLIPPER = ["experiment", "flipper", "--simulated", "--mud", "49.5", "--trials", "1"]


def test_one_command_leaves_page_pictures_numbers_notebook_and_log(tmp_path: Path) -> None:
    assert main([*FLIPPER, "--out", str(tmp_path)]) == exit_codes.OK
    wanted = {"report.html", "summary.json", "figure4_49.5.png", "figure5.png", "notebook.jsonl", "simulated-001.mcap"}
    assert wanted <= {path.name for path in tmp_path.iterdir()}
    summary = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)  # NaN is not valid JSON
    assert summary["muds"][0]["mud"] == "49.5"
