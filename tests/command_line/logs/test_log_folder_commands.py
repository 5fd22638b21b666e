"""The commands that list, recover and preserve the logs of a folder."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest

from command_line import exit_codes, main
from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import ACTIVE, DONE, PRESERVED
from logs.files.log_reader import read_log
from tests.firmware_host.synthetic_rows import OPENING, make_ticks
from tests.folders import EXAMPLE_CONFIGURATION


def make_log(folder: Path, name: str) -> LogFile:
    log = LogFile(folder / ACTIVE / name, OPENING)
    log.write(make_ticks(0, 381))
    log.flush()
    return log


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a finished log and one whose writer was killed."""
    make_log(tmp_path, "1.mcap").finish()
    make_log(tmp_path, "2.mcap")._file.close()
    return tmp_path


def test_a_log_that_is_being_written_is_not_taken_for_one_that_was_cut_off(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = make_log(tmp_path, "1.mcap")
    assert main.main(["log", "list", str(tmp_path), "--json"]) == exit_codes.OK
    assert [entry["state"] for entry in json.loads(capsys.readouterr().out)["logs"]] == ["being written"]
    assert main.main(["log", "list", str(tmp_path)]) == exit_codes.OK
    printed = capsys.readouterr().out
    assert "being written" in printed and "recover" not in printed
    log.finish()  # the listing left its lock in place
    assert main.main(["log", "list", str(tmp_path), "--json"]) == exit_codes.OK
    assert [entry["state"] for entry in json.loads(capsys.readouterr().out)["logs"]] == ["whole"]


def test_incomplete_logs_are_listed_and_counted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    contents = (folder / DONE / "1.mcap").read_bytes()
    (folder / DONE / "0.mcap").write_bytes(contents[:-100])
    (folder / "00.mcap").write_bytes(contents)
    for name in ("3.mcap.broken", "4.mcap.part", "notes.txt"):
        (folder / ACTIVE / name).write_bytes(bytes(100))
    assert main.main(["log", "list", str(folder), "--json"]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    assert {log["name"]: log["state"] for log in report["logs"]} == {
        "00.mcap": "copy",
        "0.mcap": "broken",
        "1.mcap": "whole",
        "2.mcap": "unfinished",
        "3.mcap.broken": "broken",
        "4.mcap.part": "unfinished",
        "notes.txt": "no log",
    }
    known = {log["name"]: (log["place"], log["duration_s"]) for log in report["logs"]}
    assert (known["1.mcap"], known["2.mcap"]) == ((DONE, pytest.approx(1.0)), (ACTIVE, None))
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file() and path.suffix != ".parquet"]
    assert report["logs_bytes"] == sum(sizes) and 0 < report["free_bytes"] < report["disk_bytes"]
    assert main.main(["log", "list", str(folder)]) == exit_codes.OK
    assert "broken: damaged" in capsys.readouterr().out


def test_recovery_of_a_folder_skips_logs_that_are_being_written(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    living = make_log(folder, "3.mcap")
    assert main.main(["log", "recover", str(folder), "--json"]) == exit_codes.OK
    printed = capsys.readouterr()
    (log,) = json.loads(printed.out)["recovered"]
    assert (log["path"], log["rows"], log["lost"], printed.err) == (str(folder / DONE / "2.mcap"), 381, 0, "")
    assert read_log(folder / DONE / "2.mcap").complete
    assert main.main(["log", "list", str(folder), "--json"]) == exit_codes.OK
    assert [log["recovered"] for log in json.loads(capsys.readouterr().out)["logs"]] == [False, True, False]
    assert main.main(["log", "recover", str(folder)]) == exit_codes.OK
    assert capsys.readouterr().out == "nothing to recover\n"
    living.finish()


def test_several_logs_are_preserved_even_if_one_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_log(folder, "3.mcap").finish()
    names = [str(folder / place / name) for place, name in ((ACTIVE, "2.mcap"), (DONE, "1.mcap"), (DONE, "3.mcap"))]
    assert main.main(["log", "preserve", *names]) == exit_codes.REFUSED
    assert "only a log in done/" in capsys.readouterr().err
    assert sorted(path.name for path in (folder / PRESERVED).iterdir()) == ["1.mcap", "3.mcap"]
    assert main.main(["log", "preserve", "--undo", str(folder / PRESERVED / "1.mcap")]) == exit_codes.OK
    assert capsys.readouterr().out == f"{folder / DONE / '1.mcap'}\n" and (folder / DONE / "1.mcap").exists()


def test_a_user_who_may_not_read_or_move_a_log_gets_advice(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The refusal of the kernel is simulated because the tests may run as root."""

    def refuse(path: Path, *_: object) -> Path:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    log = str(folder / DONE / "1.mcap")
    for name in ("open", "rename"):
        monkeypatch.setattr(Path, name, refuse)
    assert main.main(["log", "info", log]) == exit_codes.UNHEALTHY
    assert f"have root add you to the group of {log}, then log in again, or do this as root" in capsys.readouterr().err
    assert main.main(["log", "preserve", log]) == exit_codes.UNHEALTHY
    assert capsys.readouterr().err.endswith(
        "1.mcap: only the daemon's own user and root may change logs: do this as root\n"
    )


def test_the_configured_folder_is_the_default(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")
    configuration = folder / "mudskipper.toml"
    configuration.write_text(text.replace("/var/lib/mudskipper/logs", str(folder)), encoding="utf-8")
    assert main.main(["log", "list", "--config", str(configuration)]) == exit_codes.OK
    assert "1.mcap" in capsys.readouterr().out
    assert main.main(["log", "recover", "--config", str(folder / "none.toml")]) == exit_codes.UNHEALTHY
