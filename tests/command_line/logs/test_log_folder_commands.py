"""The commands that list, recover and preserve the logs of a folder."""

import errno
import os
from pathlib import Path

import pytest

from command_line import exit_codes
from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import ACTIVE, DONE, PRESERVED
from logs.files.log_reader import read_log
from tests.command_line.command_lines import failure, json_of, output, run
from tests.firmware_host.synthetic_rows import OPENING, make_ticks
from tests.folders import EXAMPLE_CONFIGURATION


def make_log(folder: Path, name: str) -> LogFile:
    log = LogFile(folder / ACTIVE / name, OPENING)
    log.write(make_ticks(0, 381))
    log.flush()
    return log


def states_in(folder: Path) -> dict[str, str]:
    return {log["name"]: log["state"] for log in json_of("log", "list", str(folder))["logs"]}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a finished log and one whose writer was killed."""
    make_log(tmp_path, "1.mcap").finish()
    make_log(tmp_path, "2.mcap")._file.close()
    return tmp_path


def test_a_log_that_is_being_written_is_not_taken_for_one_that_was_cut_off(tmp_path: Path) -> None:
    log = make_log(tmp_path, "1.mcap")
    assert states_in(tmp_path) == {"1.mcap": "being written"}
    assert "recover" not in output("log", "list", str(tmp_path))
    log.finish()  # the listing left its lock in place
    assert states_in(tmp_path) == {"1.mcap": "whole"}


def test_incomplete_logs_are_listed_and_counted(folder: Path) -> None:
    contents = (folder / DONE / "1.mcap").read_bytes()
    (folder / DONE / "0.mcap").write_bytes(contents[:-100])
    (folder / "00.mcap").write_bytes(contents)
    for name in ("3.mcap.broken", "4.mcap.part", "notes.txt"):
        (folder / ACTIVE / name).write_bytes(bytes(100))
    assert states_in(folder) == {
        "00.mcap": "copy",
        "0.mcap": "broken",
        "1.mcap": "whole",
        "2.mcap": "unfinished",
        "3.mcap.broken": "broken",
        "4.mcap.part": "unfinished",
        "notes.txt": "no log",
    }
    report = json_of("log", "list", str(folder))
    known = {log["name"]: (log["place"], log["duration_s"]) for log in report["logs"]}
    assert (known["1.mcap"], known["2.mcap"]) == ((DONE, pytest.approx(1.0)), (ACTIVE, None))
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file() and path.suffix != ".parquet"]
    assert report["logs_bytes"] == sum(sizes) and 0 < report["free_bytes"] < report["disk_bytes"]
    assert "broken: damaged" in output("log", "list", str(folder))


def test_logs_are_listed_in_the_order_of_their_segments(tmp_path: Path) -> None:
    names = ["run-9999.mcap", "run-10000.mcap", "runs-0000.mcap"]
    (tmp_path / DONE).mkdir()
    for name in reversed(names):
        (tmp_path / DONE / name).write_bytes(b"no log")
    assert [*states_in(tmp_path)] == names


def test_recovery_of_a_folder_skips_logs_that_are_being_written(folder: Path) -> None:
    living = make_log(folder, "3.mcap")
    (cut := folder / ACTIVE / "2.mcap").rename(cut.with_name("2.mcap.broken"))
    cut.with_name("2.mcap.part").write_bytes(b"half")  # a recovery that was cut off, which this one replaces
    (log,) = json_of("log", "recover", str(folder))["recovered"]
    assert (log["path"], log["rows"], log["lost"]) == (str(folder / DONE / "2.mcap"), 381, 0)
    assert read_log(folder / DONE / "2.mcap").complete
    assert [log["recovered"] for log in json_of("log", "list", str(folder))["logs"]] == [False, True, False]
    assert output("log", "recover", str(folder)) == "nothing to recover\n"
    living.finish()


def test_a_finished_log_that_broke_is_recovered_by_its_name_as_the_listing_says(folder: Path) -> None:
    broken = folder / DONE / "1.mcap"
    broken.write_bytes(broken.read_bytes()[:-100])
    assert "'log recover FILE'" in output("log", "list", str(folder))
    assert broken.name not in output("log", "recover", str(folder))
    assert json_of("log", "recover", str(broken))["recovered"][0]["rows"] == 381


def test_several_logs_are_preserved_even_if_one_fails(folder: Path) -> None:
    make_log(folder, "3.mcap").finish()
    names = [str(folder / place / name) for place, name in ((ACTIVE, "2.mcap"), (DONE, "1.mcap"), (DONE, "3.mcap"))]
    ended = run("log", "preserve", *names)
    assert ended.returncode == exit_codes.REFUSED and "only a log in done/" in ended.stderr
    assert sorted(path.name for path in (folder / PRESERVED).iterdir()) == ["1.mcap", "3.mcap"]
    assert output("log", "preserve", "--undo", str(folder / PRESERVED / "1.mcap")) == f"{folder / DONE / '1.mcap'}\n"
    assert (folder / DONE / "1.mcap").exists()


def test_a_user_who_may_not_read_or_move_a_log_gets_advice(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The refusal of the kernel is simulated because the tests may run as root."""

    def refuse(path: Path, *_: object) -> Path:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    log = str(folder / DONE / "1.mcap")
    for name in ("open", "rename"):
        monkeypatch.setattr(Path, name, refuse)
    assert f"the group of {log}" in failure("log", "info", log)
    assert "1.mcap: " in (message := failure("log", "preserve", log)) and message.endswith("as root")


def test_the_folder_of_the_service_is_the_default(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its unit, or a drop-in of it, names the configuration."""
    text = EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")
    configuration = folder / "mudskipper.toml"
    configuration.write_text(text.replace("/var/lib/mudskipper/logs", str(folder)), encoding="utf-8")
    assert "1.mcap" in output("log", "list", "--config", str(configuration))
    (folder / "unit").write_text(f"ExecStart=/x --config {configuration}\n", encoding="utf-8")
    monkeypatch.setattr("firmware_host.configuration.service_file.UNIT", str(folder / "unit"))
    assert "1.mcap" in output("log", "list")
    assert run("log", "recover", "--config", str(folder / "none.toml")).returncode == exit_codes.UNHEALTHY
