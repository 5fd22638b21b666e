"""A manual stage with an encoder: lag, gaps, wrong encoders, and how clay follows the speed."""

import numpy as np
import pytest

from experiments.loadcell.analysis import analyse_trial
from experiments.loadcell.strokes import INSERTION, SHEAR, AnalysedTrial, Recorded, StagePositions
from simulation.mud.clay import RATE_COEFFICIENT
from simulation.test_rig.load_cell_bench import clay_plate
from tests.experiments.loadcell.lawful_mud import feel_by_hand

LAG_S = 0.012


@pytest.fixture(scope="module")
def insertion() -> Recorded:
    return feel_by_hand(clay_plate(49.5), INSERTION, 7, lag_s=LAG_S, jitter_s=0.0)


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


def test_the_coefficients_do_not_depend_on_the_encoders_direction(insertion: Recorded) -> None:
    expected = {name: pytest.approx(k) for name, k in analyse_trial(insertion).coefficients.items()}
    assert with_factor(insertion, -1.0).coefficients == expected


def test_an_encoder_on_another_axis_leaves_the_trial_to_the_force(insertion: Recorded) -> None:
    reported = with_factor(insertion, 0.05)
    assert not reported.is_measured
    assert "is the encoder on the axis that moves" in reported.remark and "--position-step" in reported.remark
    assert "k_p" in reported.coefficients or reported.problem


def test_a_wrong_travel_per_count_is_reported(insertion: Recorded) -> None:
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
