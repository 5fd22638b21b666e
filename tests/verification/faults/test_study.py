"""`mudskipper experiment faults`: which cells it runs, what it refuses, and what it makes of any cells."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any

import pytest
from pandas import DataFrame

from command_line import exit_codes
from command_line.main import main
from control.controller import WalkOrder
from control.modes import Mode, Request
from drivers.fault_injection.failure_table import PHASES
from experiments.study.result import Result
from experiments.study.session import Ending
from experiments.study.trials import Trials
from simulation.mud.flipper_contact import NO_CONTACT
from verification.faults.evaluation import Cell
from verification.faults.failing_robot import FailingRobot
from verification.faults.phases import real_configuration
from verification.studies import healthy_walks
from verification.studies.faults import FAULTS, study

pytestmark = pytest.mark.usefixtures("png_alone")

COMMAND = ["experiment", "faults", "--simulated"]


class AnyCells(Trials):
    """Gives every row the measurements of one cell; those in `late` fail."""

    def __init__(self, late: str = "") -> None:
        self.rows: list[dict[str, Any]] = []
        self._late = late

    def run(self, function: Callable[..., Any], rows: Any, **shared: Any) -> DataFrame:
        self.rows += rows
        return DataFrame([row | self._measured(row) for row in rows])

    def _measured(self, row: Mapping[str, Any]) -> dict[str, Any]:
        is_late, is_none = row["phase"] == self._late, row["mode_name"] == "none"
        cell = asdict(
            Cell(
                fault=row["mode_name"],
                mode_name="",
                phase="",
                seed=0,
                joint="left_sweep",
                reaction="damping",
                bound_ticks=None if is_none else 5,
                reaction_ticks=None if is_none else 9 if is_late else 4,
                energy_bound_j=0.2 if row["phase"] == "hold" else 4.3,
                ok=not is_late,
                why=["the reaction came after 9 ticks"] if is_late else [],
            )
        )
        return {name: value for name, value in cell.items() if name not in row}


def run(late: str = "", faults: Sequence[str] = FAULTS, **options: Any) -> tuple[Result, list[dict[str, Any]]]:
    trials = AnyCells(late)
    return study(trials, fault=tuple(faults), **options), trials.rows


def test_the_default_is_every_fault_in_every_phase() -> None:
    result, rows = run()
    assert len(rows) == len({tuple(row.values()) for row in rows}) >= 700
    assert {row["phase"] for row in rows} == set(PHASES)
    assert {row["fault"] for row in result.json()["faults"]} >= {"drive_quiet", "flipper_stuck"}
    assert result.ending is Ending.DONE


def test_what_differs_with_a_type_of_drive_is_reported_and_a_failure_that_it_cannot_have_has_no_cell() -> None:
    result, rows = run(drive="mit:AK80-9")
    assert "watchdog_off" not in {row["mode_name"] for row in rows}
    different = result.json()["differences"]
    assert different["watchdog_off"].startswith("does not exist: ")
    assert different["voltage_under"].startswith("any reaction, or none: ")
    assert (
        run(drive="moteus")[0].json()["differences"]["watchdog_off"].startswith("shown as foreign_commands and also ")
    )


def test_a_failed_cell_is_reported_with_its_reason_and_its_fault_with_the_slowest_cell(tmp_path: Path) -> None:
    result, _ = run("stance", ("none", "drive_quiet"), seeds=2)
    assert result.ending is Ending.UNHEALTHY
    row = next(row for row in result.json()["faults"] if row["mode_name"] == "drive_quiet")
    assert (row["cells"], row["ok"], row["slowest_ticks"], row["bound_ticks"]) == (18, 16, 9, 5)
    assert any("drive_quiet in stance, seed 2: the reaction came after 9 ticks" in note for note in result.notes)
    drawing = result.figures[0].draw()
    labels = [tick.get_text() for panel in drawing.axes for tick in panel.get_yticklabels()]
    assert {"none  ≤ 0.2 to 4.3 J", "drive_quiet  ≤ 5"} <= set(labels)
    drawing.savefig(tmp_path / "faults.png")
    assert (tmp_path / "faults.png").stat().st_size > 1000


def test_the_command_runs_the_chosen_cells(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    chosen = ["--fault", "drive_quiet", "--phase", "hold", "--workers", "1"]
    assert main([*COMMAND, *chosen, "--json", "--out", str(tmp_path / "faults")]) == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    (cell,) = report["cells"]
    assert (cell["mode_name"], cell["phase"], cell["ok"], cell["seed"]) == ("drive_quiet", "hold", True, 1)
    assert (tmp_path / "faults" / "faults.png").exists() and (tmp_path / "faults" / "report.html").exists()


def test_faults_that_cannot_occur_in_a_phase_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*COMMAND, "--fault", "flipper_stuck", "--phase", "idle"]) == exit_codes.USAGE
    assert not any(tmp_path.iterdir())


def test_a_walk_in_which_nothing_fails_has_no_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(healthy_walks, "WALK_S", 4.0)
    walked = healthy_walks.walk(3)
    assert walked["strides"] > 0 and walked["alarms"] == walked["held"] == []


def test_the_strides_of_all_walks_of_a_minute_count(monkeypatch: pytest.MonkeyPatch) -> None:
    def operate(robot: FailingRobot, chance: Random, order: WalkOrder) -> None:
        loop, stride = robot.loop, robot.loop.controller.target.stride
        if loop.mode is Mode.HOLD:
            loop.request(Request.WALK, robot.now_s, order)
        elif loop.mode is Mode.WALKING and stride == 1:
            loop.request(Request.STOP, robot.now_s)
        begun.append(stride)

    begun: list[int] = []
    monkeypatch.setattr(healthy_walks, "_operate", operate)
    monkeypatch.setattr(healthy_walks, "WALK_S", 9.0)
    strides = healthy_walks.walk(3)["strides"]
    assert strides == sum(now != before and now >= 0 for before, now in pairwise(begun)) > max(begun) + 1


def test_a_false_alarm_before_the_mud_holds_a_flipper_counts() -> None:
    faults = [(1.0, "current_stale", False), (2.0, "flipper_stuck", True), (2.5, "current_silent", False)]
    held, alarms = healthy_walks.counted_apart(faults)
    assert (held, alarms) == (["2.00 s: flipper_stuck"], ["1.00 s: current_stale"])


@pytest.mark.parametrize(
    ("subject", "left", "right", "held"),
    [
        ("left", (0.0, 0.0), (0.7, 0.0), False),  # a monitor that names the wrong flipper gives a false alarm
        ("left_sweep", (-0.375, 0.0), (0.0, 0.0), True),
        ("right_adduction", (0.0, 0.0), (0.0, 0.375), True),
        ("right", (0.7, 0.7), (0.374, -0.374), False),
    ],
)
def test_only_a_flipper_that_the_mud_loads_is_held_by_it(
    subject: str, left: tuple[float, float], right: tuple[float, float], held: bool
) -> None:
    arms = [
        SimpleNamespace(force=NO_CONTACT._replace(sweep_nm=sweep_nm, adduction_nm=adduction_nm))
        for sweep_nm, adduction_nm in (left, right)
    ]
    loop = SimpleNamespace(configuration=real_configuration("odrive"))
    robot: Any = SimpleNamespace(loop=loop, robot=SimpleNamespace(plant=SimpleNamespace(arms=arms)))
    assert healthy_walks.is_held(robot, subject) is held
