"""The public package and the examples do what their documentation says."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import mudskipper
from control.records import Phase
from firmware_host.log.log_file import LogFile
from logs.files.log_reader import read_log
from logs.replay import replay_files
from tests.firmware_host.synthetic_rows import OPENING
from tests.folders import ROOT
from tests.waiting import LONGEST_S

LOG = ROOT / "tests/fixtures/walk_0_1.mcap"


def run_example(name: str, *arguments: str, **environment: str) -> str:
    command = [sys.executable, str(ROOT / "examples" / name), *arguments]
    known = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    ended = subprocess.run(command, env=known, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_a_log_is_arrays_by_field_name() -> None:
    log, read = mudskipper.open_log(LOG), read_log(LOG)
    assert log.ticks["angle_rad"].shape == (len(read.ticks), 4)
    assert log.ticks["phase"].max() >= Phase.SWING
    assert log.strides["k_p"].tolist() == [stride["k_p"] for stride in read.strides]
    assert log.events["text"].tolist() == [event["text"] for event in read.events]
    assert log.configuration.robot.name == "mudskipper" and log.metadata["robot"] == "test"
    assert log.complete and not log.unknown_fields
    shown = str(log).splitlines()
    assert len(shown) <= 10 and f"{len(log.ticks)} rows" in str(log) and "whole" in shown[-1]


def test_a_log_without_strides_has_their_fields(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "rest.mcap", OPENING)
    log.finish()
    opened = mudskipper.open_log(str(log.path))
    assert len(opened.strides["k_p"]) == len(opened.events["text"]) == len(opened.ticks) == 0


def test_a_replay_is_that_of_the_command() -> None:
    expected = repr(replay_files([LOG]).strides)  # as text, because NaN is not equal to NaN
    assert repr(mudskipper.replay(LOG).strides) == expected
    assert repr(mudskipper.replay(str(LOG), method="paper").strides) != expected


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(mudskipper.LogError):
        mudskipper.open_log(tmp_path / "none.mcap")


def test_without_a_daemon_the_client_says_so(short_folder: Path) -> None:
    with pytest.raises(mudskipper.NoDaemonError):
        mudskipper.Client(short_folder / "none.sock")


def test_forces_are_plotted(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert "6 strides" in run_example("plot_forces.py", str(LOG), str(tmp_path / "forces.png"))
    assert (tmp_path / "forces.png").stat().st_size > 10_000


def test_methods_are_compared_stride_by_stride() -> None:
    lines = run_example("compare_methods.py", str(LOG)).splitlines()
    assert len(lines) == 7 and lines[1].split()[:2] == ["left", "0"]
