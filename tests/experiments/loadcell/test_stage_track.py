"""Positions between the encoder's lines: means, gaps, and the error of interpolation."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.loadcell.curve_fit import Array
from experiments.loadcell.stage_track import StageTrack
from experiments.loadcell.strokes import StagePositions

TIMES_S = np.arange(0.0, 2.0, 0.01)


def even(times_s: Array = TIMES_S) -> StageTrack:
    return StageTrack(StagePositions(times_s, 5.0 + 0.1 * times_s))


def test_straight_lines_are_off_by_no_more_than_the_stated_error() -> None:
    """The stage accelerates at 5 m/s² and its encoder sends 20 positions per second."""
    times_s = np.arange(0.0, 1.0, 0.05)
    track = StageTrack(StagePositions(times_s, 2.5 * times_s**2))
    fine_s = np.linspace(0.06, 0.94, 400)
    off_m = np.max(np.abs(track.positions_m(fine_s) - 2.5 * fine_s**2))
    assert off_m == pytest.approx(5.0 * 0.05**2 / 8.0, rel=0.02)
    assert off_m <= 1.01 * track.interpolation_error_m


def test_the_position_is_unknown_before_after_and_in_a_gap() -> None:
    gone = (TIMES_S > 0.8) & (TIMES_S < 1.0)
    reported = even(TIMES_S[~gone]).mean_positions_m(np.array([0.005, 0.5, 0.9, 1.005, 1.1, 2.1]), 0.0125)
    assert np.isnan(reported).tolist() == [True, False, True, True, False, True]


def test_a_single_wrong_position_is_removed() -> None:
    positions_m = 0.1 * TIMES_S
    positions_m[70] += 0.004
    track = StageTrack(StagePositions(TIMES_S, positions_m))
    assert track.positions_m(TIMES_S[70:71]) == pytest.approx([0.07])
