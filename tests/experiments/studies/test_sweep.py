"""The depth sweep of synthetic walks: what is counted, where a method settles, and the picture."""

from __future__ import annotations

from typing import Any

import pytest

from experiments.studies.sweep import STRENGTHS_PA, draw, study
from experiments.study.result import Result
from experiments.trackway.simulated_walk import DEPTHS_M
from experiments.trackway.walk import Walk, WalkedStride
from tests.experiments.studies.synthetic_trials import SyntheticTrials


def stride(depth_m: float, step_m: float, pushed_back_m: float = 0.0) -> WalkedStride:
    return WalkedStride("mud", 0.0, depth_m, step_m, 2.0, pushed_back_m)


def walked(depth_m: float = 0.0, method: str = "", **row: Any) -> dict[str, Any]:
    """Return a walk at 2 cm/s with slip to 3 cm depth, deeper at 6 cm/s; a method begins at 2 cm and fails once."""
    if not method:
        return Walk([stride(depth_m, 0.04 if depth_m < 0.03 else 0.12)] * 3, "").entry
    steps = [stride(0.02, 0.04)] * 2 + [stride(0.05, 0.06, 0.05), stride(0.05, 0.12), stride(0.045, 0.12)]
    return Walk(steps, "").entry


def swept(measure: Any = walked, strength: tuple[float, ...] = (680.0,)) -> Result:
    return study(SyntheticTrials(measure), strength=strength, method=("default",), seeds=1)


def test_the_default_muds_range_from_soup_to_firm_clay_and_every_method_walks_there() -> None:
    trials = SyntheticTrials(walked)
    muds = study(trials).summary["strengths"]
    assert [mud["strength_pa"] for mud in muds] == sorted(STRENGTHS_PA) and len(muds) == 12
    assert {row.get("method") for row in trials.rows} >= {"default", "paper", "gait", None}
    assert [row["strength_pa"] for row in trials.rows[:2]] == [300.0, 300.0] and trials.rows[0]["method"]


def test_each_constant_depth_has_its_speed_and_failures() -> None:
    (mud,) = swept().summary["strengths"]
    shallow, deep = mud["constant"][0], mud["constant"][-1]
    assert len(mud["constant"]) == len(DEPTHS_M) == 15
    assert (shallow["depth_cm"], shallow["mean"], shallow["failures"]) == (1.5, 2.0, {"slippage": 2})
    assert (deep["depth_cm"], deep["mean"], deep["failures"]) == (5.0, 6.0, {})
    assert mud["best"] == {"depth_cm": 3.0, "mean": 6.0}


def test_a_method_is_evaluated_from_its_third_stride_on() -> None:
    settled = swept().summary["strengths"][0]["methods"]["default"]
    assert (settled["depth_cm"], settled["depth_range_cm"]) == (5.0, [4.5, 5.0])
    assert settled["mean"] == pytest.approx(5.0)
    assert settled["fraction_of_best"] == pytest.approx(5.0 / 6.0, abs=0.001)  # rounded
    assert (settled["strides"], settled["failures"]) == (3, {"extraction": 1})


def test_a_mud_in_which_nothing_moves_gives_no_fraction_of_the_best() -> None:
    (mud,) = swept(lambda **row: Walk([stride(0.02, 0.0)] * 3, "").entry).summary["strengths"]
    assert mud["best"]["mean"] == 0.0 and mud["methods"]["default"]["fraction_of_best"] is None


def test_a_walk_that_a_fault_ended_early_has_no_depth_and_reports_the_fault() -> None:
    result = swept(lambda **row: Walk([stride(0.02, 0.1)], "a drive is silent").entry)
    settled = result.json()["strengths"][0]["methods"]["default"]
    assert (settled["depth_cm"], settled["mean"], settled["faults"]) == (None, 0.0, ["a drive is silent"])
    assert "- cm" in result.text() and "fault" in result.text()


@pytest.mark.parametrize("strength", [(300.0, 680.0, 6000.0), (680.0,)])
def test_the_picture_has_a_map_with_the_best_depth_and_the_methods(strength: tuple[float, ...]) -> None:
    over, below, bar = draw(swept(strength=strength).summary["strengths"]).axes
    assert {*over.get_legend_handles_labels()[1]} >= {"best constant depth", "method default"}
    assert len(below.get_xticks()) == len(strength)
    assert bar.get_ylabel() == "speed (cm/s)"
