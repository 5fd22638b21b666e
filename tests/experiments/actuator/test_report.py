"""The report of a calibration shows the results and their sources."""

from dataclasses import replace

import pytest

from experiments.actuator.fit import fit_joint
from experiments.actuator.plots import draw_torques
from experiments.actuator.report import make_result
from tests.experiments.actuator.test_fit import PLAN, make_entries


def test_without_loops_there_is_a_report_without_friction() -> None:
    entries = make_entries()
    for entry in entries.values():
        entry.pop("loops", None)
    fit = fit_joint("right_sweep", PLAN, entries, 0.083)
    assert fit is not None
    result = make_result(PLAN, {"right_sweep": entries}, [fit], None, simulated=False)
    assert [figure.name for figure in result.figures] == ["torques"]
    (friction,) = result.tables[1].rows.to_dict("records")
    assert (friction["dry friction"], friction["viscous"]) == ("-", "-")
    assert result.json()["joints"][0]["friction_nm"] is None


@pytest.mark.parametrize(
    ("joint", "sign", "is_remarked"),
    [("right_adduction", 1.0, False), ("right_adduction", -1.0, True), ("right_sweep", -1.0, False)],
)
def test_weights_that_pull_an_adduction_joint_upwards_are_remarked(joint: str, sign: float, is_remarked: bool) -> None:
    """The motor's current is positive where it lifts; a sweep joint may be mounted on either side."""
    entries = make_entries(sign=sign)
    fit = fit_joint(joint, PLAN, entries, 0.083)
    assert fit is not None and fit.numbers["torque_constant_nm_a"] > 0.0
    result = make_result(replace(PLAN, joints=(joint,)), {joint: entries}, [fit], None, simulated=False)
    assert any(f"check drive.{joint}.sign" in note for note in result.notes) is is_remarked


def test_the_lowest_panel_of_each_column_names_its_axis() -> None:
    fit = fit_joint("right_sweep", PLAN, make_entries(), 0.083)
    assert fit is not None
    panels = draw_torques([fit] * 3).axes
    assert [bool(panel.get_xlabel()) for panel in panels] == [False, True, True, False]
