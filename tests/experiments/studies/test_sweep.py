"""The depth sweep of synthetic walks: what is counted, where a method settles, and the picture."""

from typing import Any

import pytest

from experiments.studies.sweep import draw, study
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


def test_each_constant_depth_has_its_speed_and_failures() -> None:
    (mud,) = swept().summary["strengths"]
    assert len(mud["constant"]) == len(DEPTHS_M) == 15
    found = [[mud["constant"][i][name] for name in ("depth_cm", "mean", "failures")] for i in (0, -1)]
    assert found == [[1.5, 2.0, {"slippage": 2}], [5.0, 6.0, {}]]
    assert mud["best"] == {"depth_cm": 3.0, "mean": 6.0}


@pytest.mark.parametrize(
    ("measure", "settled"),
    [
        # evaluated from its third stride on
        (walked, {"depth_cm": 5.0, "depth_range_cm": [4.5, 5.0], "mean": 5.0, "fraction_of_best": 0.833, "strides": 3,
                  "failures": {"extraction": 1}, "faults": []}),
        # in a mud in which nothing moves
        (lambda **row: Walk([stride(0.02, 0.0)] * 3, "").entry, {"mean": 0.0, "fraction_of_best": None}),
        # in a walk that a fault ended early
        (lambda **row: Walk([stride(0.02, 0.1)], "a drive is silent").entry,
         {"depth_cm": None, "mean": 0.0, "faults": ["a drive is silent"]}),
    ],
)  # fmt: skip
def test_a_method_has_the_depth_speed_and_failures_at_which_it_settles(measure: Any, settled: dict[str, Any]) -> None:
    result = swept(measure)
    found = result.json()["strengths"][0]["methods"]["default"]
    assert found | settled == found
    assert ("- cm" in result.text()) == (found["depth_cm"] is None)


def test_the_picture_has_a_map_with_the_best_depth_and_the_methods() -> None:
    strength = (300.0, 680.0, 6000.0)
    over, below, bar = draw(swept(strength=strength).summary["strengths"]).axes
    assert {*over.get_legend_handles_labels()[1]} >= {"best constant depth", "method default"}
    assert len(below.get_xticks()) == len(strength)
    assert bar.get_ylabel() == "speed (cm/s)"
