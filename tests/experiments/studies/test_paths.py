"""Walks along other paths than the crutching gait give the mud's coefficients."""

from math import isfinite
from pathlib import Path

import pytest
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.studies.grounds import GROUNDS
from experiments.studies.paths import errors_of, study, walk, with_load_errors
from experiments.study.option import OptionError
from experiments.study.trials import Trials
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_file import SHIPPED, as_json, gait_document
from simulation.mud.clay import Clay


def test_a_walk_along_another_path_gives_the_coefficients_of_a_load_cell() -> None:
    rows = DataFrame(walk("backward", as_json(gait_document("backward")), "clay-1.4", 1, 0.03, 3)["estimates"])
    predicted = [error for error in rows["load_error"] if isfinite(error.prediction)]
    assert len(predicted) == 6  # of the second stride of each flipper
    assert all(error.misfit < error.prediction < 0.25 for error in predicted)
    for name in COEFFICIENTS:
        found = rows[(rows["coefficient"] == name) & (rows["kind"] == "value")]
        assert len(found) >= 4, name
        assert ((found["value"] - found["truth"]).abs() < 2.5 * found["std_error"]).all(), name
        assert (found["value"] / found["truth"]).median() == pytest.approx(1.0, abs=0.25), name


def test_a_gait_file_that_was_edited_is_walked_again(tmp_path: Path) -> None:
    speeds_cm_s = []
    for gait in ("backward", "measuring"):
        (tmp_path / "own.toml").write_text((SHIPPED / f"{gait}.toml").read_text())
        trials = Trials(tmp_path, {}, lambda done, total: None)
        (table, *_) = study(trials, gait=(f"{tmp_path}/own.toml",), ground=("clay-1.4",), strides=3, seeds=1).tables
        speeds_cm_s += [*table.rows["speed_cm_s"]]
    assert speeds_cm_s[0] < 0.0 < speeds_cm_s[1]


@pytest.mark.parametrize(
    ("swept_deg", "depth_m", "wrong"), [(-70.0, 0.0, "limits.sweep_min_deg"), (-20.0, -0.01, "was in the ground")]
)
def test_a_gait_that_no_robot_may_walk_or_that_meets_no_ground_is_refused_in_words(
    tmp_path: Path, swept_deg: float, depth_m: float, wrong: str
) -> None:
    back, swing = (f"way_points = [{{ sweep_deg = {at}, depth_m = {depth_m} }}]\n" for at in (swept_deg, 20.0))
    phases = f'[[phase]]\nname = "stance"\nspeed_m_s = 0.3\n{back}[[phase]]\nname = "swing"\nduration_s = 0.5\n{swing}'
    (tmp_path / "own.toml").write_text(phases)
    trials = Trials(tmp_path, {}, lambda done, total: None)
    with pytest.raises((ConfigurationError, OptionError), match=wrong):
        study(trials, gait=(f"{tmp_path}/own.toml",), ground=("clay-1.4",), strides=3, seeds=1)


def test_estimates_that_are_not_valid_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """They name no depth, so no load cell can repeat them. In 300 Pa both flippers feel nothing but friction."""
    monkeypatch.setitem(GROUNDS, "soft", Clay("soft", 300.0))
    rows = walk("walking", as_json(gait_document("walking")), "soft", 1, 0.03, 3)["estimates"]
    counts = errors_of(with_load_errors(rows), "coefficient").set_index("coefficient")[
        ["strides", "bounds", "not_valid"]
    ]
    assert counts.sum(axis=1).to_dict() == dict.fromkeys(COEFFICIENTS, 6)
    assert (counts["not_valid"] > 0).all()
