"""`mudskipper log report`: one page of any log, whatever it holds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main
from firmware_host.configuration import Configuration
from firmware_host.file_recorder import FileRecorder
from firmware_host.log_reader import read_log
from simulation.clay import MUDS
from simulation.lockstep import Lockstep
from simulation.track import Track

LAB_LOGS = Path(__file__).parents[3] / "shared" / "data" / "flipper_in_mud"


def test_the_page_shows_every_walk_stride_and_event(
    two_walks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "report"
    assert main(["log", "report", str(two_walks), "--out", str(folder), "--json"]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    log = read_log(two_walks)
    assert len(report["strides"]) == len(log.strides) > 0 and report["summary"]["ticks"] == len(log.ticks)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<td>left</td>") + page.count("<td>right</td>") == len(log.strides)
    assert page.count("data:image/png") == 4 and all((folder / f"walk-{walk}.png").exists() for walk in (1, 2))
    assert all(event["text"] in page.replace("&#x27;", "'") for event in log.events)
    assert (folder / "two.mcap").read_bytes() == two_walks.read_bytes()


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
    assert "No complete stride." in page and "nobody walked in this log" in page


def test_a_log_that_cannot_be_read_is_told_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x.mcap").write_bytes(b"nothing")
    status = main(["log", "report", str(tmp_path / "x.mcap"), "--out", str(tmp_path / "r")])
    assert status == exit_codes.UNHEALTHY
    assert "this is not how an MCAP file begins" in capsys.readouterr().err


@pytest.mark.skipif(not LAB_LOGS.exists(), reason="the authors' logs are not beside the project")
def test_the_authors_logs_have_a_page_too(tmp_path: Path) -> None:
    log = LAB_LOGS / "single_12.5N_trial5.csv.gz"
    assert main(["log", "report", str(log), "--out", str(tmp_path)]) == exit_codes.OK
    assert "strides-1" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "strides-1.png").exists() and (tmp_path / log.name).exists()
