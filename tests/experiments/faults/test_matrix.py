"""Every fault once in a simulated robot, and whether the judgement of a cell can fail at all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import cycle
from random import Random
from typing import Any

import pytest

from control.faults import FaultKind
from control.modes import Mode, Request
from experiments.faults.bench import FaultBench
from experiments.faults.cell import run_cell
from experiments.faults.evaluation import Cell, problems
from experiments.faults.injection import BY_NAME, WAYS, Way
from experiments.faults.loop_causes import bug_in, nothing
from experiments.faults.matrix import FAULTS, Place, Plan, report_of
from experiments.faults.phases import PHASES, bench_for
from experiments.trials.parallel_trials import run_parallel


def one_place_of_each_fault() -> list[Place]:
    """In as many phases as there are, those that are reached soon more often."""
    phases = cycle(("hold", "idle", "stance", "hold", "arming"))
    firsts = {way.fault: way for way in reversed(WAYS)}.values()
    return [Place(way.name, next((p for _ in PHASES if (p := next(phases)) in way.phases), way.phases[0]), 1)
            for way in firsts]  # fmt: skip


@pytest.fixture(scope="module")
def cells() -> Sequence[dict[str, Any]]:
    return run_parallel([partial(run_cell, *place) for place in one_place_of_each_fault()], lambda done, of: None)


def test_every_kind_of_fault_is_caused_in_some_way() -> None:
    assert set(FaultKind) <= set(FAULTS)


def test_the_whole_table_is_large_and_reaches_every_phase() -> None:
    places = Plan().places
    assert len(places) >= 300 and len(set(places)) == len(places)
    assert {place.phase for place in places} == set(PHASES)
    assert {way.fault for way in WAYS} - set(FaultKind) == {"none", "daemon_killed", "daemon_hung", "bug_in_the_tick"}


def test_every_fault_once_is_answered_as_its_kind_says(cells: Sequence[dict[str, Any]]) -> None:
    assert [(cell["way"], cell["phase"], cell["why"]) for cell in cells if not cell["ok"]] == []
    assert {cell["fault"] for cell in cells} == set(FAULTS)


def test_what_should_stop_the_robot_leaves_it_without_torque(cells: Sequence[dict[str, Any]]) -> None:
    stopped = [cell for cell in cells if cell["reaction"] in ("soft_stop", "damping", "drives_idle")]
    assert len(stopped) > 20
    assert all(cell["zero_torque_ticks"] is not None and cell["disarmed"] for cell in stopped)
    assert any(cell["peak_torque_nm"] > 0.0 for cell in stopped)


def test_a_cell_follows_from_its_name_phase_and_seed() -> None:
    first, again, other = (run_cell("drive_quiet", "hold", seed) for seed in (1, 1, 2))
    assert first == again
    assert first["peak_torque_nm"] != other["peak_torque_nm"]


@pytest.mark.parametrize(("faults", "phases"), [(("fog",), PHASES), (FAULTS, ("midnight",))])
def test_what_there_is_not_is_refused(faults: tuple[str, ...], phases: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="must be one of"):
        Plan(faults, phases)


# the judgement


def with_way(monkeypatch: pytest.MonkeyPatch, way: Way, phase: str = "hold") -> dict[str, Any]:
    monkeypatch.setitem(BY_NAME, way.name, way)
    return run_cell(way.name, phase, 1)


def test_a_fault_that_nobody_made_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = with_way(monkeypatch, replace(BY_NAME["drive_quiet"], cause=nothing))
    assert not cell["ok"] and "no reaction" in cell["why"] and "torque in the end" in cell["why"]


def test_an_exception_that_nobody_meant_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = with_way(monkeypatch, replace(BY_NAME["clock_step"], cause=bug_in("controller.step")))
    assert "an exception escaped: DeliberateBugError: controller.step" in cell["why"]


def test_a_fault_in_the_control_group_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = with_way(monkeypatch, replace(BY_NAME["none"], cause=BY_NAME["voltage_low"].cause))
    assert cell["why"] == ["without a cause it told of voltage_low"]


LOW_SUPPLY = BY_NAME["voltage_under"]


@contextmanager
def eager(bench: FaultBench, joint: str) -> Iterator[None]:
    """Somebody asks for torque again and again, also when the fault is gone."""

    def ask() -> None:
        bench.loop.request(Request.ARM, bench.now_s)

    bench._acts.append(ask)
    with LOW_SUPPLY.cause(bench, joint):
        yield


@pytest.mark.parametrize("phase", ["idle", "hold"])
def test_a_robot_that_arms_again_is_a_failure(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = with_way(monkeypatch, replace(LOW_SUPPLY, cause=eager), phase)
    assert "torque or closed loop came back by itself" in cell["why"]


GOOD = Cell("drive_quiet", "drive_quiet", "hold", 1, "left_sweep", "damping", 5, 4, 4, ["drive_quiet"], "fault", 0.3,
            zero_torque_ticks=100)  # fmt: skip


def test_a_good_cell_has_no_problem() -> None:
    assert list(problems(GOOD, BY_NAME["drive_quiet"])) == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"reaction_ticks": 6}, "6 ticks"),
        ({"reaction_ticks": None}, "no reaction"),
        ({"told_ticks": 6}, "told after 6"),
        ({"told": []}, "no word"),
        ({"disarmed": False}, "by itself"),
        ({"rows_lost": 1}, "1 row"),
        ({"damping_torque_nm": 0.41}, "while damping"),
        ({"zero_torque_ticks": None}, "torque in the end"),
        ({"mode": "hold"}, "mode hold"),
        ({"stop_s": 3.3}, "3.3 s"),
        ({"exception": "KeyError: 1"}, "KeyError"),
    ],
)
def test_each_thing_that_should_not_be_is_told(change: dict[str, Any], word: str) -> None:
    (message,) = problems(replace(GOOD, **change), BY_NAME["drive_quiet"])
    assert word in message


def test_the_slowest_cell_stands_for_its_fault(cells: Sequence[dict[str, Any]]) -> None:
    cell = next(cell for cell in cells if cell["fault"] == "drive_quiet")
    slower = {**cell, "reaction_ticks": 99, "ok": False}
    (row,) = report_of(Plan(), [cell, slower])["faults"]
    assert (row["cells"], row["ok"], row["slowest_ticks"]) == (2, 1, 99)


# the bench


def make_bench() -> FaultBench:
    return bench_for("hold", Random(1))


def test_a_loop_that_stands_still_misses_those_ticks_and_the_robot_lives_on() -> None:
    bench = make_bench()
    bench.run_for(0.1)
    made, missed = bench.ticks_made, bench.loop.missed_ticks
    bench.stands_still = 5
    for _ in range(6):
        bench.step()
    assert (bench.ticks_made, bench.loop.missed_ticks) == (made + 1, missed + 5)
    assert bench.robot.now_s == pytest.approx(bench.now_s, abs=0.001)


def test_a_lease_that_is_lost_right_behind_an_arm_names_its_holder_and_arms_nothing() -> None:
    bench = make_bench()
    bench.run_for(1.0)
    bench.loop.lease.renew("alice", bench.now_s, 1.0)
    assert bench.loop.request(Request.ARM, bench.now_s) is None
    bench.loop.lease.hang_up("alice")
    bench.step()
    assert bench.loop.mode is Mode.IDLE
    assert FaultKind.LEASE_LOST.fault(holder="alice") in bench.loop.faults.present
