"""The mud along the track: its kind, the height of its surface, and its random strength."""

from math import exp

import numpy as np
import pytest

from simulation.mud.clay import ADHESION, MUDS, Clay
from simulation.mud.layer import Layer
from simulation.mud.stones import Stone
from simulation.mud.track import COMPARTMENT_M, Track, paper_track
from simulation.mud.unevenness import RandomStrength, Ridges

FIRM, SOFT = Clay("firm", 3000.0, (Layer(0.0, 0.01, 2.0),)), Clay("soft", 1000.0)


@pytest.mark.parametrize(("x_m", "name"), [(-0.1, "48.5"), (0.6, "48.5"), (0.61, "53.1"), (1.3, "45.3"), (9.0, "45.3")])
def test_the_paper_s_track_has_three_even_muds_and_the_last_has_no_end(x_m: float, name: str) -> None:
    track = paper_track()
    assert (track.ground_at(x_m), track.surface_m(x_m), track.stones) == (MUDS[name], 0.0, ())
    assert track.length_m == pytest.approx(3 * COMPARTMENT_M)


def test_ridges_rise_from_the_start_and_repeat_after_their_wavelength_between_stones() -> None:
    stone = Stone(0.1, 0.2, 0.03)
    track = Track([(400.0, FIRM)], [stone], Ridges(0.004, 0.2))
    heights_m = [-track.surface_m(x_m) for x_m in (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)]
    assert heights_m == pytest.approx([0.0, 0.004, 0.0, -0.004, 0.0, 0.004])
    assert track.stones == (stone,)


def strengths_pa(parameters: RandomStrength, positions_m: np.ndarray) -> np.ndarray:
    track = Track([(400.0, SOFT)], random_strength=parameters)
    return np.array([track.ground_at(float(x_m)).sticking_pa(0.0) / ADHESION for x_m in positions_m])


def test_random_strength_has_the_requested_mean_and_spread_and_no_outliers() -> None:
    """8000 lengths of 5 cm are about 4000 independent draws: 1.5 % and 0.015 are three to five standard errors."""
    strengths = strengths_pa(RandomStrength(0.3, 0.05, 1), np.arange(0.0, 400.0, 0.025))
    assert strengths.mean() == pytest.approx(1000.0, rel=0.015)
    assert strengths.std() / strengths.mean() == pytest.approx(0.3, abs=0.015)
    logarithms = np.log(strengths)
    skewness = np.mean((logarithms - logarithms.mean()) ** 3) / logarithms.std() ** 3
    assert skewness == pytest.approx(0.0, abs=0.1)  # the logarithm has none, the strength itself 0.9
    variance = np.log(1.0 + 0.5**2)
    factors = strengths_pa(RandomStrength(0.5, 0.05, 2), np.arange(0.0, 400.0, 0.005)) / 1000.0
    limits = [exp(sign * 3.0 * variance**0.5 - variance / 2.0) for sign in (-1.0, 1.0)]
    assert [factors.min(), factors.max()] == pytest.approx(limits)  # some of the 80000 cells reach three deviations


def test_random_strength_forgets_itself_over_its_correlation_length() -> None:
    logarithms = np.log(strengths_pa(RandomStrength(0.3, 0.1, 5), np.arange(0.005, 400.0, 0.01)))
    deviations = (logarithms - logarithms.mean()) / logarithms.std()
    for lengths in (0.1, 0.5, 1.0, 2.0):
        shift = round(10 * lengths)
        correlation = np.mean(deviations[shift:] * deviations[:-shift])
        assert correlation == pytest.approx(exp(-lengths), abs=0.05)  # 4000 lengths: three standard errors


def test_random_strength_is_about_each_segment_s_own_with_its_name_and_layers() -> None:
    wandering, swapped = (
        Track([(1.0, a), (1.0, b)], random_strength=RandomStrength(0.3, 0.1, 1))
        for a, b in ((FIRM, SOFT), (SOFT, FIRM))
    )
    for x_m, clay, other in ((0.4, FIRM, SOFT), (1.6, SOFT, FIRM)):
        here, there = wandering.ground_at(x_m), swapped.ground_at(x_m)
        assert isinstance(here, Clay) and isinstance(there, Clay)
        assert (here.name, here.layers) == (clay.name, clay.layers)
        assert here.strength_pa / clay.strength_pa == pytest.approx(there.strength_pa / other.strength_pa)
