"""The trackway study: Table I of synthetic walks, and a short trackway in simulation."""

from typing import Any

import pytest

from experiments.studies.trackway import study
from experiments.study.result import Result
from experiments.trackway.plots import draw_trackway
from experiments.trackway.simulated_walk import (
    METHODS,
    end_of,
    robot_of,
    speed_cm_s,
)
from experiments.trackway.walk import Walk, WalkedStride
from simulation.mud.clay import MUDS
from tests.experiments.studies.synthetic_trials import SyntheticTrials


def stride(mud: str, position_m: float = 0.0, step_m: float = 0.12, duration_s: float = 2.0) -> WalkedStride:
    return WalkedStride(mud, position_m, 0.03, step_m, duration_s, 0.0)


WHOLE = Walk([stride(mud) for mud in MUDS for _ in range(3)], "")


def walked(walk: Walk = WHOLE, **row: Any) -> dict[str, Any]:
    """Return 6 cm/s over the trackway, and in one mud 8 cm/s at the depth of 2.75 cm, else 7 cm/s."""
    if "compartment_m" in row:
        return walk.entry
    step_m = 0.16 if row["depth_m"] == 0.0275 else 0.14
    return Walk([stride("mud", 0.0, step_m)] * 3, "").entry


def reported(walk: Walk = WHOLE) -> Result:
    trials = SyntheticTrials(lambda **row: walked(walk, **row))
    return study(trials, trials=2, method=("default", "paper", "default"))


# the end of a walk, and the strides that count


SLOW = [stride("a", 0.1, 0.0, 44.0), stride("b", 0.7, 0.0, 44.0), stride("b", 0.7, 0.0, 44.0)]


@pytest.mark.parametrize(
    ("strides", "end"),
    [
        ([stride("45.3", 1.62, 0.12)], ""),
        ([stride("45.3", 1.62, 0.13)], "past the end"),
        (SLOW, ""),
        ([*SLOW, stride("b", 0.7, 0.0, 2.0)], "stuck in b"),
    ],
)
def test_a_walk_ends_where_the_plates_would_go_down_past_the_end_and_after_90_s_in_one_mud(
    strides: list[WalkedStride], end: str
) -> None:
    assert end_of(strides, 1.75) == end


@pytest.mark.parametrize("method", ["", *METHODS])
def test_a_constant_depth_and_the_paper_s_method_are_walked_by_the_papers_robot(method: str) -> None:
    robot = robot_of(method)
    assert robot.estimation.method == ("paper" if method in ("", "paper") else "default")
    assert not method or robot.adaptation.method == method


def test_the_first_stride_of_a_constant_depth_does_not_count() -> None:
    walk = Walk([stride("firm", 0.0, step_m) for step_m in (0.02, 0.10, 0.14)], "")
    assert speed_cm_s(walk) == pytest.approx(6.0) and speed_cm_s(walk, skipped=2) == pytest.approx(7.0)
    assert speed_cm_s(Walk([stride("firm")], "a motor was too hot")) == 0.0


# the report


def test_each_gait_has_its_ratio_to_the_best_constant_depth() -> None:
    report = reported().summary
    assert report["best_constant_depth"] == dict.fromkeys(MUDS, {"depth_cm": 2.75, "mean": 8.0})
    assert report["best_constant_mean_over_muds"] == 8.0
    assert list(report["table"]) == ["3 cm", "5 cm", "adaptive", "adaptive, paper"]
    assert report["over_best"]["adaptive, paper"] == dict.fromkeys(MUDS, 0.75)
    assert report["constant_depth_cm_s"]["48.5"]["2"] == 7.0


def test_a_gait_that_got_stuck_has_no_speed_in_later_muds() -> None:
    result = reported(Walk([stride("48.5")] * 3 + [stride("53.1", 0.7, 0.001, 50.0)] * 2, ""))
    report = result.summary
    assert report["table"]["3 cm"]["45.3"]["mean"] is None
    assert report["within_one_sd"]["3 cm"]["45.3"] is None
    assert report["mean_over_muds"]["3 cm"]["mean"] is None
    assert report["over_best"]["3 cm"]["45.3"] is None
    assert report["ends"]["3 cm"] == {"stuck in 53.1": 2}
    assert result.notes and result.notes[0].endswith("8 times.")  # two trials of four gaits had two strides there


def test_the_picture_has_a_line_for_each_gait_and_a_dot_for_each_speed() -> None:
    figure = draw_trackway(reported().summary)
    panels = {panel.get_ylabel(): panel for panel in figure.axes}
    assert set(panels) == {"step length (cm)", "depth (cm)", "speed (cm/s)"}
    assert len(panels["step length (cm)"].lines) >= 4 and figure.legends
