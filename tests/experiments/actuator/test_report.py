"""The report of a calibration shows the results and their sources."""

from __future__ import annotations

from experiments.actuator.fit import JointFit, fit_joint
from experiments.actuator.report import make_result
from experiments.study.result import Result
from tests.experiments.actuator.test_fit import PLAN, Entries, make_entries


def make(entries: Entries) -> tuple[JointFit, Result]:
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None
    return fit, make_result(PLAN, {"right_sweep": entries}, [fit], None, simulated=False)


def test_the_papers_numbers_are_below_those_of_the_same_definition() -> None:
    fit, result = make(make_entries())
    ours, _, paper = result.tables[0].rows.to_dict("records")
    assert ours["RMSE"] == f"{fit.rmse_configured_nm:.4f}" and paper["RMSE"] == "0.0127"
    assert paper["RMSE fitted"] == "-" and paper["repeatability"] == "3.2 %"
    titles = [axis.get_title() for figure in result.figures for axis in figure.draw().axes]
    assert titles == ["right sweep"] * 2


def test_without_loops_there_is_a_report_without_friction() -> None:
    entries = make_entries()
    for entry in entries.values():
        entry.pop("loops", None)
    _, result = make(entries)
    assert [figure.name for figure in result.figures] == ["torques"]
    (friction,) = result.tables[1].rows.to_dict("records")
    assert (friction["dry friction"], friction["viscous"]) == ("-", "-")
    assert result.json()["joints"][0]["friction_nm"] is None
