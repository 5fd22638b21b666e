"""`mudskipper log report` makes one page of any log, and one page that compares several runs."""

import json
import re
import shutil
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.logs import log_report
from control.controller import WalkOrder
from control.records import JOINTS
from experiments.run_report import run as run_module
from experiments.study.result import Result
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log, read_log
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.command_line.command_lines import failure, json_of, output, run
from tests.folders import SHARED_DATA
from tests.full_disk import files_of_at_most
from tests.recorded_walks import record_walks

pytestmark = pytest.mark.usefixtures("png_alone")

UPTIME_S = 36384.0
LAB_LOGS = SHARED_DATA / "flipper_in_mud"


def test_the_page_shows_every_walk_stride_and_event(two_walks: Path, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    report = json_of("log", "report", str(two_walks), "--out", str(folder))
    assert report == json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert report["schema"] == "log-report/1"
    log = read_log(two_walks)
    assert len(report["strides"]) == len(report["fits"]) == len(log.strides) > 0
    assert report["summary"]["ticks"] == len(log.ticks) and report["log"] == [two_walks.name]
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert [each["joint"] for each in report["supply"]] == [*JOINTS] and "lowest supply (V)" in page
    assert page.count("data:image/png") == 7  # two of each of the two walks, fits, paths, and directions
    pictures = {"walk-1", "walk-2", "strides-1", "strides-2", "fits", "paths", "directions"}
    assert {path.stem for path in folder.glob("*.png")} == pictures
    assert (folder / "two.mcap").read_bytes() == two_walks.read_bytes()


def shown(monkeypatch: pytest.MonkeyPatch, *words: str) -> tuple[dict[str, str], dict[str, list[list[str]]]]:
    """Return the texts and the tables of the page by their sections or titles, without its pictures."""
    results: list[Result] = []

    def take(folder: Path, result: Result, *_: object, **__: object) -> list[Path]:
        results.append(result)
        return []

    monkeypatch.setattr(log_report, "write_result", take)
    output("log", "report", *words)
    (result,) = results
    return dict(result.texts), {table.title or table.section: table.cells() for table in result.tables}


def test_times_count_from_the_log_s_begin_however_long_the_computer_is_up(
    two_walks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = (str(two_walks), "--out", str(tmp_path))
    before = shown(monkeypatch, *words)
    monkeypatch.setattr(run_module, "scan_log", lambda path, *_: after(read_log(path), UPTIME_S))
    assert shown(monkeypatch, *words) == before


def after(log: Log, uptime_s: float) -> Log:
    """Return the same log as if the computer had been up for longer by `uptime_s`."""
    ticks = log.ticks.copy()
    ticks["stamp_s"] += uptime_s
    strides = [row | {name: row[name] + uptime_s for name in ("stamp_s", "t_start_s")} for row in log.strides]
    events = [row | {"stamp_s": row["stamp_s"] + uptime_s} for row in log.events]
    booted_ns = int(log.metadata["wall_minus_monotonic_ns"]) - int(1e9 * uptime_s)
    metadata = log.metadata | {"wall_minus_monotonic_ns": str(booted_ns)}
    return log._replace(metadata=metadata, ticks=ticks, strides=strides, events=events)


def test_muds_have_the_names_they_are_given(two_walks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The operator names a mud by name and length or by a world file; a mud without a name is described by its k_p.

    Both walks are in one mud, as only a name can say.
    """
    out = ("--out", str(tmp_path))
    _, first, second = shown(monkeypatch, str(two_walks), *out)[1]["Result"]
    assert re.fullmatch(r"k_p 1\.\d N/cm³", first[0]) and second[0] == f"{first[0]}, walk 2"
    _, named = shown(monkeypatch, str(two_walks), *out, "--mud", "pond=60")[1]["Result"]
    assert named[0] == "pond" and int(named[1]) == int(first[1]) + int(second[1])
    world = tmp_path / "world.toml"
    world.write_text(
        "[[segment]]\nstart_m = 0.0\nend_m = 0.5\nwater_percent = 48.5\n"
        "[[segment]]\nstart_m = 0.5\nend_m = 1.0\nwater_percent = 50.0\n",
        encoding="utf-8",
    )
    _, known = shown(monkeypatch, str(two_walks), *out, "--world", str(world))[1]["Result"]
    assert known == ["w = 48.5 %", *named[1:]]


def test_a_log_that_is_cut_off_before_its_first_stride_ends_is_named_in_headline_json_and_exit_status(
    configuration: Configuration, tmp_path: Path
) -> None:
    path = tmp_path / "cut.mcap"
    recorder = FileRecorder(path, configuration)
    robot = Lockstep(configuration, Track([(5.0, MUDS["48.5"])]), recorder=recorder)
    robot.arm()
    robot.walk(WalkOrder(0.03, True, 1))
    robot.run_for(0.3)
    recorder.close()
    path.write_bytes(path.read_bytes()[:-100])
    ended = run("log", "report", str(path), "--out", str(tmp_path / "page"), "--json")
    report = json.loads(ended.stdout)
    assert ended.returncode == exit_codes.UNHEALTHY and report["headline"]["complete"] is False
    assert report["strides"] == [] and (tmp_path / "page" / "walk-1.png").exists()
    assert ended.stderr.startswith("cut ends early: ")


@pytest.mark.skipif(not LAB_LOGS.exists(), reason="the authors' logs are not next to the project")
def test_the_authors_logs_have_a_page_too_with_the_mud_of_their_name(tmp_path: Path) -> None:
    log = LAB_LOGS / "single_12.5N_trial5.csv.gz"
    output("log", "report", str(log), "--out", str(tmp_path))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<td>12.5 N</td>" in page and "No fault" not in page
    assert (tmp_path / "strides-1.png").exists() and (tmp_path / log.name).exists()


# several runs


def test_runs_are_compared_on_one_page_with_one_table_and_one_figure(
    two_walks: Path, tmp_path: Path, configuration: Configuration
) -> None:
    """Both runs are in the same simulated mud, so no coefficient differs."""
    another, out = tmp_path / "another.mcap", tmp_path / "out"
    record_walks(another, configuration, 3)
    report = json_of("log", "report", str(two_walks), str(another), "--mud", "48.5=60", "--out", str(out))
    assert report["schema"] == "log-comparison/1"
    assert [each["run"] for each in report["runs"]] == ["two", "another"]
    quantities = {each["quantity"]: each for each in report["differences"]}
    assert set(quantities) == {"speed", "k_p", "k_e"}  # k_s is a bound in both
    for name in ("k_p", "k_e"):
        assert abs(quantities[name]["difference"]) < 3.0 * quantities[name]["std_error"]
        assert quantities[name]["difference"] == quantities[name]["other"] - quantities[name]["first"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png") == 1 and page.count("<table>") == 2
    names = {path.name for path in out.iterdir()}
    assert names == {"report.html", "summary.json", "two.mcap", "another.mcap", "comparison.png"}


# bad input gives one sentence each


def test_logs_that_cannot_be_read_are_refused_by_name(two_walks: Path, tmp_path: Path) -> None:
    text, broken, missing, table = (tmp_path / name for name in ("notes.txt", "broken.mcap", "missing.mcap", "t.csv"))
    text.write_text("no log", encoding="utf-8")
    table.write_text("a,b\n1,2\n", encoding="utf-8")
    contents = two_walks.read_bytes()
    broken.write_bytes(contents[: len(contents) // 2] + bytes(4000) + contents[len(contents) // 2 + 4000 :])
    for path in (text, broken, missing, table):
        for words in ([str(path)], [str(two_walks), str(path)]):
            message = failure("log", "report", *words, "--out", str(tmp_path / "out"))
            assert message.startswith(f"mudskipper: {path}: ")
    assert not (tmp_path / "out").exists()


def test_a_log_given_twice_an_unwritable_folder_and_a_full_disk_are_refused(two_walks: Path, tmp_path: Path) -> None:
    log, other = str(two_walks), str(shutil.copy(two_walks, tmp_path))
    assert f"{log}: given twice" in failure("log", "report", log, log)
    assert f"{other}: has the name of {log}" in failure("log", "report", log, other)
    (tmp_path / "file").touch()
    assert "Not a directory" in failure("log", "report", log, "--out", str(tmp_path / "file" / "out"))
    with files_of_at_most(1000):
        assert str(tmp_path / "out") in failure("log", "report", log, "--out", str(tmp_path / "out"))


@pytest.mark.skipif(not LAB_LOGS.exists(), reason="the authors' logs are not next to the project")
def test_several_muds_need_a_position(tmp_path: Path) -> None:
    log = str(LAB_LOGS / "single_12.5N_trial5.csv.gz")
    words = ("--mud", "48.5", "--mud", "53.1", "--out", str(tmp_path))
    assert "no position of the body" in failure("log", "report", log, *words)
