"""The estimation study: its trials, a short part of it in simulation, and its tables and picture."""

from typing import Any

import pytest
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.reports.coefficient_table import compared_frame, compared_rows
from experiments.reports.error_table import error_rows
from experiments.studies import estimation
from experiments.studies.estimation import (
    LAYERS,
    draw_errors,
    parse_layers,
    parse_water,
    run_part,
    study,
)
from experiments.study.option import OptionError
from experiments.trials.trial import TORQUE_ERROR
from simulation.mud.clay import clay_of_water
from tests.experiments.studies.synthetic_trials import SyntheticTrials
from tests.experiments.synthetic_strides import make_estimate, make_stride

STRONG = clay_of_water(47.6)
MUDS = [["47.6", STRONG.strength_pa]]


def synthetic(setup: str, muds: Any, **row: Any) -> dict[str, Any]:
    """Return one estimate that is 10 % too large, or a transition that was followed at once."""
    if len(muds) > 1:
        return {"evaluated": [], "transitions": [{"before": "a", "after": "b", "flipper": "left", "strides": 1}]}
    stride, keys = make_stride(k_p=make_estimate(1.1e6)), {"setup": setup, "mud": muds[0][0], "method": "default"}
    return {"evaluated": compared_rows(stride, {"k_p": 1e6}, {"k_p": 0.8e6}, **keys)[:1], "transitions": []}


# the trials


def test_there_is_a_trial_for_every_mud_and_seed_and_a_walk_over_borders_for_each_seed() -> None:
    trials = SyntheticTrials(synthetic)
    study(trials, seeds=3)
    walks, rows = [row for row in trials.rows if len(row["muds"]) > 1], trials.rows[3:]
    assert trials.rows[:3] == walks  # the longest first
    assert walks[0]["muds"] == walks[1]["muds"][::-1] and {row["strides"] for row in walks} == {24}
    assert len({(row["setup"], row["muds"][0][0], row["seed"]) for row in rows}) == len(rows) == 3 * (5 + 3 + 3)
    assert {(row["setup"], row["strides"]) for row in rows} == {("single", 2), ("walking", 8), ("measuring", 8)}
    assert all(row["layers"] == [*LAYERS] for row in trials.rows)


def test_muds_setup_and_layers_can_be_chosen() -> None:
    trials = SyntheticTrials(synthetic)
    settings = study(trials, setup="single", mud=(parse_water("48.5"),), seeds=1, layers=()).summary["settings"]
    study(trials, setup="walking", strength=(1500.0,), seeds=1, layers=())
    assert [row["muds"][0][0] for row in trials.rows] == ["48.5", "1500 Pa"]
    assert not any(row["layers"] for row in trials.rows)
    assert (settings["repeats"], settings["torque_error"]) == (False, 0.0)


def test_wrong_muds_and_layers_are_refused() -> None:
    for text in ("43.9", "56.1", "nan", "wet"):
        with pytest.raises(OptionError):
            parse_water(text)
    for text in ("fog", "noise,fog", "none,noise"):
        with pytest.raises(OptionError):
            parse_layers(text)
    with pytest.raises(OptionError):
        study(SyntheticTrials(synthetic), mud=(STRONG,), strength=(1500.0,))
    assert parse_layers("none") == parse_layers("") == () and parse_layers("noise,torque") == ("noise", "torque")


# in simulation


@pytest.fixture(scope="module")
def parts() -> dict[str, DataFrame]:
    """Simulate a trial of a single flipper and a short walk."""
    return {
        setup: compared_frame(row for row in run_part(setup, MUDS, strides, 1, LAYERS)["evaluated"])
        for setup, strides in (("single", 1), ("walking", 2))
    }


def test_the_default_is_closer_to_the_truth_than_the_paper(parts: dict[str, DataFrame]) -> None:
    for setup, coefficients in (("single", COEFFICIENTS), ("walking", ("k_p", "k_e"))):
        rows = {(row["setup"], row["coefficient"], row["method"]): row for row in error_rows(parts[setup])}
        name = "single flipper" if setup == "single" else setup
        for coefficient in coefficients:
            default, paper = (rows[name, coefficient, method] for method in ("default", "paper"))
            assert default["strides"] == paper["strides"] == (2 if setup == "single" else 4)
            assert default["median"] < paper["median"]


def test_where_the_walking_body_moves_the_default_gives_bounds_and_they_hold(parts: dict[str, DataFrame]) -> None:
    for row in error_rows(parts["walking"]):
        if (row["coefficient"], row["method"]) == ("k_s", "default"):
            assert row["bounds"] >= 2 and row["bounds"] + row["strides"] == 4 and row["bounds_hold"] == 1.0


def test_the_measuring_walk_finds_k_e_where_the_quick_one_finds_too_little() -> None:
    """Without disturbances, in mud of 49.5 %: right after a stance an extraction pulls less."""
    muds, biases = [[*clay_of_water(49.5)[:2]]], {}
    for setup in ("walking", "measuring"):
        rows = error_rows(compared_frame(run_part(setup, muds, 2, 1, ())["evaluated"]))
        (biases[setup],) = [
            row["bias"]
            for row in rows
            if (row["coefficient"], row["method"]) == ("k_e", "default") and "without" not in row["setup"]
        ]
    assert abs(biases["measuring"]) < 0.06
    assert biases["walking"] < biases["measuring"] - 0.08


def test_a_walk_over_a_border_reports_how_soon_the_estimate_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Strong mud follows after 10 cm; the first stride goes in at l sin 30° = 6 cm, and each is at most 12 cm long.

    So each flipper's transition is reported, and the estimate follows within three strides.
    """
    monkeypatch.setattr(estimation, "COMPARTMENT_M", 0.1)
    soft = [*clay_of_water(51.2)[:2]]
    part = run_part("walking", [soft, *MUDS], 4, 1, ())
    assert part["evaluated"] == []
    assert {(each["before"], each["after"]) for each in part["transitions"]} == {("51.2", "47.6")}
    assert sorted(each["flipper"] for each in part["transitions"]) == ["left", "right"]
    assert all(each["strides"] is not None and each["strides"] <= 3 for each in part["transitions"])


# tables and picture


def test_the_summary_has_errors_plates_boundaries_and_settings() -> None:
    result = study(SyntheticTrials(synthetic), seeds=1)
    report = result.json()
    assert {row["setup"] for row in report["errors"]} == {"single", "walking", "measuring"}
    assert report["errors"][0]["median"] == 0.1 and report["plates"][0]["upright_over_leaning"] == 0.8
    assert report["boundaries"] == [{"from": "a", "to": "b", "transitions": 1, "within_two": 1.0, "most_strides": 1}]
    assert report["settings"]["torque_error"] == TORQUE_ERROR
    assert "Mud boundaries" in result.text()
    assert len(draw_errors(report["errors"]).axes) == 3 * len(COEFFICIENTS)
