"""The simulated trackway: its plan, its report of synthetic walks, and a short trackway in simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from experiments.study.notebook import Notebook
from experiments.study.workers import LocalWorkers
from experiments.trackway.one_mud import STARTING, BestDepth, MudWalk
from experiments.trackway.report import ADAPTIVE, PAPER_TABLE, Speed
from experiments.trackway.simulation import FIXED, Plan, SimulatedReport, end_of, is_over, report_of, rules_of, run
from experiments.trackway.walk import Walk, WalkedStride
from simulation.mud.clay import MUDS
from simulation.mud.track import paper_track

NAMES = list(MUDS)


def stride(mud: str, position_m: float = 0.0, step_m: float = 0.12, duration_s: float = 2.0) -> WalkedStride:
    return WalkedStride(mud, position_m, 0.03, step_m, duration_s, 0.0)


# the plan


def test_the_default_plan_is_the_papers_trackway() -> None:
    plan = Plan()
    assert [rule.name for rule in plan.rules] == ["3 cm", "5 cm", ADAPTIVE]
    assert [rule.depth_m for rule in plan.rules[:2]] == [0.03, 0.05]
    assert (plan.rules[2].method, plan.seeds) == ("default", 3)
    segments = paper_track().segments
    assert [segment.clay for segment in segments] == list(plan.muds)
    assert [segment.end_m for segment in segments] == pytest.approx([plan.compartment_m * n for n in (1, 2, 3)])


def test_the_first_method_is_the_adaptive_row_and_others_have_their_names() -> None:
    assert rules_of(["paper"])[2:] == (rules_of(["default"])[2]._replace(method="paper"),)
    assert [(rule.name, rule.method) for rule in rules_of(["default", "paper"])[2:]] == [
        ("adaptive", "default"),
        ("adaptive, paper", "paper"),
    ]
    assert rules_of(["default"])[:2] == FIXED


# the end of a walk


@pytest.mark.parametrize(("step_m", "over"), [(0.12, False), (0.14, True), (0.13, True)])
def test_a_walk_is_over_when_the_plates_would_go_down_past_the_end(step_m: float, over: bool) -> None:
    assert is_over(1.75, [stride("45.3", 1.62, step_m)]) is over


def test_a_walk_is_over_after_90_s_in_one_mud_and_not_in_all_muds() -> None:
    slow = [stride("a", 0.1, 0.0, 44.0), stride("b", 0.7, 0.0, 44.0), stride("b", 0.7, 0.0, 44.0)]
    assert not is_over(1.83, []) and not is_over(1.83, slow)
    assert is_over(1.83, [*slow, stride("b", 0.7, 0.0, 2.0)])


def test_the_end_of_a_walk_is_described() -> None:
    plan = Plan()
    assert end_of(plan, Walk([stride("45.3", 1.80)], "")) == "past the end"
    assert end_of(plan, Walk([stride("53.1", 0.80)], "")) == "stuck in 53.1"
    assert end_of(plan, Walk([], "a drive is silent")) == "a drive is silent"


# the report


def synthetic_report(**changes: Any) -> SimulatedReport:
    """Return a report in which every gait makes 6 cm/s in each mud, and the best constant depth 8 cm/s."""
    plan = replace(Plan(rules=rules_of(["default", "paper"]), seeds=2), **changes)
    walks = [Walk([stride(mud, 1.8) for mud in NAMES for _ in range(3)], "")] * plan.seeds
    constant = {mud: {0.02: 7.0, 0.0275: 8.0} for mud in NAMES}
    return report_of(plan, {rule.name: list(walks) for rule in plan.rules}, constant)


def test_each_gait_has_its_ratio_to_the_best_constant_depth() -> None:
    report = synthetic_report()
    assert report.best_constant_depth == dict.fromkeys(NAMES, BestDepth(2.75, 8.0))
    assert report.best_constant_mean_over_muds == 8.0
    assert report.over_best["adaptive, paper"] == dict.fromkeys(NAMES, 0.75)


def test_only_fixed_depths_are_compared_with_the_papers_sd() -> None:
    report = synthetic_report()
    assert report.within_one_sd == {
        rule: {mud: abs(6.0 - paper.mean) <= paper.sd for mud, paper in PAPER_TABLE[rule].items()}
        for rule in ("3 cm", "5 cm")
    }
    assert report.within_one_sd["5 cm"] == {"48.5": False, "53.1": True, "45.3": False}
    assert report.paper["adaptive"]["53.1"] == Speed(5.1, 0.3)


def test_a_gait_that_got_stuck_has_no_speed_in_later_muds() -> None:
    plan = Plan(rules=FIXED[:1], seeds=1)
    stuck = Walk([stride("48.5")] * 3 + [stride("53.1", 0.7, 0.001)] * 3, "")
    report = report_of(plan, {"3 cm": [stuck]}, {mud: {0.02: 7.0} for mud in NAMES})
    assert report.table["3 cm"]["45.3"].mean is None
    assert report.within_one_sd["3 cm"]["45.3"] is None
    assert report.mean_over_muds["3 cm"].mean is None
    assert report.over_best["3 cm"]["45.3"] is None
    assert report.ends == {"3 cm": {"stuck in 53.1": 1}}


# an interrupted experiment


class Quick(Plan):
    """A plan whose walks are synthetic."""

    def walks(self) -> dict[str, Callable[[], Walk]]:
        return dict.fromkeys(super().walks(), quick)


def quick() -> Walk:
    return Walk([stride(mud, 1.8) for mud in NAMES for _ in range(3)], "")


def test_a_continued_experiment_repeats_no_walk(tmp_path: Path) -> None:
    plan = Quick(seeds=1, constant_depths_m=(0.03,))

    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(plan, Notebook(tmp_path, plan.identity), interrupt, LocalWorkers(1))
    again, shown = Notebook(tmp_path, plan.identity), list[tuple[int, int]]()
    assert len(again.entries) == 2
    report = run(plan, again, lambda done, total: shown.append((done, total)), LocalWorkers(1))
    assert shown == [(2, 6), (3, 6), (4, 6), (5, 6), (6, 6)]
    assert report == run(plan, Notebook(tmp_path / "other", plan.identity), lambda done, total: None, LocalWorkers(1))


def test_every_walk_has_a_key_of_its_own() -> None:
    plan = Plan(rules=rules_of(["default", "paper"]), seeds=2, constant_seeds=2)
    assert len(plan.walks()) == 4 * 2 + len(plan.constant_walks()) == 4 * 2 + 3 * 15 * 2


# in simulation


class Short(Plan):
    """A plan whose walks at a constant depth have only one stride that counts."""

    def constant_walks(self) -> list[MudWalk]:
        return [order._replace(strides=STARTING + 1) for order in super().constant_walks()]


SHORT = Short(compartment_m=0.2, seeds=1, constant_depths_m=(0.03,), constant_seeds=1)


@cache
def short() -> SimulatedReport:
    """Simulate compartments of less than two steps, with one seed and one constant depth."""
    with TemporaryDirectory() as folder:
        return run(SHORT, Notebook(Path(folder), SHORT.identity), lambda done, total: None)


def test_a_short_trackway_is_walked_from_mud_to_mud_past_its_end() -> None:
    for trials in short().walks.values():
        (strides,) = trials
        assert list(dict.fromkeys(each.mud for each in strides)) == NAMES
        assert strides[-1].position_cm + strides[-1].step_cm >= 60.0
    assert all(ends == {"past the end": 1} for ends in short().ends.values())


def test_fixed_gaits_keep_their_depth_and_the_adaptive_one_does_not() -> None:
    depths = {rule: {each.depth_cm for each in trials[0]} for rule, trials in short().walks.items()}
    assert (depths["3 cm"], depths["5 cm"]) == ({3.0}, {5.0})
    assert len(depths["adaptive"]) > 1


def test_three_centimetres_slip_in_the_soft_mud_and_five_do_not() -> None:
    table = short().table
    assert table["3 cm"]["53.1"].failures.get("slippage", 0) > 0
    assert table["5 cm"]["53.1"].failures == {}
    deep, shallow = table["5 cm"]["53.1"].mean, table["3 cm"]["53.1"].mean
    assert deep and shallow and deep > 2.0 * shallow


def test_flippers_get_stuck_in_the_firmest_mud_at_five_centimetres_and_not_at_three() -> None:
    table = short().table
    assert "extraction" in table["5 cm"]["45.3"].failures
    assert "extraction" not in table["3 cm"]["45.3"].failures
