"""The heat map of the fault matrix can be drawn for any cells."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.fault_injection.failure_table import BY_NAME
from verification.faults.evaluation import Cell
from verification.faults.matrix import Plan, report_of
from verification.faults.plots import plot_faults


def make_cells(ok: bool) -> list[Cell]:
    return [
        Cell(mode.fault, mode.name, phase, 1, "left_sweep", "warn", bound, reaction_ticks=bound and 4, ok=ok)
        for mode in list(BY_NAME.values())[::8]
        for phase in mode.phases
        for bound in [None if mode.fault == "none" else 5]
    ]


@pytest.mark.parametrize("cells", [make_cells(ok=True), make_cells(ok=False), make_cells(ok=True)[:1]])
def test_any_cells_make_a_picture(cells: list[Cell], tmp_path: Path) -> None:
    plot_faults(report_of(Plan(), cells), tmp_path / "faults.png")
    assert (tmp_path / "faults.png").read_bytes().startswith(b"\x89PNG")
