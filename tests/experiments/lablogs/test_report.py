"""The summary of synthetic logs recovers the figures from which they were generated."""

from typing import Any

import pytest

from experiments.lablogs import plots
from experiments.lablogs.estimates import METHODS, EvaluatedLog, Refusal
from experiments.lablogs.log_choice import group_of
from experiments.lablogs.report import summary_of, tables_of
from tests.experiments.lablogs.synthetic_trials import (
    INVALID,
    joined,
    make_bound,
    make_log,
    make_stride,
    make_strides,
    make_value,
    make_walk,
)

FIRM, SOFT = (1.7e6, 2.0e6, 2.3e6), (0.9e6, 1.0e6, 1.1e6)


def single(name: str, *k_s: float) -> EvaluatedLog:
    return make_log(make_strides(*(make_value(k, 0.1e6) for k in k_s)), name)


def evaluated(*logs: EvaluatedLog) -> dict[str, Any]:
    groups = [group_of(log.name, ()) for log in logs]
    return summary_of(logs, groups, joined(*logs), [Refusal("x.csv", "x.csv: ends at line 1")])


LOGS = [
    *(single(f"single_12N_{i}.csv", k, 0.8 * k, 0.7 * k) for i, k in enumerate(FIRM)),
    *(single(f"single_10.3N_{i}.csv", k, 0.8 * k) for i, k in enumerate(SOFT)),
    make_walk([(make_value(2.0), make_value(2.0)), (make_bound(1.0), INVALID)]),
    make_log([make_stride(k_s=make_value(1e5), k_e=make_bound(1e5))], "single_12N_air.csv", in_mud=False),
]


@pytest.fixture(scope="module")
def summary() -> dict[str, Any]:
    return evaluated(*LOGS)


def test_groups_have_the_variation_and_the_counts_of_their_trials(summary: dict[str, Any]) -> None:
    groups = summary["groups"]
    assert list(groups) == ["12N", "10.3N", "walk 30N"]
    firm, soft, walk = (groups[name]["k_s"] for name in groups)
    assert firm.items() >= {"first_cv": 0.15, "later_cv": 0.15, "n": 3, "n_later": 3}.items()
    assert soft.items() >= {"first_cv": 0.1, "first_mean": 1000000, "values": 6}.items()
    assert soft["chi_between_trials"] == 1.0  # scatter and claimed error are 0.1e6
    assert walk.items() >= {"first_cv": None, "n": 0, "values": 2, "bounds": 1, "invalid": 1}.items()
    assert groups["12N"]["k_p"]["invalid"] == 9


def test_each_walk_of_a_log_on_a_fixed_base_is_a_trial() -> None:
    strides = [make_stride(index=i, k_s=make_value(k * d)) for k in FIRM for i, d in enumerate((1.0, 0.8))]
    found = evaluated(make_log(strides, "bench_12N.mcap"))["groups"]["12N"]["k_s"]
    assert found.items() >= {"first_cv": 0.15, "later_cv": 0.15, "n": 3}.items()


def test_separations_have_the_sign_of_the_labels(summary: dict[str, Any]) -> None:
    (found,) = summary["separation"]
    assert (found["groups"], found["coefficient"], found["n"]) == (["12N", "10.3N"], "k_s", [3, 3])
    assert found["pooled_sd"] == pytest.approx(1.0 / (0.05**0.5), abs=1e-4)


def test_logs_in_air_are_in_no_group_and_their_values_are_counted(summary: dict[str, Any]) -> None:
    air, mud = summary["air"], summary["mud"]
    assert (air["strides"], mud["strides"]) == (1, 3 * 3 + 3 * 2 + 4)
    assert (air["logs"], air["k_s"]["values"], air["k_e"]["bounds"]) == (["single_12N_air.csv"], 1, 1)


@pytest.mark.parametrize("logs", [LOGS, []])
def test_some_logs_and_none_make_tables_and_figures(logs: list[EvaluatedLog]) -> None:
    draws = (plots.draw_strokes, plots.draw_scatter, plots.draw_left_right, plots.draw_sensitivity)
    assert [len(draw(joined(*logs)).axes) for draw in draws] == [len(METHODS) * n for n in (2 if logs else 1, 3, 3, 3)]
    tables = tables_of(evaluated(*logs))
    assert bool(logs) == any(table.section == "Method default" for table in tables)
    if logs:  # the soft group's k_s, in the unit of the pictures
        assert dict(zip(tables[0].cells()[0], tables[0].cells()[5], strict=True))["first mean (N/cm³)"] == "1"
    assert tables[-1].cells()[1] == ["x.csv", "x.csv: ends at line 1"]
