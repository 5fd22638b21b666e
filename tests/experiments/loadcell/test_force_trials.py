"""Coefficients from force against time alone, in muds with known ones and in clay against its noise-free curve."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import statsmodels.api as sm

from control.records import COEFFICIENTS
from estimation.strokes.origin_fit import student_factor
from experiments.loadcell.analysis import (
    analyse,
    analyse_trial,
    gather_trials,
    speed_remark,
)
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.plots import draw_mud
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
from simulation.test_rig.joint_cell import measure_stroke
from simulation.test_rig.load_cell import Curve, measure_shear
from simulation.test_rig.load_cell_bench import PAPER_PLATE, clay_plate
from simulation.test_rig.plate_stage import CarriedPlate
from tests.experiments.loadcell.lawful_mud import KNOWN, THICKNESS_M, WIDTH_M, LawfulMud, feel, feel_by_hand

SETTINGS = StageSettings()
BOUND = 0.03


def look(done: int, total: int) -> None:
    assert done <= total


def found(trials: list[Recorded], is_measured: bool) -> dict[str, float]:
    reported = analyse(trials, look)
    assert all(trial.is_measured == is_measured for trial in reported)
    return {name: gather_trials(reported, name, 0.0).value for name in COEFFICIENTS}


SLOWLY, QUICKLY = (partial(feel, acceleration_m_s2=acceleration_m_s2) for acceleration_m_s2 in (0.6, 8.0))


@pytest.mark.parametrize(
    ("feel_trial", "seed", "water"),
    [(SLOWLY, 100, None), (QUICKLY, 300, None), (SLOWLY, 1, 51.2), (feel_by_hand, 1, None), (feel_by_hand, 21, 47.6)],
)
def test_coefficients_of_a_lawful_mud_and_of_clay_come_out_within_three_per_cent(
    feel_trial: Callable[[CarriedPlate, str, int], Recorded], seed: int, water: float | None
) -> None:
    """On a motorised stage they are found from the force, by hand from an encoder; those of clay at the set speed."""
    plate = LawfulMud() if water is None else clay_plate(water)
    known = KNOWN if water is None else true_of_clay(water)
    trials = [feel_trial(plate, kind, seed + i) for i, kind in enumerate([INSERTION] * 3 + [SHEAR])]
    by_hand = feel_trial is feel_by_hand
    assert found(trials, by_hand) == {name: pytest.approx(value, rel=BOUND) for name, value in known.items()}


def true_of_clay(water: float) -> dict[str, float]:
    """Return the coefficients by their definitions, without the tested code."""
    clay = clay_of_water(water)
    down, up = measure_stroke(clay_plate(water), 0.03, 0.1, 3.0)
    shear_n = measure_shear(clay, PAPER_PLATE, 0.0, 0.0, 0.03, 0.1)
    return {
        "k_p": true_slope(down, 0.03),
        "k_s": shear_n / (WIDTH_M * 0.03**2 / 2.0),
        "k_e": -true_slope(up, 0.75 * 0.03),
    }


def true_slope(curve: Curve, deepest_m: float) -> float:
    depths_m, _, forces_n = np.array(curve).T
    inside = (depths_m > 0.0) & (depths_m <= deepest_m)
    volumes_m3 = WIDTH_M * THICKNESS_M * depths_m[inside]
    return float(volumes_m3 @ forces_n[inside] / (volumes_m3 @ volumes_m3))


@pytest.fixture(scope="module", params=[feel, feel_by_hand])
def clay_trials(request: pytest.FixtureRequest) -> list[AnalysedTrial]:
    """Return trials of one stage that start at random times between two samples."""
    return analyse([request.param(clay_plate(49.5), INSERTION, 40 + i) for i in range(6)], look)


@pytest.mark.parametrize("name", ["k_p", "k_e"])
def test_the_error_of_a_trial_is_about_its_standard_error_though_clay_does_not_follow_the_law(
    clay_trials: list[AnalysedTrial], name: str
) -> None:
    """The start between two samples does not matter, because the first and last samples count by their distance."""
    true = true_of_clay(49.5)[name]
    reported = [trial.coefficients[name] for trial in clay_trials]
    errs = float(np.sqrt(np.mean([(each.value - true) ** 2 for each in reported])))
    says = float(np.sqrt(np.mean([each.std_error**2 for each in reported])))
    assert errs < (0.01 if clay_trials[0].is_measured else 0.006) * true
    assert says / 3.0 < errs < 1.7 * says


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


@pytest.fixture(scope="module")
def insertion() -> Recorded:
    return feel(LawfulMud(), INSERTION, 7)


def test_a_cell_of_the_opposite_sign_gives_the_same_coefficients(insertion: Recorded) -> None:
    turned = analyse_trial(insertion._replace(forces_n=-insertion.forces_n))
    straight = analyse_trial(insertion)
    assert turned.profile.turned
    assert turned.coefficients == {name: pytest.approx(reported) for name, reported in straight.coefficients.items()}


def test_a_picture_names_each_trial_by_its_own_number(insertion: Recorded) -> None:
    """The first two trials were left out."""
    trials = [
        analyse_trial(each._replace(key=f"mud/{each.kind}/3")) for each in (insertion, feel(LawfulMud(), SHEAR, 8))
    ]
    coefficients = {name: gather_trials(trials, name, 0.0) for name in COEFFICIENTS}
    panels = draw_mud(trials, coefficients, SETTINGS).axes
    for panel in panels[:2]:
        assert panel.get_legend_handles_labels()[1] == ["trial 3", "model"]


def test_a_stage_slower_than_its_setting_is_measured_and_reported() -> None:
    mud = LawfulMud()
    reported = analyse([feel(mud, INSERTION, seed, speed_m_s=0.08) for seed in range(4)], look)
    assert gather_trials(reported, "k_p", 0.0).value == pytest.approx(KNOWN["k_p"], rel=0.04)
    for trial in reported:
        assert trial.pace is not None
        assert trial.pace.speed_m_s == pytest.approx(0.08, rel=0.04)
        assert "0.100 m/s was set" in speed_remark(trial)
    assert speed_remark(replace(trial, pace=Pace(0.102, 2.0, 0.01, 0.1))) == ""


def test_a_trial_without_contact_says_so() -> None:
    air = feel(LawfulMud(0.0, 0.0, 0.0), INSERTION, 1)
    assert analyse_trial(air).problem.startswith("no contact")
    assert analyse_trial(air).coefficients == {}


def test_a_plate_that_was_not_lifted_still_shows_its_insertion(insertion: Recorded) -> None:
    early = insertion.times_s < 4.0
    reported = analyse_trial(insertion._replace(times_s=insertion.times_s[early], forces_n=insertion.forces_n[early]))
    assert "no extraction" in reported.remark
    assert reported.coefficients["k_p"].value == pytest.approx(KNOWN["k_p"], rel=0.08)
    assert np.isnan(reported.coefficients["k_e"].value)


def test_a_drifting_zero_is_no_contact() -> None:
    times_s = np.arange(0.0, 40.0, 0.0125)
    ramp_n = np.where(times_s > 35.0, np.minimum((times_s - 35.0) * 10.0, 2.0), 0.0)
    noise_n = np.random.default_rng(1).normal(0.0, 0.005, len(times_s))
    forces_n = 0.004 * times_s + ramp_n + noise_n
    profile = find_contact(Recorded("a/insertion/1", "a", INSERTION, SETTINGS, times_s, forces_n, 0.0))
    assert times_s[profile.begin] == pytest.approx(35.0, abs=0.05)
    assert profile.level_n == pytest.approx(0.14, abs=0.01)


def test_the_error_of_a_mud_contains_scatter_calibration_and_shared_speed(insertion: Recorded) -> None:
    reported = [replace(analyse_trial(insertion), shared_uncertainty=0.02) for _ in range(4)]
    plain = gather_trials([replace(each, shared_uncertainty=0.0) for each in reported], "k_p", 0.0)
    assert plain.repeatability == 0.0
    everything = gather_trials(reported, "k_p", 0.03)
    assert everything.std_error**2 == pytest.approx(plain.std_error**2 + (0.02**2 + 0.03**2) * plain.value**2)
    assert gather_trials([], "k_p", 0.0).trials == ()


def test_a_stage_that_stutters_is_remarked(insertion: Recorded) -> None:
    """It stands still for 0.1 s on its way down."""
    reported = analyse_trial(insertion)
    assert reported.remark == ""
    half_s = reported.strokes["k_p"].begin_s + 0.15
    index = int(np.searchsorted(insertion.times_s, half_s))
    forces_n = np.insert(insertion.forces_n, index, np.full(8, insertion.forces_n[index]))
    times_s = np.concatenate([insertion.times_s, insertion.times_s[-1] + 0.0125 * np.arange(1, 9)])
    assert "one speed" in analyse_trial(insertion._replace(times_s=times_s, forces_n=forces_n)).remark
