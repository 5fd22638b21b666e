"""Listing, recovering and preserving logs, as a person types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import exit_codes, main
from firmware_host.log_file import LogFile
from firmware_host.log_folder import ACTIVE, DONE, KEPT
from firmware_host.log_reader import read_log
from tests.firmware_host.made_up_rows import OPENING, make_ticks


def make_log(folder: Path, name: str) -> LogFile:
    log = LogFile(folder / ACTIVE / name, OPENING)
    log.write(make_ticks(0, 381))
    log.flush()
    return log


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A finished log, and one whose writer was killed."""
    make_log(tmp_path, "1.mcap").finish()
    make_log(tmp_path, "2.mcap")._file.close()
    return tmp_path


def test_the_list_shows_what_is_known(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["log", "list", str(folder), "--json"]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    assert [(log["name"], log["place"], log["duration_s"]) for log in report["logs"]] == [
        ("1.mcap", DONE, pytest.approx(1.0)),
        ("2.mcap", ACTIVE, None),
    ]
    assert report["logs_bytes"] == sum(log["bytes"] for log in report["logs"])
    assert 0 < report["free_bytes"] < report["disk_bytes"]
    assert main.main(["log", "list", str(folder)]) == exit_codes.OK
    assert "GB free" in capsys.readouterr().out


def test_recovery_of_a_folder_says_what_became_of_each(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["log", "recover", str(folder), "--json"]) == exit_codes.OK
    (log,) = json.loads(capsys.readouterr().out)["recovered"]
    assert (log["path"], log["rows"], log["lost"]) == (str(folder / DONE / "2.mcap"), 381, 0)
    assert read_log(folder / DONE / "2.mcap").complete
    assert main.main(["log", "recover", str(folder)]) == exit_codes.OK
    assert capsys.readouterr().out == "nothing to recover\n"
    assert main.main(["log", "list", str(folder), "--json"]) == exit_codes.OK
    assert [log["recovered"] for log in json.loads(capsys.readouterr().out)["logs"]] == [False, True]


def test_what_cannot_be_recovered_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "x.mcap").write_text("no log")
    living = make_log(folder, "3.mcap")
    for path, word in ((folder / "x.mcap", "nothing of a log"), (living.path, "is being written")):
        assert main.main(["log", "recover", str(path)]) == exit_codes.UNHEALTHY
        assert word in capsys.readouterr().err
    assert main.main(["log", "recover", str(folder / "none.mcap")]) == exit_codes.UNHEALTHY
    assert "No such file" in capsys.readouterr().err
    living.finish()


def test_a_preserved_log_moves_to_kept_and_back(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["log", "preserve", str(folder / DONE / "1.mcap")]) == exit_codes.OK
    kept = folder / KEPT / "1.mcap"
    assert capsys.readouterr().out == f"{kept}\n" and kept.exists()
    assert main.main(["log", "preserve", str(folder / ACTIVE / "2.mcap")]) == exit_codes.REFUSED
    assert main.main(["log", "preserve", "--undo", str(kept)]) == exit_codes.OK
    assert (folder / DONE / "1.mcap").exists()


def test_a_folder_that_is_not_there_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["log", "list", str(tmp_path / "none")]) == exit_codes.UNHEALTHY
    assert "there is no such folder" in capsys.readouterr().err


def test_the_configured_folder_is_the_default(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(__file__).parents[2] / "systemd" / "mudskipper.toml").read_text(encoding="utf-8")
    configuration = folder / "mudskipper.toml"
    configuration.write_text(text.replace("/var/lib/mudskipper/logs", str(folder)), encoding="utf-8")
    assert main.main(["log", "list", "--config", str(configuration)]) == exit_codes.OK
    assert "1.mcap" in capsys.readouterr().out
    assert main.main(["log", "recover", "--config", str(folder / "none.toml")]) == exit_codes.CONFIGURATION
