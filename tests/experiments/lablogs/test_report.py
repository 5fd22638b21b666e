"""The report of synthetic trials recovers the figures from which they were generated."""

from __future__ import annotations

import pytest

from experiments.lablogs import plots
from experiments.lablogs.lab_trial import METHODS, LabTrial, Refusal
from experiments.lablogs.log_choice import group_of, group_trials
from experiments.lablogs.report import LablogsReport, report_of
from experiments.lablogs.tables import tables_of
from tests.experiments.lablogs.synthetic_trials import (
    INVALID,
    make_bound,
    make_stride,
    make_trial,
    make_value,
    make_walk,
)

FIRM, SOFT = (1.7e6, 2.0e6, 2.3e6), (0.9e6, 1.0e6, 1.1e6)


def single(name: str, *k_s: float) -> LabTrial:
    return make_trial([make_stride(index=i, k_s=make_value(k, 0.1e6)) for i, k in enumerate(k_s)], name)


def evaluated(*trials: LabTrial) -> LablogsReport:
    grouped = [(trial, group_of(trial.name, ())) for trial in trials]
    return report_of(grouped, group_trials(grouped), [Refusal("x.csv", "x.csv: ends at line 1")])


@pytest.fixture
def trials() -> list[LabTrial]:
    firm = [single(f"single_12N_{i}.csv", k, 0.8 * k, 0.7 * k) for i, k in enumerate(FIRM)]
    soft = [single(f"single_10.3N_{i}.csv", k, 0.8 * k) for i, k in enumerate(SOFT)]
    walk = make_walk([(make_value(2.0), make_value(2.0)), (make_bound(1.0), INVALID)])
    air = make_trial([make_stride(k_s=make_value(1e5), k_e=make_bound(1e5))], "single_12N_air.csv", in_mud=False)
    return [*firm, *soft, walk, air]


def test_groups_have_the_variation_and_the_counts_of_their_trials(trials: list[LabTrial]) -> None:
    groups = evaluated(*trials).default.groups
    assert list(groups) == ["12N", "10.3N", "walk 30N"]
    firm, soft, walk = (groups[name]["k_s"] for name in groups)
    assert (firm.first_cv, firm.later_cv, firm.n, firm.n_later) == (0.15, 0.15, 3, 3)
    assert (soft.first_cv, soft.first_mean, soft.values) == (0.1, 1000000, 6)
    assert soft.chi_between_trials == 1.0  # scatter and claimed error are 0.1e6
    assert (walk.first_cv, walk.n, walk.values, walk.bounds, walk.invalid) == (None, 0, 2, 1, 1)
    assert groups["12N"]["k_p"].invalid == 9


def test_each_walk_of_a_log_on_a_fixed_base_is_a_trial() -> None:
    strides = [make_stride(index=i, k_s=make_value(k * d)) for k in FIRM for i, d in enumerate((1.0, 0.8))]
    found = evaluated(make_trial(strides, "bench_12N.mcap")).default.groups["12N"]["k_s"]
    assert (found.first_cv, found.later_cv, found.n) == (0.15, 0.15, 3)


def test_separations_have_the_sign_of_the_labels(trials: list[LabTrial]) -> None:
    (found,) = evaluated(*trials).default.separation
    assert (found.groups, found.coefficient, found.n) == (("12N", "10.3N"), "k_s", (3, 3))
    assert found.pooled_sd == pytest.approx(1.0 / (0.05**0.5), abs=1e-4)


def test_logs_in_air_are_in_no_group_and_their_values_are_counted(trials: list[LabTrial]) -> None:
    report = evaluated(*trials).default
    assert (report.air.strides, report.mud.strides) == (1, 3 * 3 + 3 * 2 + 4)
    assert (report.air.coefficients["k_s"].values, report.air.coefficients["k_e"].bounds) == (1, 1)


def test_some_trials_and_none_make_tables_and_figures(trials: list[LabTrial]) -> None:
    for chosen in (trials, []):
        grouped = group_trials([(trial, group_of(trial.name, ())) for trial in chosen])
        mud = [trial for trial in chosen if trial.in_mud]
        for figure in (
            plots.draw_strokes(grouped),
            plots.draw_scatter(grouped),
            plots.draw_left_right(mud),
            plots.draw_sensitivity(mud),
        ):
            assert len(figure.axes) % len(METHODS) == 0
        tables = tables_of(evaluated(*chosen))
        assert bool(chosen) == any(table.section == "Method default" for table in tables)
        assert tables[-1].cells()[1] == ["x.csv", "x.csv: ends at line 1"]
