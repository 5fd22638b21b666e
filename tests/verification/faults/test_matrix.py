"""Every fault occurs once in a simulated robot and the reaction passes; the evaluation of a cell can also fail."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from itertools import cycle
from random import Random
from typing import Any

import pytest

import verification.faults.cell
import verification.faults.phases
from control.fault_causes import ANSWERED_S
from control.faults import FaultKind
from control.modes import Mode, Request
from control.rate import PERIOD_S
from drivers.can import stamp_clock
from drivers.fault_injection.failure_table import BY_NAME, FAILURE_MODES, PHASES, FailureMode
from experiments.study.workers import run_parallel
from simulation.harness.drive_presets import DRIVES
from tests.copied_robots import copy_of
from verification.faults.cell import FORBIDDEN_TICKS, run_cell
from verification.faults.energy_bounds import REACTING_TICKS
from verification.faults.evaluation import Cell, problems
from verification.faults.failing_robot import FaultBench
from verification.faults.injection import ACTS
from verification.faults.phases import bench_for, enter_phase
from verification.faults.protocol_differences import BY_TYPE, differences, mode_of
from verification.studies.faults import FAULTS

TYPES = ("odrive", "moteus", "mit", "odrive05", "mit:AK80-9")


def one_cell_of_each_fault() -> Iterator[tuple[str, str, int, str]]:
    """Choose a phase for each fault, preferably an early one, and a type of drive, preferably one that differs."""
    phases, drives = cycle(("hold", "idle", "hold", "arming")), cycle(TYPES)
    for mode in {mode.fault: mode for mode in reversed(BY_NAME.values())}.values():
        able = [drive for drive in TYPES if shows(drive, mode.name)]
        different = [drive for drive in able if mode.name in differences(drive)]
        phase = next((phase for _ in PHASES if (phase := next(phases)) in mode.phases), mode.phases[0])
        yield mode.name, phase, 1, next(drive for drive in drives if drive in (different or able))


def shows(drive: str, name: str) -> bool:
    difference = differences(drive).get(name)
    return difference is None or difference.exists and "waived" not in (difference.changes or ())


@cache
def answered_robot(drive: str, phase: str, hopeless: bool) -> FaultBench:
    """Return a robot whose drives have had their time to answer; every cell takes a copy of it."""
    bench = bench_for(phase, Random(1), hopeless, drive)
    bench.run_for(ANSWERED_S)
    return bench


def copied_robot(phase: str, random: Random, hopeless: bool, drive: str) -> FaultBench:
    return copy_of(answered_robot(drive, "recovery" if phase == "recovery" else "idle", hopeless))


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    """Begin cells with such copies, and let them last for twice the time in which torque that returns is noticed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verification.faults.cell, "AFTER_S", 2.0 * FORBIDDEN_TICKS * PERIOD_S)
        patch.setattr(verification.faults.cell, "bench_for", copied_robot)
        patch.setattr(verification.faults.phases, "ANSWERED_S", 0.0)
        yield


@pytest.fixture(scope="module")
def cells() -> Sequence[Cell]:
    return run_parallel([partial(run_cell, *key) for key in one_cell_of_each_fault()], lambda done, of: None)


def test_every_kind_of_fault_has_a_failure_mode_and_every_act_an_injector() -> None:
    assert set(FaultKind) - {FaultKind.UNCALIBRATED} <= set(FAULTS)  # which follows from the file alone
    assert {mode.act[0] for mode in FAILURE_MODES if mode.act} <= set(ACTS)


def test_the_robot_reacts_to_every_fault_as_its_kind_demands(cells: Sequence[Cell]) -> None:
    assert [(cell.mode_name, cell.phase, cell.why) for cell in cells if not cell.ok] == []
    assert {BY_NAME[cell.mode_name].fault for cell in cells} == set(FAULTS)


def test_a_cell_follows_from_its_name_phase_and_seed() -> None:
    first, again, other = (run_cell("drive_quiet", "hold", seed) for seed in (1, 1, 2))
    assert first == again
    assert first.peak_torque_nm != other.peak_torque_nm


@pytest.mark.parametrize("drive", DRIVES)
def test_the_differences_of_a_type_of_drive_name_failure_modes_and_faults(drive: str) -> None:
    table = differences(drive)
    assert set(table) <= set(BY_NAME) and all(difference.why for difference in table.values())
    for name in table:
        mode = mode_of(name, drive)
        assert {*mode.instead, *mode.also} <= set(FaultKind) and mode.why == table[name].why


def test_a_push_ends_with_the_fault_that_the_protocol_shows_at_the_latest() -> None:
    name = "encoder_stuck, at zero speed"
    cells = [run_cell(name, "stance", 1, drive) for drive in ("odrive", "moteus")]
    assert cells[1].ok
    assert {(cell.reaction, cell.bound_ticks) for cell in cells} == {("none", None)}  # any reaction will do
    assert [cell.pushed_bound_ticks for cell in cells] == [
        REACTING_TICKS + kind.bound_ticks for kind in (FaultKind.ENCODER_STUCK, FaultKind.JOINT_NOT_FOLLOWING)
    ]
    assert mode_of(name, "moteus").pushes_until in set(FaultKind)


def test_a_failure_that_a_drive_cannot_show_is_injected_and_its_energy_bounded() -> None:
    cell = run_cell("motor_hot", "hold", 1, "odrive05")
    assert (cell.ok, cell.reported, cell.bound_ticks) == (True, [], None) and cell.energy_j <= cell.energy_bound_j


def test_damping_in_stiff_mud_gives_no_energy_to_joints_whose_drives_answer_a_tick_late() -> None:
    """With velocities that did not know the torque sent since, 1.7 J in three seconds."""
    cell = run_cell("encoder_jump", "recovery", 1, "mit")
    assert cell.why == [] and cell.energy_j < 0.1


def test_the_phase_of_arming_waits_for_joints_that_move_while_idle() -> None:
    """A robot that is armed by force waits for no watchdog: its arms may still sink when the drives are ready."""
    bench, random = bench_for("arming", Random(1), drive="mit:AK80-9"), Random(1)
    request, refused = bench.loop.request, [True, False]

    def refused_once(*arguments: Any, **options: Any) -> str | None:
        return "a joint moves" if refused.pop(0) else request(*arguments, **options)

    vars(bench.loop)["request"] = refused_once
    enter_phase(bench, "arming", random)
    bench.step()
    assert refused == [] and bench.loop.mode in (Mode.ARMING, Mode.HOLD)


def test_a_stepped_wall_clock_ends_a_walk_only_where_its_stamps_are_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "none, wall clock +0.01 s"
    assert run_cell(name, "stance", 1).ok
    monkeypatch.setattr(stamp_clock, "STEP_S", 10.0)
    assert not run_cell(name, "stance", 1).ok


def test_torque_of_another_program_must_end_with_that_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """A moteus starts again with each foreign command; the torque of other drives must end once they are idle."""
    name = "foreign_commands"
    assert run_cell(name, "hold", 1, "moteus").ok
    monkeypatch.setitem(BY_TYPE, "moteus", {})
    assert "torque or closed loop came back by itself" in run_cell(name, "hold", 1, "moteus").why


# the evaluation


def run_mode(monkeypatch: pytest.MonkeyPatch, mode: FailureMode, phase: str = "hold") -> Cell:
    monkeypatch.setitem(BY_NAME, mode.name, mode)
    return run_cell(mode.name, phase, 1)


def test_a_missing_fault_fails_the_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = run_mode(monkeypatch, replace(BY_NAME["drive_quiet"], act=("nothing",)))
    assert not cell.ok and "no reaction" in cell.why and "torque at the end" in cell.why


def test_a_fault_in_the_control_group_fails_the_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = run_mode(monkeypatch, replace(BY_NAME["none"], act=(), drive=BY_NAME["voltage_low"].drive))
    assert cell.why == ["without a failure it reported voltage_low"]


@pytest.mark.parametrize("phase", ["idle", "hold"])
def test_a_robot_that_arms_again_fails_the_cell(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """An act requests torque in every step, also after the fault."""
    low_supply, requested = BY_NAME["voltage_under"], list[str | None]()

    @contextmanager
    def arm_again(bench: FaultBench, joint: str) -> Iterator[None]:
        bench.acts.append(lambda: requested.append(bench.loop.request(Request.ARM, bench.now_s)))
        with bench.drive_changed(joint, **low_supply.drive):
            yield

    monkeypatch.setitem(ACTS, "arm_again", arm_again)
    cell = run_mode(monkeypatch, replace(low_supply, act=("arm_again",)), phase)
    assert "torque or closed loop came back by itself" in cell.why


GOOD = Cell(
    fault="drive_quiet",
    mode_name="drive_quiet",
    phase="hold",
    seed=1,
    joint="left_sweep",
    reaction="damping",
    bound_ticks=5,
    reaction_ticks=4,
    reported_ticks=4,
    reported=["drive_quiet"],
    mode="fault",
    peak_torque_nm=0.3,
    zero_torque_ticks=100,
)


def test_a_good_cell_has_no_problem() -> None:
    assert list(problems(GOOD, BY_NAME["drive_quiet"])) == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"reaction_ticks": 6}, "6 ticks"),
        ({"reaction_ticks": None}, "no reaction"),
        ({"reported_ticks": 6}, "reported after 6"),
        ({"reported": []}, "no event"),
        ({"disarmed": False}, "by itself"),
        ({"rows_lost": 1}, "1 row"),
        ({"damping_torque_nm": 0.41}, "while damping"),
        ({"zero_torque_ticks": None}, "torque at the end"),
        ({"mode": "hold"}, "mode hold"),
        ({"stop_s": 3.3}, "3.3 s"),
        ({"exception": "KeyError: 1"}, "KeyError"),
        ({"energy_j": 0.51, "energy_bound_j": 0.5}, "0.51 J"),
        ({"pushed_ticks": 6, "pushed_bound_ticks": 5}, "end stop"),
    ],
)
def test_every_deviation_fails_the_cell(change: dict[str, Any], word: str) -> None:
    (message,) = problems(replace(GOOD, **change), BY_NAME["drive_quiet"])
    assert word in message
