"""Coefficients from force against time alone, in muds with known ones and in clay against its noise-free curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm

from estimation.strokes.origin_fit import student_factor
from experiments.loadcell.analysis import (
    COEFFICIENTS,
    analyse,
    analyse_trial,
    gather_trials,
    speed_remark,
)
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.force_trials import wide_pace
from experiments.loadcell.strokes import (
    INSERTION,
    SHEAR,
    AnalysedTrial,
    Pace,
    Recorded,
    StageSettings,
    find_contact,
    fit_slope,
)
from simulation.mud.clay import clay_of_water
from simulation.test_rig.load_cell import LoadCurve, measure_insertion, measure_shear
from simulation.test_rig.load_cell_bench import PAPER_PLATE, RELAXATION, clay_plate
from tests.experiments.loadcell.lawful_mud import THICKNESS_M, WIDTH_M, LawfulMud, feel

SETTINGS = StageSettings()
KNOWN = {"k_p": 1.0e6, "k_s": 0.6e6, "k_e": 1.3e6}
BOUND = 0.03


def look(done: int, total: int) -> None:
    assert done <= total


def found(trials: list[Recorded]) -> dict[str, float]:
    reported = analyse(trials, SETTINGS, look)
    return {name: gather_trials(reported, name, 0.0).value for name in COEFFICIENTS}


@pytest.mark.parametrize(("seed", "acceleration_m_s2"), [(1, 0.6), (3, 8.0)])
def test_coefficients_of_a_mud_that_obeys_the_laws_come_out_within_three_per_cent(
    seed: int, acceleration_m_s2: float
) -> None:
    mud = LawfulMud(**KNOWN)
    kinds = [(INSERTION, trial) for trial in range(3)] + [(SHEAR, 3)]
    trials = [feel(mud, kind, 100 * seed + i, acceleration_m_s2=acceleration_m_s2) for kind, i in kinds]
    assert found(trials) == {name: pytest.approx(value, rel=BOUND) for name, value in KNOWN.items()}


def test_coefficients_of_clay_are_those_of_its_noise_free_curve() -> None:
    water = 51.2
    kinds = [(INSERTION, 1), (INSERTION, 2), (INSERTION, 3), (SHEAR, 4)]
    trials = [feel(clay_plate(water), kind, seed, acceleration_m_s2=0.6) for kind, seed in kinds]
    assert found(trials) == {name: pytest.approx(value, rel=BOUND) for name, value in true_of_clay(water).items()}


def true_of_clay(water: float) -> dict[str, float]:
    """Return the coefficients by their definitions, without the tested code."""
    clay = clay_of_water(water)
    reported = measure_insertion(clay, PAPER_PLATE, 0.0, 0.0, 0.03, 0.1, RELAXATION, 3.0)
    shear_n = measure_shear(clay, PAPER_PLATE, 0.0, 0.0, 0.03, 0.1)
    return {
        "k_p": true_slope(reported.down, 0.03),
        "k_s": shear_n / (WIDTH_M * 0.03**2 / 2.0),
        "k_e": -true_slope(reported.up, 0.75 * 0.03),
    }


def true_slope(curve: LoadCurve, deepest_m: float) -> float:
    depths_m, forces_n = np.array(curve.depths_m), np.array(curve.forces_n)
    inside = (depths_m > 0.0) & (depths_m <= deepest_m)
    volumes_m3 = WIDTH_M * THICKNESS_M * depths_m[inside]
    return float(volumes_m3 @ forces_n[inside] / (volumes_m3 @ volumes_m3))


@pytest.fixture(scope="module")
def clay_trials() -> list[AnalysedTrial]:
    """Return trials of one stage that start at random times between two samples."""
    return analyse([feel(clay_plate(49.5), INSERTION, 40 + i) for i in range(6)], SETTINGS, look)


@pytest.mark.parametrize("name", ["k_p", "k_e"])
def test_the_error_of_a_trial_is_about_its_standard_error_though_clay_does_not_follow_the_law(
    clay_trials: list[AnalysedTrial], name: str
) -> None:
    """The start between two samples does not matter, because the first and last samples count by their distance."""
    true = true_of_clay(49.5)[name]
    reported = [trial.coefficients[name] for trial in clay_trials]
    errs = float(np.sqrt(np.mean([(each.value - true) ** 2 for each in reported])))
    says = float(np.sqrt(np.mean([each.std_error**2 for each in reported])))
    assert errs < 0.006 * true
    assert says / 3.0 < errs < 1.5 * says


def test_the_error_of_a_slope_is_the_scatter_of_slopes_and_that_of_weighted_least_squares() -> None:
    """The force deviates smoothly from the law, which plain least squares takes for scatter."""
    random, depths_m = np.random.default_rng(1), np.linspace(0.0, 0.03, 25)
    volumes_m3 = SETTINGS.volumes_m3(depths_m)
    reported = [
        fit_slope(SETTINGS, depths_m, profile_n(depths_m) + 0.01 * random.standard_normal(25), 0.03, 0.0)
        for _ in range(300)
    ]
    scatter = float(np.std([each.value for each in reported]))
    assert float(np.mean([each.std_error for each in reported])) == pytest.approx(student_factor(23) * scatter, rel=0.1)
    known = sm.OLS(profile_n(depths_m), volumes_m3).fit()
    assert float(np.mean([each.value for each in reported])) == pytest.approx(float(known.params[0]), rel=0.02)
    assert scatter == pytest.approx(0.01 / float(np.sqrt(volumes_m3 @ volumes_m3)), rel=0.15)
    assert float(known.bse[0]) > 4.0 * scatter  # plain least squares overestimates it


def profile_n(depths_m: Array) -> Array:
    return np.asarray(1.5 + 60.0 * depths_m)


def one(recorded: Recorded) -> AnalysedTrial:
    return analyse_trial(recorded, SETTINGS, wide_pace(SETTINGS))


@pytest.fixture(scope="module")
def insertion() -> Recorded:
    return feel(LawfulMud(**KNOWN), INSERTION, 7)


def test_a_cell_of_the_opposite_sign_gives_the_same_coefficients(insertion: Recorded) -> None:
    turned = one(insertion._replace(forces_n=-insertion.forces_n))
    straight = one(insertion)
    assert turned.profile.turned
    assert turned.coefficients == {name: pytest.approx(reported) for name, reported in straight.coefficients.items()}


def test_a_stage_slower_than_its_setting_is_measured_and_reported() -> None:
    mud = LawfulMud(**KNOWN)
    reported = analyse([feel(mud, INSERTION, seed, speed_m_s=0.08) for seed in range(4)], SETTINGS, look)
    assert gather_trials(reported, "k_p", 0.0).value == pytest.approx(KNOWN["k_p"], rel=0.04)
    for trial in reported:
        assert trial.pace is not None
        assert trial.pace.speed_m_s == pytest.approx(0.08, rel=0.04)
        assert "0.100 m/s was set" in speed_remark(trial.pace, SETTINGS)
    assert speed_remark(Pace(0.102, 2.0, 0.01, 0.1), SETTINGS) == ""


def test_a_trial_without_contact_says_so() -> None:
    air = feel(LawfulMud(0.0, 0.0, 0.0), INSERTION, 1)
    assert one(air).problem.startswith("no contact")
    assert one(air).coefficients == {}


def test_a_plate_that_was_not_lifted_still_shows_its_insertion(insertion: Recorded) -> None:
    early = insertion.times_s < 4.0
    reported = one(insertion._replace(times_s=insertion.times_s[early], forces_n=insertion.forces_n[early]))
    assert "no extraction" in reported.remark
    assert reported.coefficients["k_p"].value == pytest.approx(KNOWN["k_p"], rel=0.08)
    assert np.isnan(reported.coefficients["k_e"].value)


def test_a_drifting_zero_is_no_contact() -> None:
    times_s = np.arange(0.0, 40.0, 0.0125)
    ramp_n = np.where(times_s > 35.0, np.minimum((times_s - 35.0) * 10.0, 2.0), 0.0)
    noise_n = np.random.default_rng(1).normal(0.0, 0.005, len(times_s))
    forces_n = 0.004 * times_s + ramp_n + noise_n
    profile = find_contact(Recorded("a/insertion/1", "a", INSERTION, times_s, forces_n, 0.0))
    assert times_s[profile.begin] == pytest.approx(35.0, abs=0.05)
    assert profile.level_n == pytest.approx(0.14, abs=0.01)


def test_the_error_of_a_mud_contains_scatter_calibration_and_shared_speed(insertion: Recorded) -> None:
    reported = [replace(one(insertion), shared_uncertainty=0.02) for _ in range(4)]
    plain = gather_trials([replace(each, shared_uncertainty=0.0) for each in reported], "k_p", 0.0)
    assert plain.repeatability == 0.0
    everything = gather_trials(reported, "k_p", 0.03)
    assert everything.std_error**2 == pytest.approx(plain.std_error**2 + (0.02**2 + 0.03**2) * plain.value**2)
    assert gather_trials([], "k_p", 0.0).trials == ()


def test_a_stage_that_stutters_is_remarked(insertion: Recorded) -> None:
    """It stands still for 0.1 s on its way down."""
    reported = one(insertion)
    assert reported.remark == ""
    half_s = reported.strokes["k_p"].begin_s + 0.15
    index = int(np.searchsorted(insertion.times_s, half_s))
    forces_n = np.insert(insertion.forces_n, index, np.full(8, insertion.forces_n[index]))
    times_s = np.concatenate([insertion.times_s, insertion.times_s[-1] + 0.0125 * np.arange(1, 9)])
    assert "one speed" in one(insertion._replace(times_s=times_s, forces_n=forces_n)).remark
