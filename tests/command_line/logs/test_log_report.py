"""`mudskipper log report`: one page of any log, whatever it holds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.logs import log_report
from command_line.main import main
from experiments.pictures import recorded_walk
from experiments.reports.report_page import Section
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.file_recorder import FileRecorder
from firmware_host.log_reading import replay
from firmware_host.log_reading.log_reader import Log, read_log
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.folders import SHARED_DATA

UPTIME_S = 36384.0
LAB_LOGS = SHARED_DATA / "flipper_in_mud"


def test_the_page_shows_every_walk_stride_and_event(
    two_walks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "report"
    assert main(["log", "report", str(two_walks), "--out", str(folder), "--json"]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    assert report == {"schema": "log-report/1"} | json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    log = read_log(two_walks)
    assert len(report["strides"]) == len(log.strides) > 0 and report["summary"]["ticks"] == len(log.ticks)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<td>left</td>") + page.count("<td>right</td>") == len(log.strides)
    assert page.count("data:image/png") == 4 and all((folder / f"walk-{walk}.png").exists() for walk in (1, 2))
    assert all(event["text"] in page.replace("&#x27;", "'") for event in log.events)
    assert (folder / "two.mcap").read_bytes() == two_walks.read_bytes()


def reported_pages(log: Path, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, Sequence[Sequence[str]]]]:
    """What a page would show, without its pictures."""
    pages: list[Section] = []

    def take(folder: Path, report: dict[str, Any], title: str, sections: list[Section], logs: list[Path]) -> list[Path]:
        pages.extend(sections)
        return logs

    monkeypatch.setattr(log_report, "write_report", take)
    assert main(["log", "report", str(log), "--out", str(log.parent / "report")]) == exit_codes.OK
    return [(section.heading, section.text, section.rows) for section in pages]


def test_people_are_told_times_since_the_log_s_begin_however_long_the_computer_is_up(
    two_walks: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def read_later(path: Path, *_: object) -> Log:
        return after(read_log(path), UPTIME_S)

    before = reported_pages(two_walks, monkeypatch)
    capsys.readouterr()
    assert main(["replay", str(two_walks)]) == exit_codes.OK
    strides = capsys.readouterr().out
    monkeypatch.setattr(recorded_walk, "read_log", read_later, raising=False)
    for module in (log_report, recorded_walk, replay):
        monkeypatch.setattr(module, "read_logs", lambda paths, *_: read_later(paths[0]), raising=False)
    assert reported_pages(two_walks, monkeypatch) == before
    capsys.readouterr()
    assert main(["replay", str(two_walks)]) == exit_codes.OK
    assert capsys.readouterr().out == strides
    (second,) = (text for heading, text, _ in before if heading == "Walk 2")
    assert "Its pictures count from there" in second and not second.startswith("It begins 0.")


def after(log: Log, uptime_s: float) -> Log:
    """The same, of a computer that has been up for longer."""
    ticks = log.ticks.copy()
    ticks["stamp_s"] += uptime_s
    strides = [row | {name: row[name] + uptime_s for name in ("stamp_s", "t_start_s")} for row in log.strides]
    events = [row | {"stamp_s": row["stamp_s"] + uptime_s} for row in log.events]
    booted_ns = int(log.metadata["wall_minus_monotonic_ns"]) - int(1e9 * uptime_s)
    metadata = log.metadata | {"wall_minus_monotonic_ns": str(booted_ns)}
    return log._replace(metadata=metadata, ticks=ticks, strides=strides, events=events)


def test_a_log_without_a_walk_says_so(
    configuration: Configuration, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = FileRecorder(tmp_path / "rest.mcap", configuration)
    Lockstep(configuration, Track([(5.0, MUDS["48.5"])]), recorder=recorder).run_for(1.0)
    recorder.close()
    monkeypatch.chdir(tmp_path)
    assert main(["log", "report", "rest.mcap"]) == exit_codes.OK
    assert capsys.readouterr().out == "rest-report/report.html\n"
    page = Path("rest-report/report.html").read_text(encoding="utf-8")
    assert "No complete stride." in page and "there is no walk in this log" in page


@pytest.mark.skipif(not LAB_LOGS.exists(), reason="the authors' logs are not beside the project")
def test_the_authors_logs_have_a_page_too(tmp_path: Path) -> None:
    log = LAB_LOGS / "single_12.5N_trial5.csv.gz"
    assert main(["log", "report", str(log), "--out", str(tmp_path)]) == exit_codes.OK
    assert "strides-1" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "strides-1.png").exists() and (tmp_path / log.name).exists()
