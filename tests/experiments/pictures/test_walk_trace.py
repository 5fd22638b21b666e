"""Traces of long walks: no peak is lost, and strides begin, end and read as in the whole log."""

from pathlib import Path

import numpy as np
import pytest

from experiments.pictures import walk_trace
from experiments.pictures.recorded_walk import RecordedWalk, read_walk
from experiments.pictures.stride_choice import choose_strides, duration_s, moments_of, with_strides
from experiments.pictures.walk_trace import DRAWN, WalkTraces, rows_drawn, rows_of_curve
from logs.files.log_reader import read_log

BIN = 64


@pytest.fixture(scope="module")
def rows(two_walks: Path) -> walk_trace.Rows:
    """Of the first walk, whose position is not known for a while."""
    traces = WalkTraces(0, 1)
    traces.add(read_log(two_walks).ticks)
    rows = traces.walks[0].rows.copy()
    rows["body_x_m"][500:900] = np.nan
    return rows


def extremes(rows: walk_trace.Rows, name: str, bin_ticks: int) -> list[list[float]]:
    """First, last, smallest and largest known value of each bin that has one."""
    bins = rows["tick"] // bin_ticks
    found = []
    for values in np.atleast_2d(rows[name].T):
        for number in np.unique(bins):
            known = values[(bins == number) & np.isfinite(values)]
            found.append([known[0], known[-1], known.min(), known.max()] if len(known) else [])
    return found


@pytest.mark.parametrize("name", DRAWN)
def test_every_bin_has_the_extremes_and_the_ends_of_every_column(rows: walk_trace.Rows, name: str) -> None:
    once, twice = rows[rows_drawn(rows, BIN)], rows[rows_drawn(rows, BIN // 2)]
    twice = twice[rows_drawn(twice, BIN)]
    assert len(twice) <= len(once) < len(rows) / 2
    for trace in (once, twice):
        assert extremes(trace, name, BIN) == extremes(rows, name, BIN)


def test_a_trace_has_the_rows_at_which_the_phase_changes(rows: walk_trace.Rows) -> None:
    trace = rows[rows_drawn(rows, 4096)]
    changes = np.flatnonzero(np.diff(rows["phase"]))
    assert len(changes) > 5
    assert {*rows["tick"][changes], *rows["tick"][changes + 1]} <= set(trace["tick"].tolist())


def test_blocks_of_any_size_give_the_same_walks(two_walks: Path) -> None:
    ticks, found = read_log(two_walks).ticks, []
    for size in (len(ticks), 700, 1):
        traces = WalkTraces(len(ticks))
        for start in range(0, len(ticks), size):
            traces.add(ticks[start : start + size])
        found.append([(walk.first_row, walk.start_s) for walk in traces.walks])
    assert len(found[0]) == 2 and found[0] == found[1] == found[2]


def test_a_long_log_has_hardly_more_rows_than_a_picture_needs(two_walks: Path) -> None:
    ticks, traces = read_log(two_walks).ticks.copy(), WalkTraces(1_000_000)
    for _ in range(1_000_000 // len(ticks)):
        traces.add(ticks)
        ticks["tick"] += len(ticks)
    changes = sum(np.count_nonzero(np.diff(walk.rows["phase"])) for walk in traces.walks)
    assert sum(len(walk.rows) for walk in traces.walks) < 1.5 * walk_trace.MOST_ROWS + 2 * walk_trace.AROUND * changes


def both(path: Path, number: int, monkeypatch: pytest.MonkeyPatch) -> tuple[RecordedWalk, RecordedWalk]:
    """A walk, whole and as a trace."""
    whole = read_walk(path, number)
    monkeypatch.setattr(walk_trace, "MOST_ROWS", 300)
    trace = read_walk(path, number)
    assert whole.source is None and trace.source is not None and len(trace.time_s) < len(whole.time_s) / 2
    return whole, trace


@pytest.mark.parametrize("number", [1, 2])
def test_strides_of_a_trace_are_those_of_the_walk(
    two_walks: Path, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, trace = both(two_walks, number, monkeypatch)
    strides = choose_strides(whole)
    assert strides and repr(choose_strides(trace)) == repr(strides)
    assert [duration_s(trace, stride) for stride in strides] == [duration_s(whole, stride) for stride in strides]
    detailed = with_strides(trace, strides)
    for stride in strides:
        shown = [
            [(each.caption, walk.time_s[each.row]) for each in moments_of(walk, stride)] for walk in (whole, detailed)
        ]
        assert shown[0] == shown[1] and len(shown[0]) > 4
    for side, same in zip(whole.sides, detailed.sides, strict=True):
        rows = np.isin(side.time_s, same.time_s)
        assert side.flipper == same.flipper and side.force_z_n[rows].tobytes() == same.force_z_n.tobytes()


def test_a_curve_has_its_extremes_and_its_gaps(rows: walk_trace.Rows, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walk_trace, "CURVE_BINS", 50)
    time_s, values = rows["stamp_s"], rows["body_x_m"]
    chosen = rows_of_curve(time_s, values)
    assert len(chosen) < len(values) / 5
    bins = (50 * (time_s - time_s[0]) / (time_s[-1] - time_s[0])).astype(int)
    for number in np.unique(bins):
        known = values[(bins == number) & np.isfinite(values)]
        drawn = values[chosen[(bins[chosen] == number)]]
        assert not len(known) or (np.nanmin(drawn), np.nanmax(drawn)) == (known.min(), known.max())
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(values[chosen])), np.searchsorted(chosen, [500, 899]))
    assert np.isfinite(values[chosen[np.searchsorted(chosen, [499, 900])]]).all()
    assert len(rows_of_curve(time_s, np.full(len(time_s), np.nan))) == 0
