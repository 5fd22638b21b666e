"""The mud along the track: its kind, the height of its surface, and its random strength."""

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.mud.clay import MUDS, Clay
from simulation.mud.layer import Layer
from simulation.mud.stones import Stone
from simulation.mud.track import COMPARTMENT_M, Track, paper_track
from simulation.mud.unevenness import RandomStrength, Ridges

LONG = [(400.0, Clay("any", 1000.0, (Layer(0.0, 0.01, 2.0),)))]


@pytest.mark.parametrize(
    ("x_m", "name"), [(-0.1, "48.5"), (0.0, "48.5"), (0.6, "48.5"), (0.61, "53.1"), (1.3, "45.3"), (9.0, "45.3")]
)
def test_the_paper_s_track_has_three_muds_and_the_last_has_no_end(x_m: float, name: str) -> None:
    assert paper_track().clay_at(x_m) == MUDS[name]


def test_a_track_is_as_long_as_its_segments() -> None:
    assert paper_track().length_m == pytest.approx(3 * COMPARTMENT_M)
    assert Track([(0.5, MUDS["48.5"]), (0.25, MUDS["53.1"])]).length_m == 0.75


@given(st.floats(-1.0, 10.0))
def test_a_track_is_level_uniform_and_without_stones_by_default(x_m: float) -> None:
    track = Track([(1.0, MUDS["48.5"])])
    assert (track.stones, track.surface_m(x_m), track.clay_at(x_m)) == ((), 0.0, MUDS["48.5"])


def test_ridges_rise_from_the_start_and_repeat_after_their_wavelength() -> None:
    track = Track(LONG, ridges=Ridges(0.004, 0.2))
    heights_m = [-track.surface_m(x_m) for x_m in (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)]
    assert heights_m == pytest.approx([0.0, 0.004, 0.0, -0.004, 0.0, 0.004])


def strengths_pa(parameters: RandomStrength, positions_m: np.ndarray) -> np.ndarray:
    track = Track(LONG, random_strength=parameters)
    return np.array([track.clay_at(float(x_m)).strength_pa for x_m in positions_m])


def test_random_strength_has_the_requested_mean_and_spread() -> None:
    """8000 lengths of 5 cm are about 4000 independent draws: 1.5 % and 0.015 are three to five standard errors."""
    strengths = strengths_pa(RandomStrength(0.3, 0.05, 1), np.arange(0.0, 400.0, 0.025))
    assert strengths.mean() == pytest.approx(1000.0, rel=0.015)
    assert strengths.std() / strengths.mean() == pytest.approx(0.3, abs=0.015)
    logarithms = np.log(strengths)
    skewness = np.mean((logarithms - logarithms.mean()) ** 3) / logarithms.std() ** 3
    assert skewness == pytest.approx(0.0, abs=0.1)  # the logarithm has none, the strength itself 0.9


def test_random_strength_forgets_itself_over_its_correlation_length() -> None:
    logarithms = np.log(strengths_pa(RandomStrength(0.3, 0.1, 5), np.arange(0.005, 400.0, 0.01)))
    deviations = (logarithms - logarithms.mean()) / logarithms.std()
    for lengths in (0.1, 0.5, 1.0, 2.0):
        shift = round(10 * lengths)
        correlation = np.mean(deviations[shift:] * deviations[:-shift])
        assert correlation == pytest.approx(exp(-lengths), abs=0.05)  # 4000 lengths: three standard errors


def test_random_strength_is_the_same_for_a_seed_in_any_order_of_access() -> None:
    parameters, positions_m = RandomStrength(0.3, 0.1, 3), np.linspace(-0.5, 5.0, 200)
    forward, backward = strengths_pa(parameters, positions_m), strengths_pa(parameters, positions_m[::-1])
    assert forward.tolist() == backward[::-1].tolist()
    assert forward.tolist() != strengths_pa(RandomStrength(0.3, 0.1, 4), positions_m).tolist()


def test_random_strength_has_no_outliers_beyond_three_deviations() -> None:
    variance = np.log(1.0 + 0.5**2)
    factors = strengths_pa(RandomStrength(0.5, 0.05, 2), np.arange(0.0, 400.0, 0.005)) / 1000.0
    limits = [exp(sign * 3.0 * variance**0.5 - variance / 2.0) for sign in (-1.0, 1.0)]
    assert [factors.min(), factors.max()] == pytest.approx(limits)  # some of the 80000 cells reach them


def test_random_strength_is_about_each_segment_s_own_with_its_name_and_layers() -> None:
    firm, soft = Clay("firm", 3000.0, (Layer(0.0, 0.01, 2.0),)), Clay("soft", 500.0)
    wandering = Track([(1.0, firm), (1.0, soft)], random_strength=RandomStrength(0.3, 0.1, 1))
    even = Track([(1.0, soft), (1.0, firm)], random_strength=RandomStrength(0.3, 0.1, 1))
    for x_m, clay, other in ((0.4, firm, soft), (1.6, soft, firm)):
        here, there = wandering.clay_at(x_m), even.clay_at(x_m)
        assert (here.name, here.layers) == (clay.name, clay.layers)
        assert here.strength_pa / clay.strength_pa == pytest.approx(there.strength_pa / other.strength_pa)


def test_a_track_keeps_its_stones() -> None:
    stone = Stone(0.1, 0.2, 0.03)
    assert Track(LONG, [stone]).stones == (stone,)
