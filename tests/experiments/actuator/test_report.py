"""The report of a calibration shows the results and their sources."""

from __future__ import annotations

from math import isnan

from experiments.actuator.fit import JointFit, fit_joint
from experiments.actuator.report import constant_rows, make_report, make_sections
from tests.experiments.actuator.test_fit import PLAN, Entries, make_entries


def make_fit(entries: Entries) -> JointFit:
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None
    return fit


def test_the_papers_numbers_are_below_those_of_the_same_definition() -> None:
    fit = make_fit(make_entries())
    head, ours, _, paper = constant_rows([fit])
    column = head.index("RMSE (N·m)")
    assert ours[column] == f"{fit.rmse_configured_nm:.4f}" and paper[column] == "0.0127"
    assert paper[head.index("RMSE fitted (N·m)")] == "-" and paper[head.index("repeatability")] == "3.2 %"
    assert {len(row) for row in constant_rows([fit])} == {len(head)}


def test_without_loops_there_is_a_report_without_friction() -> None:
    entries = make_entries()
    for entry in entries.values():
        entry.pop("loops", None)
    fit = make_fit(entries)
    _, friction, *_ = make_sections(PLAN, {"right_sweep": entries}, [fit])
    assert friction.heading == "Friction and offset" and not friction.figures
    assert friction.rows[1][1:3] == ["-", "-"]
    assert isnan(make_report(PLAN, {"right_sweep": entries}, [fit]).joints[0]["friction_nm"])
