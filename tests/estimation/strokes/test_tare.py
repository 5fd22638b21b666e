"""The zero of a flipper that hangs in the air, with mud that clings to it and motors that are off."""

from math import cos, inf, isfinite, nan, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from estimation.strokes.tare import CREEP_N, FEWEST, MEMORY, SHAKEN_FRACTION, UNSEEN_N, Tare, Zero

GEOMETRY = FlipperGeometry()
WEIGHT_N, NOISE_NM = 0.8, 0.008  # the noise of a hold in air, section 1.6
EXACT = 1e-12


def hang(tare: Tare, poses: list[tuple[float, float]], weight_n: float, noise_nm: float = 0.0, seed: int = 1) -> None:
    """Feed a weight at the lower edge, which turns the adduction joint by -W ∂z/∂β."""
    random = np.random.default_rng(seed)
    for sweep_rad, adduction_rad in poses:
        jacobian = GEOMETRY.jacobian(sweep_rad, adduction_rad)
        adduction_nm = -weight_n * jacobian.z_adduction + noise_nm * float(random.standard_normal())
        tare.update(jacobian.z_adduction, adduction_nm)


def swing() -> list[tuple[float, float]]:
    """Return the poses of a swing forward through the air, from -30 to +30 degrees."""
    return [(pi / 6.0 * sin(pi * (i / 100 - 0.5)), 0.2 * cos(pi * i / 100)) for i in range(100)]


def again(tare: Tare, poses: list[tuple[float, float]], weight_n: float, is_air: bool = True) -> Tare:
    """Take the zero of another stride."""
    hang(tare, poses, weight_n)
    tare.set_zero(is_air=is_air)
    return tare


def taken(poses: list[tuple[float, float]], weight_n: float, noise_nm: float = 0.0, seed: int = 1) -> Tare:
    tare = Tare()
    hang(tare, poses, weight_n, noise_nm, seed)
    assert tare.zero == Zero()  # it takes effect when it is taken
    tare.set_zero()
    return tare


@given(st.floats(-3.0, 3.0))
def test_a_weight_is_found_in_any_pose(weight_n: float) -> None:
    zero = taken(swing(), weight_n).zero
    assert zero.weight_n == pytest.approx(weight_n, abs=EXACT)
    assert zero.std_error_n == pytest.approx(0.0, abs=1e-9)


def test_the_standard_error_is_that_of_the_weights_scatter() -> None:
    """A fading mean of MEMORY samples errs by σ/√(2 MEMORY - 1); the reported error is that of a plain mean, σ/√MEMORY,
    which is larger.
    """
    level = [(0.0, 0.1)] * 200
    per_nm = 1.0 / GEOMETRY.jacobian(0.0, 0.1).z_adduction
    zeros = [taken(level, WEIGHT_N, NOISE_NM, seed).zero for seed in range(300)]
    scatter_n = float(np.std([zero.weight_n for zero in zeros]))
    assert scatter_n == pytest.approx(per_nm * NOISE_NM / sqrt(2 * MEMORY - 1), rel=0.15)
    reported_n = float(np.mean([zero.std_error_n for zero in zeros]))
    assert reported_n == pytest.approx(per_nm * NOISE_NM / sqrt(MEMORY), rel=0.1)
    assert np.mean([zero.weight_n for zero in zeros]) == pytest.approx(WEIGHT_N, abs=4.0 * scatter_n / sqrt(300))


def test_few_samples_give_the_squared_error_of_their_mean() -> None:
    """σ²/n is without bias, because the variance is taken about the samples' own mean."""
    per_nm = 1.0 / GEOMETRY.jacobian(0.0, 0.1).z_adduction
    squares = [taken([(0.0, 0.1)] * 8, WEIGHT_N, NOISE_NM, seed).zero.std_error_n ** 2 for seed in range(1000)]
    assert np.mean(squares) == pytest.approx((per_nm * NOISE_NM) ** 2 / 8.0, rel=0.07)  # four sampling errors


def test_mud_that_drips_off_is_followed() -> None:
    """The end of the swing counts: after 3 MEMORY samples the weight before has faded to e⁻³."""
    tare = Tare()
    hang(tare, [(0.0, 0.1)] * 100, 2.0)
    assert 0.5 < again(tare, [(0.0, 0.1)] * 3 * MEMORY, 0.5).zero.weight_n < 0.5 + 1.5 * 0.06


@pytest.mark.parametrize("count", range(FEWEST))
def test_a_stride_with_hardly_any_air_keeps_the_zero_of_the_one_before_and_does_not_count_for_the_next(
    count: int,
) -> None:
    tare = taken(swing(), WEIGHT_N)
    before = tare.zero
    assert again(tare, swing()[:count], 100.0).zero == before
    assert again(tare, swing(), 0.3).zero.weight_n == pytest.approx(0.3)


def test_the_drift_is_the_change_from_stride_to_stride_without_the_correction_in_the_insertion() -> None:
    tare = taken(swing(), 1.5)
    assert not isfinite(tare.drift_n)
    for weight_n, drift_n in ((1.1, -0.4), (1.2, 0.1), (1.2, 0.0)):
        assert again(tare, swing(), weight_n).drift_n == pytest.approx(drift_n, abs=EXACT)
        tare.correct(0.5, 0.001)


@given(st.floats(-1.0, 1.0), st.floats(1e-4, 1.0))
def test_a_correction_is_weighed_by_its_own_error_against_the_zeros(weight_n: float, std_error_n: float) -> None:
    """Two readings of one weight are combined: that in air, with its scatter and what may fall off, and that of the
    insertion.
    """
    tare = taken([(0.0, 0.1)] * 50, WEIGHT_N, NOISE_NM)
    before = tare.zero
    own = before.std_error_n**2 + CREEP_N**2 + (SHAKEN_FRACTION * before.weight_n) ** 2
    fraction = own / (own + std_error_n**2)
    assert tare.correct(weight_n, std_error_n) == pytest.approx(fraction * weight_n)
    assert tare.zero.weight_n == pytest.approx(before.weight_n + fraction * weight_n)
    assert tare.zero.std_error_n == pytest.approx((1.0 / own + 1.0 / std_error_n**2) ** -0.5)


def test_a_swing_through_mud_keeps_the_weight_and_widens_its_error() -> None:
    zero = again(taken(swing(), WEIGHT_N), swing(), 3.0, is_air=False).zero
    assert zero.weight_n == pytest.approx(WEIGHT_N)
    assert zero.std_error_n == pytest.approx(UNSEEN_N)


def test_a_reset_forgets_the_zero_and_what_is_gathered() -> None:
    tare = taken(swing(), WEIGHT_N)
    hang(tare, swing(), 5.0)
    tare.reset()
    assert tare.zero == Zero()
    assert not isfinite(tare.drift_n)


@pytest.mark.parametrize("count", range(FEWEST))
def test_a_log_that_begins_in_the_mud_does_not_know_the_weight(count: int) -> None:
    tare = again(Tare(), swing()[:count], WEIGHT_N)
    assert tare.zero == Zero(0.0, UNSEEN_N)
    assert again(tare, swing(), WEIGHT_N).zero.std_error_n == pytest.approx(0.0, abs=1e-9)


@given(st.lists(st.tuples(st.floats(0.01, 0.2), st.floats()), max_size=20), st.floats(), st.floats(1e-6, inf))
def test_no_torque_makes_it_raise(rows: list[tuple[float, float]], weight_n: float, std_error_n: float) -> None:
    tare = Tare()
    for rise_m, torque_nm in rows:
        tare.update(rise_m, torque_nm)
    tare.set_zero()
    tare.correct(weight_n, std_error_n)
    tare.update(0.1, nan)
