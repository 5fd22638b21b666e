"""`mudskipper experiment flipper` asks no questions and leaves a folder with all results."""

import json
from pathlib import Path

import pytest

from tests.command_line.command_lines import json_of

pytestmark = pytest.mark.usefixtures("png_alone")


def test_one_command_leaves_page_pictures_numbers_notebook_and_log(tmp_path: Path) -> None:
    summary = json_of("experiment", "flipper", "--simulated", "--mud", "49.5", "--trials", "1", "--out", str(tmp_path))
    wanted = {"report.html", "summary.json", "figure4_49.5.png", "figure5.png", "notebook.jsonl", "simulated-001.mcap"}
    assert wanted <= {path.name for path in tmp_path.iterdir()}
    assert summary == json.loads((tmp_path / "summary.json").read_text()) and summary["muds"][0]["mud"] == "49.5"
