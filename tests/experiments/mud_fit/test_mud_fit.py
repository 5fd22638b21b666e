"""The mud fit recovers synthetic truths, and walks the plant that it reports."""

from __future__ import annotations

import json
from collections.abc import Iterable
from math import log
from typing import Any

import pytest

import experiments.mud_fit.mud_fit
from experiments.mud_fit.mud_fit import (
    TARGETS,
    Fit,
    Ground,
    Plan,
    chi2_of,
    fixed_speed_cm_s,
    run,
    strength_range_pa,
    walk_on,
)
from experiments.reports.report_page import to_json
from experiments.trackway.report import PAPER_TABLE, Speed
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.clay import MUDS

TRUTH = {"48.5": 2000.0, "53.1": 600.0, "45.3": 3500.0}
TRUE_DAMPING = 5.6
SLOPES = {0.03: 3.0, 0.05: -2.0}  # cm/s for each e-fold of strength


def synthetic_speeds(grounds: Iterable[Ground], *rest: Any) -> dict[Ground, dict[float, float]]:
    """Return noise-free speeds: strength changes their difference, and damping shifts both depths alike."""
    return {
        ground: {
            depth_m: 5.0 + slope * log(ground.strength_pa / 1500.0) - 0.4 * (ground.damping_n_s_m - TRUE_DAMPING)
            for depth_m, slope in SLOPES.items()
        }
        for ground in grounds
    }


def synthetic_targets() -> dict[str, dict[float, Speed]]:
    truth = [Ground(TRUE_DAMPING, strength_pa) for strength_pa in TRUTH.values()]
    speeds = synthetic_speeds(truth)
    return {
        mud: {depth_m: Speed(speed, 0.3) for depth_m, speed in speeds[ground].items()}
        for mud, ground in zip(TRUTH, truth, strict=True)
    }


@pytest.fixture
def synthetic_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiments.mud_fit.mud_fit, "walk_on", synthetic_speeds)
    monkeypatch.setattr(experiments.mud_fit.mud_fit, "TARGETS", synthetic_targets())


# the cells of the fit


def test_it_is_fitted_to_the_six_fixed_cells_and_no_adaptive_one() -> None:
    assert {(mud, depth_m): reported for mud, row in TARGETS.items() for depth_m, reported in row.items()} == {
        (mud, depth_m): PAPER_TABLE[rule][mud] for mud in MUDS for rule, depth_m in (("3 cm", 0.03), ("5 cm", 0.05))
    }


def test_chi2_weighs_each_cell_by_its_sd() -> None:
    assert chi2_of({0.03: 7.0, 0.05: 5.0}, {0.03: Speed(6.0, 0.5), 0.05: Speed(6.0, 1.0)}) == pytest.approx(4.0 + 1.0)


# the search


def test_the_first_grid_reaches_over_all_strengths_in_steps_of_12_percent() -> None:
    plan = Plan()
    strengths = sorted({ground.strength_pa for ground in plan.grounds()})
    assert {ground.damping_n_s_m for ground in plan.grounds()} == {4.0, 5.0, 6.0, 7.0, 8.0}
    assert strengths[0] == 400.0
    assert 5000.0 / 1.12 < strengths[-1] <= 5000.0
    ratios = [after / before for before, after in zip(strengths, strengths[1:], strict=False)]
    assert ratios == pytest.approx([1.12] * len(ratios), rel=0.002)  # rounded to whole pascals


def test_the_finer_grid_lies_around_the_best() -> None:
    grounds = Plan(finer_ratios=(0.9, 1.0, 1.1)).finer_grounds(Fit(6.0, {"a": 1000.0, "b": 2000.0}, 1.0))
    assert {ground.damping_n_s_m for ground in grounds} == {5.5, 6.0, 6.5}
    assert {ground.strength_pa for ground in grounds} == {900.0, 1000.0, 1100.0, 1800.0, 2000.0, 2200.0}


def test_the_fit_recovers_a_synthetic_truth(synthetic_world: None) -> None:
    """The tolerances are half a step of the finer grid in damping, 0.25 N·s/m, and one and a half in strength, 4.5 %.

    A misfit of 0.1 N·s/m in damping may shift a strength by a step of 3 %.
    """
    best = run(Plan(), lambda done, total: None).fitted
    assert best.rail_damping_n_s_m == pytest.approx(TRUE_DAMPING, abs=0.25)
    for mud, strength_pa in TRUTH.items():
        assert best.strength_pa[mud] == pytest.approx(strength_pa, rel=0.045)
    assert best.chi2 < 1.0


def test_the_range_of_a_strength_is_where_chi2_rises_by_one() -> None:
    grounds = [Ground(5.0, strength) for strength in (900.0, 950.0, 1000.0, 1050.0, 1100.0)]
    speeds = {ground: {0.03: ground.strength_pa / 100.0} for ground in grounds}
    speeds[Ground(6.0, 2000.0)] = {0.03: 10.0}  # has another damping, so it does not count
    assert strength_range_pa("a", 5.0, speeds, {"a": {0.03: Speed(10.0, 0.5)}}) == [950.0, 1050.0]


# the report


def test_the_report_has_fit_present_values_and_the_six_cells(synthetic_world: None) -> None:
    report = run(Plan(), lambda done, total: None)
    assert report.present.strength_pa == {name: clay.strength_pa for name, clay in MUDS.items()}
    assert report.present.rail_damping_n_s_m == PlantParameters().rail_damping_n_s_m
    assert report.fitted.chi2 <= report.present.chi2
    assert {rule: list(row) for rule, row in report.fitted.cells.items()} == {"3 cm": list(MUDS), "5 cm": list(MUDS)}
    assert min(report.chi2_of_damping.values()) == report.fitted.chi2
    json.dumps(to_json(report), allow_nan=False)


# in simulation


def test_more_damping_is_slower() -> None:
    """At 0.5 m/s another 8 N·s/m are 4 N, more than the rail's dry drag of 2.5 N."""
    loose, tight = (fixed_speed_cm_s(Ground(damping, 2800.0), 0.03, 1, strides=2) for damping in (2.0, 10.0))
    assert 0.0 < tight < 0.95 * loose


def synthetic_speed_cm_s(ground: Ground, depth_m: float, seed: int, strides: int) -> float:
    return ground.damping_n_s_m + 100.0 * depth_m + 0.1 * seed + strides


def test_speeds_are_means_over_seeds_by_ground_and_depth(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiments.mud_fit.mud_fit, "fixed_speed_cm_s", synthetic_speed_cm_s)
    loose, tight = Ground(6.0, 2800.0), Ground(7.0, 2800.0)
    reported = walk_on([loose, tight, loose], Plan(seeds=2, strides=2), lambda done, total: None)
    assert reported == {
        loose: {0.03: pytest.approx(11.15), 0.05: pytest.approx(13.15)},
        tight: {0.03: pytest.approx(12.15), 0.05: pytest.approx(14.15)},
    }
