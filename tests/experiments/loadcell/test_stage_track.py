"""Positions between the encoder's lines: means, gaps, and the error of interpolation."""

import numpy as np
import pytest

from experiments.loadcell.curve_fit import Array
from experiments.loadcell.stage_track import PositionedProfile, common_alignment
from experiments.loadcell.strokes import NO_PROFILE, Alignment, StagePositions, StageSettings

TIMES_S = np.arange(0.0, 2.0, 0.01)


def track_of(times_s: Array, positions_m: Array, forces_s: Array = TIMES_S) -> PositionedProfile:
    """Return positions under forces of these times, of which nothing else matters here."""
    profile = NO_PROFILE._replace(times_s=forces_s)
    return PositionedProfile(profile, StagePositions(times_s, positions_m), StageSettings())


def test_straight_lines_are_off_by_no_more_than_the_stated_error() -> None:
    """The stage accelerates at 5 m/s² and its encoder sends 20 positions per second."""
    times_s = np.arange(0.0, 1.0, 0.05)
    track = track_of(times_s, 2.5 * times_s**2)
    fine_s = np.linspace(0.06, 0.94, 400)
    off_m = np.max(np.abs(track.positions_m(fine_s) - 2.5 * fine_s**2))
    assert off_m == pytest.approx(5.0 * 0.05**2 / 8.0, rel=0.02)
    assert off_m <= 1.01 * track.interpolation_error_m


def test_the_position_is_unknown_before_after_and_in_a_gap() -> None:
    times_s = TIMES_S[(TIMES_S <= 0.8) | (TIMES_S >= 1.0)]
    forces_s = np.arange(0.005, 2.2, 0.01)
    reported = track_of(times_s, 5.0 + 0.1 * times_s, forces_s).mean_positions_m(0.0)
    known = dict(zip(np.round(forces_s, 3).tolist(), np.isfinite(reported).tolist(), strict=True))
    assert [known[at_s] for at_s in (0.005, 0.505, 0.905, 1.005, 1.105, 2.105)] == [
        False, True, False, False, True, False,
    ]  # fmt: skip


def test_a_single_wrong_position_is_removed() -> None:
    positions_m = 0.1 * TIMES_S
    positions_m[70] += 0.004
    assert track_of(TIMES_S, positions_m).positions_m(TIMES_S[70:71]) == pytest.approx([0.07])


def test_the_alignment_of_sixteen_trials_is_four_times_as_certain_as_that_of_one() -> None:
    lag_s, rate, *uncertainties = common_alignment([Alignment(0.02, 0.1, 0.032, 0.4)] * 16)
    assert (lag_s, rate) == (0.02, 0.1)
    assert uncertainties == pytest.approx([1.25 * 0.008, 1.25 * 0.1])
