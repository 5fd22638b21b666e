"""`mudskipper experiment faults`: what it refuses, plans, prints and returns."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main
from verification.faults import matrix as faults
from verification.faults.evaluation import Cell
from verification.faults.matrix import FaultsReport, Plan, report_of

CELL = Cell("drive_quiet", "drive_quiet", "hold", 1, "left_sweep", "damping", bound_ticks=5, reaction_ticks=4,
            peak_torque_nm=0.31, travel_rad=0.2, ok=True)  # fmt: skip
LATE = replace(CELL, phase="stance", ok=False, reaction_ticks=9, why=["the reaction came after 9 ticks"])
CONTROL = replace(CELL, fault="none", mode_name="none", bound_ticks=None, reaction_ticks=None, travel_rad=None)


@pytest.fixture
def plans(monkeypatch: pytest.MonkeyPatch) -> list[Plan]:
    """Return the list of plans that the command would run; each run reports the three cells above at once."""
    seen: list[Plan] = []

    def run(plan: Plan, *_: object) -> FaultsReport:
        seen.append(plan)
        cells = [cell for cell in (CELL, LATE, CONTROL) if cell.phase in plan.phases]
        return report_of(plan, cells)

    monkeypatch.setattr(faults, "run", run)
    return seen


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((), "--simulated"),
        (("--simulated", "--fault", "fog"), "'fog': must be one of"),
        (("--simulated", "--phase", "midnight"), "'midnight': must be one of idle"),
        (("--simulated", "--fault", "flipper_stuck", "--phase", "idle"), "none of these faults"),
    ],
)
def test_an_impossible_plan_is_refused(
    arguments: tuple[str, ...], word: str, plans: list[Plan], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experiment", "faults", *arguments]) == exit_codes.USAGE
    assert word in capsys.readouterr().err and not plans


def test_the_default_is_the_whole_matrix(plans: list[Plan]) -> None:
    main(["experiment", "faults", "--simulated"])
    assert plans == [Plan()]


def test_faults_phases_and_seeds_can_be_chosen(plans: list[Plan]) -> None:
    arguments = ["--fault", "none", "--fault", "bus_off", "--fault", "none", "--phase", "hold", "--seeds", "3"]
    assert main(["experiment", "faults", "--simulated", *arguments]) == exit_codes.OK
    assert plans == [Plan(("none", "bus_off"), ("hold",), 3)]


def test_a_failed_cell_is_printed_with_its_reason_and_the_command_fails(
    plans: list[Plan], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experiment", "faults", "--simulated"]) == exit_codes.UNHEALTHY
    printed = capsys.readouterr().out
    assert "drive_quiet in stance, seed 1: the reaction came after 9 ticks" in printed
    assert "2 of 3 cells ok" in printed
    assert "drive_quiet damping 1/2 9 5" in " ".join(printed.split())


def test_the_report_is_printed_as_json_and_written(
    plans: list[Plan], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    main(["experiment", "faults", "--simulated", "--json", "--out", str(tmp_path)])
    report = json.loads(capsys.readouterr().out)
    assert report["cells"][0].items() >= {"fault": "drive_quiet", "phase": "hold", "bound_ticks": 5}.items()
    assert (tmp_path / "faults.png").exists() and (tmp_path / "report.html").exists()
