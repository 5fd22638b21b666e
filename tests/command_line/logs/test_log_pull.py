"""`mudskipper log pull` copies finished logs once, marks them, and continues; rsync is a double."""

import os
import sys
import time
from pathlib import Path

import pytest

from command_line import exit_codes
from firmware_host.log.log_folder import copies_text
from tests.command_line.command_lines import json_of, run, run_process
from tests.folders import ROOT

RSYNC = """#!{python}
import fnmatch, pathlib, shutil, signal, sys, os
*sources, target = [each for each in sys.argv[1:] if not each.startswith("-")]
target, left = pathlib.Path(target.split(":")[-1]), int(os.environ.get("COPIES", "99"))
if "--dry-run" in sys.argv:
    source = pathlib.Path(sources[0].split(":")[-1])
    wanted = [each.removeprefix("--include=") for each in sys.argv]
    for log in sorted(target.glob("[dk]*/*.mcap")):
        theirs = source / log.parent.name / log.name
        if theirs.exists() and any(fnmatch.fnmatchcase(f"/{log.parent.name}/{log.name}", each) for each in wanted):
            same = theirs.read_bytes() == log.read_bytes()
            print(".f         " if same else ">fc........", theirs.relative_to(source), sep=":")
    sys.exit()
known = [each.partition("=")[2] for each in sys.argv if each.startswith("--exclude-from=")]
known = pathlib.Path(*known).read_text().splitlines() if known else []
for source in map(pathlib.Path, (each.split(":")[-1] for each in sources)):
    if source.name == "copied":
        shutil.copytree(source, target / "copied", dirs_exist_ok=True)
        continue
    for log in sorted([*source.glob("done/*.mcap"), *source.glob("kept/*.mcap")]):
        if any(fnmatch.fnmatchcase(f"/{log.parent.name}/{log.name}", each) for each in known):
            continue
        present = target / log.parent.name / log.name
        if present.exists() and present.stat().st_mtime == log.stat().st_mtime:
            continue
        if (left := left - 1) < 0:
            if "INTERRUPT" in os.environ:
                os.kill(os.getppid(), signal.SIGINT)
                signal.pause()
            sys.exit("ssh: connect to host robot port 22: No route to host")
        (target / log.parent.name).mkdir(exist_ok=True)
        shutil.copy2(log, target / log.parent.name)
"""


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of logs of a robot that a double of rsync reaches."""
    program = tmp_path / "bin" / "rsync"
    program.parent.mkdir()
    program.write_text(RSYNC.replace("{python}", sys.executable))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent))
    monkeypatch.chdir(tmp_path)
    logs = tmp_path / "robot"
    for place, name in (("done", "1"), ("done", "2"), ("kept", "3"), ("active", "4")):
        (logs / place).mkdir(parents=True, exist_ok=True)
        (logs / place / f"{name}.mcap").write_text(name)
    return logs


def pulled(robot: Path) -> list[str]:
    """Pull the logs, and return the names of those that are new."""
    return [*json_of("log", "pull", f"host:{robot}", "here")["copied"]]


def test_finished_logs_are_copied_compared_and_marked_once(robot: Path) -> None:
    assert pulled(robot) == ["1.mcap", "2.mcap", "3.mcap"]
    assert {path.name for path in (robot / "copied").iterdir()} == {"1", "2", "3"}
    (robot / "done" / "5.mcap").touch()
    assert pulled(robot) == ["5.mcap"]


def test_a_log_that_was_preserved_on_either_side_is_not_copied_again(robot: Path) -> None:
    pulled(robot)
    (robot / "done" / "1.mcap").rename(robot / "kept" / "1.mcap")
    Path("here/done/2.mcap").rename("here/kept/2.mcap")
    assert pulled(robot) == []
    assert sorted(path.name for path in Path("here").rglob("*.mcap")) == ["1.mcap", "2.mcap", "3.mcap"]


def test_an_annotation_on_the_robot_reaches_the_copy_unless_that_was_annotated_too(robot: Path) -> None:
    def annotate(log: Path, text: str) -> None:
        log.write_text(text)
        os.utime(log, (time.time() + 10.0,) * 2)

    pulled(robot)
    assert copies_text(robot) == "0 of 2 not copied"
    for name in "12":
        annotate(robot / "done" / f"{name}.mcap", "theirs")
    annotate(Path("here/done/2.mcap"), "mine")
    assert copies_text(robot) == "2 of 2 not copied"
    assert pulled(robot) == ["1.mcap"]
    assert [Path(f"here/done/{name}.mcap").read_text() for name in "12"] == ["theirs", "mine"]
    assert copies_text(robot) == "1 of 2 not copied"


@pytest.mark.parametrize(
    ("environment", "status", "said"),
    [
        ({}, exit_codes.UNHEALTHY, "No route to host; 1 new log copied"),
        ({"INTERRUPT": "1"}, exit_codes.INTERRUPTED, "stopped; 1 new log copied"),  # Ctrl-C
    ],
)
def test_an_end_in_the_middle_costs_no_log(robot: Path, environment: dict[str, str], status: int, said: str) -> None:
    words = ("log", "pull", f"host:{robot}", "here")
    ended = run_process(*words, COPIES="1", PYTHONPATH=str(ROOT), **environment)
    assert ended.returncode == status and said in ended.stderr
    assert not (robot / "copied").exists()
    pulled(robot)
    assert len(list((robot / "copied").iterdir())) == 3


def test_a_log_whose_bytes_differ_is_not_marked(robot: Path) -> None:
    (robot / "done" / "2.mcap").rename(robot / "done" / "run [ü].mcap")  # as its operator named it
    Path("here/done").mkdir(parents=True)
    Path("here/done/run [ü].mcap").write_text("other")
    ended = run("log", "pull", str(robot), "here")
    assert ended.returncode == exit_codes.UNHEALTHY and "run [ü].mcap: differs" in ended.stderr
    assert Path("here/done/run [ü].mcap").read_text() == "other"
    assert {path.name for path in (robot / "copied").iterdir()} == {"1", "3"}


def test_a_log_that_this_robot_does_not_have_is_not_marked(robot: Path) -> None:
    Path("here/done").mkdir(parents=True)
    Path("here/done/0.mcap").write_text("of another robot, whose copy was interrupted")
    assert json_of("log", "pull", str(robot), "here")["copied"] == ["1.mcap", "2.mcap", "3.mcap"]
    assert not Path("here/copied/0").exists()


def test_without_rsync_or_a_robot_it_says_what_to_do(robot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "'none:'" in run("log", "pull", "none").stderr
    monkeypatch.setenv("PATH", "/none")
    assert "apt install rsync" in run("log", "pull", "host:").stderr
    assert not Path("robot-logs").exists()
