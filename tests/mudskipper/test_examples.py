"""The public package and the examples do what their documentation says."""

import doctest
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mudskipper
import mudskipper.gym
import mudskipper.logs
from control.records import Phase, Rig
from firmware_host.log.log_file import LogFile
from firmware_host.log.rows import TICK_KIND, tick_kind
from logs.files.log_reader import read_log
from logs.replay import replay_files
from tests.firmware_host.synthetic_rows import OPENING, encode_row
from tests.folders import ROOT
from tests.waiting import LONGEST_S

LOG = ROOT / "tests/fixtures/walk_0_1.mcap"


def run_example(name: str, *arguments: str, **environment: str) -> str:
    command = [sys.executable, str(ROOT / "examples" / name), *arguments]
    known = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    ended = subprocess.run(command, env=known, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def log() -> mudskipper.OpenedLog:
    return mudskipper.open_log(LOG)


@pytest.mark.parametrize("module", [mudskipper.logs, mudskipper.gym], ids=["logs", "gym"])
def test_the_examples_of_the_reference_run(module: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "walk.mcap").symlink_to(LOG)
    monkeypatch.chdir(tmp_path)
    results = doctest.testmod(module)
    assert results.attempted and not results.failed


def test_a_log_is_arrays_by_field_name(log: mudskipper.OpenedLog) -> None:
    read = read_log(LOG)
    assert log.ticks["angle_rad"].shape == (len(read.ticks), 4)
    assert log.ticks["phase"].max() >= Phase.SWING
    assert log.strides["k_p"].tolist() == [stride["k_p"] for stride in read.strides]
    assert log.events["text"].tolist() == [event["text"] for event in read.events]
    assert log.configuration.robot.name == "mudskipper" and log.metadata["robot"] == "test"
    assert log.complete and not log.unknown_fields
    shown = str(log).splitlines()
    assert len(shown) <= 10 and f"{len(log.ticks)} rows" in str(log) and "whole" in shown[-1]
    assert "trial    not described" in shown
    assert "trial    mud A, trial 3" in str(replace(log, metadata={"trial": '{"mud": "A", "trial": "3"}'})).splitlines()


def test_ticks_become_a_table_with_a_column_for_each_joint(log: mudskipper.OpenedLog) -> None:
    frame = log.ticks.to_pandas()
    assert isinstance(frame, pd.DataFrame) and len(frame) == len(log.ticks)
    assert frame["right_adduction_angle_rad"].tolist() == log.ticks["angle_rad"][:, 3].tolist()
    assert frame.attrs["units"]["right_adduction_angle_rad"] == "rad"
    stance = frame[frame["phase"] == "stance"]
    assert len(stance) == np.count_nonzero(log.ticks["phase"] == Phase.STANCE)


def test_strides_and_events_become_tables(log: mudskipper.OpenedLog) -> None:
    assert log.strides.to_pandas().groupby("flipper", observed=True)["k_s"].count().to_dict() == {"left": 3, "right": 3}
    assert log.events.to_pandas()["text"].str.startswith("request walk").sum() == 1


def test_a_log_and_its_replay_come_whole_from_another_process(log: mudskipper.OpenedLog) -> None:
    came: mudskipper.OpenedLog = pickle.loads(pickle.dumps(log))
    assert came.ticks.to_pandas().equals(log.ticks.to_pandas()) and str(came) == str(log)
    replayed = mudskipper.replay(LOG)
    assert repr(pickle.loads(pickle.dumps(replayed)).fits[0].k_p()) == repr(replayed.fits[0].k_p())


def test_selected_rows_become_a_table_too_with_their_time(log: mudskipper.OpenedLog) -> None:
    walking = log.ticks[log.ticks["stride"] >= 0]
    frame = walking.to_pandas()
    assert len(frame) == len(walking) < len(log.ticks)
    assert frame.index[0] == log.ticks.to_pandas().index[int(np.argmax(log.ticks["stride"] >= 0))]
    assert str(frame.index[0])[:19] == "2026-11-22 14:50:22" and str(frame.index.tz) == "UTC"


def test_fields_without_the_stamp_become_a_table_with_numbered_rows(log: mudskipper.OpenedLog) -> None:
    for chosen in (mudskipper.open_log(LOG, fields=["mode", "stride"]).ticks, log.ticks[["mode", "stride"]]):
        frame = chosen.to_pandas()
        assert [*frame.columns] == ["mode", "stride"] and frame.index[-1] == len(log.ticks) - 1
    for fields in ("mode", iter(["mode"])):
        assert mudskipper.open_log(LOG, fields=fields).ticks.dtype.names == ("mode",)


def test_no_log_at_all_is_refused_with_a_sentence() -> None:
    for read in (mudskipper.open_log, mudskipper.replay):
        with pytest.raises(mudskipper.LogError, match="no log is given"):
            read([])


def test_a_column_is_a_plain_array(log: mudskipper.OpenedLog) -> None:
    assert type(log.ticks["stamp_s"]) is type(log.ticks["angle_rad"]) is np.ndarray


def test_a_log_without_strides_has_their_fields(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "rest.mcap", OPENING)
    log.finish()
    opened = mudskipper.open_log(str(log.path))
    assert len(opened.strides["k_p"]) == len(opened.events["text"]) == len(opened.ticks) == 0


def test_a_replay_is_that_of_the_command() -> None:
    expected = repr(replay_files([LOG]).strides)  # as text, because NaN is not equal to NaN
    assert repr(mudskipper.replay(LOG).strides) == expected
    assert repr(mudskipper.replay(str(LOG), method="paper").strides) != expected


@pytest.mark.parametrize("wrong", [{"method": "Paper"}, {"vertical": "up"}])
def test_a_method_or_an_axis_that_does_not_exist_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must be one of"):
        mudskipper.replay(LOG, **wrong)


def test_forces_are_plotted(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert "6 strides" in run_example("plot_forces.py", str(LOG), str(tmp_path / "forces.png"))
    assert (tmp_path / "forces.png").stat().st_size > 10_000


def test_forces_of_a_single_flipper_are_plotted(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    log = LogFile(tmp_path / "right.mcap", OPENING | {"flippers": ["right"]})
    log.write([(TICK_KIND, encode_row(tick_kind(Rig(("right",)))))])
    log.finish()
    assert "1 ticks and 0 strides" in run_example("plot_forces.py", str(log.path), str(tmp_path / "forces.png"))


def test_methods_are_compared_stride_by_stride() -> None:
    lines = run_example("compare_methods.py", str(LOG)).splitlines()
    assert len(lines) == 7 and lines[1].split()[:2] == ["left", "0"]
