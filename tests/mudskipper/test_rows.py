"""Rows of an opened log are numpy arrays that become pandas tables."""

import numpy as np
import pandas as pd
import pytest

import mudskipper
from control.records import Phase
from tests.folders import ROOT


@pytest.fixture(scope="module")
def log() -> mudskipper.OpenedLog:
    return mudskipper.open_log(ROOT / "tests/fixtures/walk_0_1.mcap")


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


def test_selected_rows_become_a_table_too_with_their_time(log: mudskipper.OpenedLog) -> None:
    walking = log.ticks[log.ticks["stride"] >= 0]
    frame = walking.to_pandas()
    assert len(frame) == len(walking) < len(log.ticks)
    assert frame.index[0] == log.ticks.to_pandas().index[int(np.argmax(log.ticks["stride"] >= 0))]
    assert str(frame.index[0])[:19] == "2026-11-22 14:50:22" and str(frame.index.tz) == "UTC"


def test_a_column_is_a_plain_array(log: mudskipper.OpenedLog) -> None:
    assert type(log.ticks["stamp_s"]) is type(log.ticks["angle_rad"]) is np.ndarray
