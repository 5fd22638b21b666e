"""A manual stage with an encoder: lag, gaps, wrong encoders, and how clay follows the speed."""

import numpy as np
import pytest

from experiments.loadcell.analysis import analyse_trial
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.stage_track import PositionedProfile, common_alignment
from experiments.loadcell.strokes import (
    INSERTION,
    NO_PROFILE,
    SHEAR,
    Alignment,
    AnalysedTrial,
    Recorded,
    StagePositions,
    StageSettings,
)
from simulation.mud.clay import RATE_COEFFICIENT
from simulation.test_rig.load_cell_bench import clay_plate
from tests.experiments.loadcell.lawful_mud import LAG_S, feel_by_hand

TIMES_S = np.arange(0.0, 2.0, 0.01)


@pytest.fixture(scope="module")
def insertion() -> Recorded:
    return feel_by_hand(clay_plate(49.5), INSERTION, 7, jitter_s=0.0)


def test_the_lag_between_the_devices_is_found_from_the_stroke(insertion: Recorded) -> None:
    for lag_s in (-0.05, 0.0, 0.09):
        reported = analyse_trial(insertion._replace(times_s=insertion.times_s - LAG_S + lag_s))
        assert reported.alignment is not None
        assert reported.alignment.lag_s == pytest.approx(lag_s, abs=0.002)


def with_factor(recorded: Recorded, factor: float) -> AnalysedTrial:
    """Analyse a trial whose encoder reports positions times a factor."""
    assert recorded.positions is not None
    times_s, positions_m = recorded.positions
    return analyse_trial(recorded._replace(positions=StagePositions(times_s, factor * positions_m)))


def test_the_encoders_direction_does_not_matter_and_another_axis_or_travel_per_count_is_reported(
    insertion: Recorded,
) -> None:
    expected = {name: pytest.approx(k) for name, k in analyse_trial(insertion).coefficients.items()}
    assert with_factor(insertion, -1.0).coefficients == expected
    of_another_axis = with_factor(insertion, 0.05)
    assert not of_another_axis.is_measured and "--position-step" in of_another_axis.remark
    assert "k_p" in of_another_axis.coefficients or of_another_axis.problem
    assert "6.0 cm deep by the encoder, and 3 cm was set" in with_factor(insertion, 2.0).remark


def test_a_gap_in_the_positions_costs_its_own_samples_only(insertion: Recorded) -> None:
    assert insertion.positions is not None
    times_s, positions_m = insertion.positions
    whole = analyse_trial(insertion)
    middle_s = times_s[int(np.argmin(np.abs(positions_m + 0.035)))]  # 1.5 cm deep
    kept = np.abs(times_s - middle_s) > 0.04
    reported = analyse_trial(insertion._replace(positions=StagePositions(times_s[kept], positions_m[kept])))
    assert reported.is_measured
    assert reported.coefficients["k_p"].value == pytest.approx(whole.coefficients["k_p"].value, rel=0.02)


def test_how_clay_follows_the_speed_is_read_from_the_drags() -> None:
    """r = c 0.1^0.4 / (1 + c 0.1^0.4) within 0.05, because the mud yields gradually over a millimetre."""
    true = RATE_COEFFICIENT * 0.1**0.4 / (1.0 + RATE_COEFFICIENT * 0.1**0.4)
    reported = analyse_trial(feel_by_hand(clay_plate(49.5), SHEAR, 5))
    assert reported.alignment is not None and np.isnan(reported.alignment.lag_s)
    assert reported.alignment.rate_fraction == pytest.approx(true, abs=0.05)


# positions between the encoder's lines


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
