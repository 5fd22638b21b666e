"""The report of synthetic trials recovers the figures from which they were generated."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.lablogs.lab_trial import LabTrial, Refusal
from experiments.lablogs.lablogs import Evaluated, Plan, group_trials
from experiments.lablogs.log_choice import GroupRule
from experiments.lablogs.report import report_of
from experiments.lablogs.text import lablogs_finding
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


def evaluated(*trials: LabTrial) -> Evaluated:
    grouped = [(trial, Plan([]).group_of(trial.name)) for trial in trials]
    return Evaluated(grouped, report_of(grouped, group_trials(grouped), [Refusal("x.csv", "x.csv: ends at line 1")]))


@pytest.fixture
def trials() -> list[LabTrial]:
    firm = [single(f"single_12N_{i}.csv", k, 0.8 * k, 0.7 * k) for i, k in enumerate(FIRM)]
    soft = [single(f"single_10.3N_{i}.csv", k, 0.8 * k) for i, k in enumerate(SOFT)]
    walk = make_walk([(make_value(2.0), make_value(2.0)), (make_bound(1.0), INVALID)])
    air = make_trial([make_stride(k_s=make_value(1e5), k_e=make_bound(1e5))], "single_12N_air.csv", in_mud=False)
    return [*firm, *soft, walk, air]


def test_groups_have_the_variation_and_the_counts_of_their_trials(trials: list[LabTrial]) -> None:
    groups = evaluated(*trials).report.default.groups
    assert list(groups) == ["12N", "10.3N", "walk 30N"]
    firm, soft, walk = (groups[name]["k_s"] for name in groups)
    assert (firm.first_cv, firm.later_cv, firm.n, firm.n_later) == (0.15, 0.15, 3, 3)
    assert (soft.first_cv, soft.first_mean, soft.values) == (0.1, 1000000, 6)
    assert soft.chi_between_trials == 1.0  # scatter and claimed error are 0.1e6
    assert (walk.first_cv, walk.n, walk.values, walk.bounds, walk.invalid) == (None, 0, 2, 1, 1)
    assert groups["12N"]["k_p"].invalid == 9


def test_each_walk_of_a_log_on_a_fixed_base_is_a_trial() -> None:
    strides = [make_stride(index=i, k_s=make_value(k * d)) for k in FIRM for i, d in enumerate((1.0, 0.8))]
    found = evaluated(make_trial(strides, "bench_12N.mcap")).report.default.groups["12N"]["k_s"]
    assert (found.first_cv, found.later_cv, found.n) == (0.15, 0.15, 3)


def test_separations_have_the_sign_of_the_labels(trials: list[LabTrial]) -> None:
    (found,) = evaluated(*trials).report.default.separation
    assert (found.groups, found.coefficient, found.n) == (("12N", "10.3N"), "k_s", (3, 3))
    assert found.pooled_sd == pytest.approx(1.0 / (0.05**0.5), abs=1e-4)


def test_logs_in_air_are_in_no_group_and_their_values_are_counted(trials: list[LabTrial]) -> None:
    report = evaluated(*trials).report.default
    assert (report.air.strides, report.mud.strides) == (1, 3 * 3 + 3 * 2 + 4)
    assert (report.air.coefficients["k_s"].values, report.air.coefficients["k_e"].bounds) == (1, 1)


def test_named_logs_alone_are_air() -> None:
    plan = Plan([], air=("*_air*",))
    assert plan.is_in_mud(single("single_12N_1.csv", 1.0)._replace(in_mud=False))
    assert not plan.is_in_mud(single("single_12N_air.csv", 1.0))


def test_patterns_without_a_log_are_found() -> None:
    plan = Plan([(Path("a/pond_1.csv"),)], (GroupRule("pond*", "wet"), GroupRule("lake*", "dry")), ("air*",))
    assert plan.unmatched() == ["lake*", "air*"]


def test_some_trials_and_none_make_figures(trials: list[LabTrial], tmp_path: Path) -> None:
    for name, chosen in {"some": trials, "none": []}.items():
        for section in lablogs_finding(evaluated(*chosen)).sections:
            for figure in section.figures:
                path = tmp_path / f"{name}-{figure.name}.png"
                figure.draw(path)
                assert path.read_bytes().startswith(b"\x89PNG")
