"""`mudskipper log export` to CSV and Parquet, from the command line."""

import os
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from command_line import exit_codes
from command_line.logs import log_export
from logs.files.log_reader import read_log
from logs.files.scanned_log import ScannedLog, scan_logs
from tests.command_line.command_lines import failure, output, refusal, run
from tests.folders import ROOT
from tests.full_disk import files_of_at_most

LOG = str(ROOT / "tests/fixtures/walk_0_1.mcap")
FORMS = {"--csv": "walk.csv", "--parquet": "tables"}


def test_parquet_goes_into_the_named_folder(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "tables"
    output("log", "export", "--parquet", LOG, "--out", str(folder))
    names = {path.name for path in folder.iterdir()}
    assert names == {f"walk_0_1-{part}.parquet" for part in ("ticks", "strides", "events")}


def test_a_csv_on_a_full_disk_leaves_the_file_before(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("before", encoding="utf-8")
    with files_of_at_most(100_000):
        message = failure("log", "export", "--csv", LOG, "--out", str(path))
    assert f"{path}: nothing was written" in message
    assert [(each, each.read_text(encoding="utf-8")) for each in tmp_path.iterdir()] == [(path, "before")]


def test_parquet_into_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "name a folder" in refusal("log", "export", "--parquet", LOG, "--out", str(tmp_path / "file"))


def rows_of(form: str, out: Path) -> int:
    if form == "--csv":
        return len(out.read_text(encoding="utf-8").splitlines()) - 3
    return int(pq.read_metadata(out / "walk-ticks.parquet").num_rows)


@pytest.mark.parametrize("form", FORMS)
def test_an_export_of_a_log_that_was_cut_off_has_everything_before_and_says_so(form: str, tmp_path: Path) -> None:
    log, out = tmp_path / "walk.mcap", tmp_path / FORMS[form]
    contents = Path(LOG).read_bytes()
    log.write_bytes(contents[: len(contents) // 2])
    ended = run("log", "export", form, str(log), "--out", str(out))
    assert ended.returncode == exit_codes.OK
    assert ended.stderr.count("the log was cut off: everything up to there was read") == 1
    assert rows_of(form, out) == read_log(log).rows > 1000


@pytest.mark.parametrize("form", FORMS)
def test_a_log_that_is_cut_off_during_an_export_is_refused(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, out = tmp_path / "walk.mcap", tmp_path / FORMS[form]
    log.write_bytes(Path(LOG).read_bytes())

    def scan_before_cut(paths: list[Path], *arguments: Any) -> ScannedLog:
        scanned = scan_logs(paths, *arguments)
        os.truncate(log, log.stat().st_size // 2)
        return scanned

    monkeypatch.setattr(log_export, "scan_logs", scan_before_cut)
    message = failure("log", "export", form, str(log), "--out", str(out))
    assert message.count("was cut off while it was read") == 1
    assert not any(path.is_file() for path in (out, *out.glob("*")))
