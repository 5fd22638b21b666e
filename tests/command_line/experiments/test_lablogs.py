"""`mudskipper experiment lablogs`: what it refuses, and what it prints and writes of the authors' own logs."""

import json
import shutil
from pathlib import Path

import pytest

from command_line import exit_codes
from tests.command_line.command_lines import failure, json_of, refusal, run
from tests.folders import SHARED_DATA

pytestmark = pytest.mark.usefixtures("png_alone")

LABLOGS = ("experiment", "lablogs")
LOGS = SHARED_DATA / "flipper_in_mud"
REPEATABILITY = {"first_cv", "later_cv", "chi", "n", "values", "bounds", "invalid"}


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results without --out go to a folder of the test."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def test_folders_patterns_and_groups_that_lead_nowhere_are_refused(tmp_path: Path) -> None:
    assert "no such folder" in failure(*LABLOGS, str(tmp_path / "missing"))
    assert "holds no log" in refusal(*LABLOGS, str(tmp_path))
    (tmp_path / "pond.csv").write_text("no log")
    assert "must be a pattern and a name" in refusal(*LABLOGS, str(tmp_path), "--group", "pond*")
    assert "'lake*'" in refusal(*LABLOGS, str(tmp_path), "--group", "lake*=wet")
    assert "'air*'" in refusal(*LABLOGS, str(tmp_path), "--air", "air*")


def test_a_folder_without_a_readable_log_names_each_reason(tmp_path: Path) -> None:
    (tmp_path / "pond.csv").write_text("no log")
    (tmp_path / "run.mcap").write_text("no log")
    ended = run(*LABLOGS, str(tmp_path), "--json")
    assert ended.returncode == exit_codes.UNHEALTHY
    report = json.loads(ended.stdout, parse_constant=pytest.fail)
    assert [each["name"] for each in report["refused"]] == ["pond.csv", "run.mcap"]
    assert all(str(tmp_path) in each["reason"] for each in report["refused"])


@pytest.mark.skipif(not LOGS.is_dir(), reason="the shared measurements are not next to the repository")
def test_the_default_method_is_at_the_top_and_the_others_are_below_methods_with_a_page_and_figures(
    tmp_path: Path,
) -> None:
    """The folder has two trials of one mud, and a file that is no log."""
    folder, out = tmp_path / "logs", tmp_path / "out"
    folder.mkdir()
    for name in ("single_12N_trial1", "single_12N_trial4"):
        shutil.copy(LOGS / f"{name}.csv.gz", folder)
    (folder / "notes.csv").write_text("trial,remark\n1,rain\n")
    report = json_of(*LABLOGS, str(folder), "--out", str(out), "--group", "single_12N*=firm")
    keys = {"groups", "separation", "left_right", "air", "sensitivity"}
    assert report["schema"] == "experiment-lablogs/1"
    assert set(report) >= keys and set(report["methods"]["paper"]) >= keys
    for method in (report, report["methods"]["paper"]):
        assert set(method["groups"]) == {"firm"}
        assert all(set(each) >= REPEATABILITY for each in method["groups"]["firm"].values())
    assert report["groups"]["firm"]["k_s"]["n"] == 2
    assert report["groups"]["firm"]["k_s"] != report["methods"]["paper"]["groups"]["firm"]["k_s"]
    figures = {"strokes.png", "scatter.png", "left_right.png", "sensitivity.png"}
    assert {path.name for path in out.iterdir()} == {"report.html", "summary.json", *figures}
    assert report == json.loads((out / "summary.json").read_text(encoding="utf-8"))
