"""The heat map of faults: it is drawn whatever there is in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")

from experiments.faults.injection import WAYS
from experiments.faults.matrix import Plan, report_of
from experiments.faults.plots import plot_faults


def make_cells(ok: bool) -> list[dict[str, Any]]:
    return [
        {
            "fault": way.fault, "way": way.name, "phase": phase, "seed": 1, "reaction": "warn", "ok": ok,
            "bound_ticks": None if way.fault == "none" else 5, "reaction_ticks": None if way.fault == "none" else 4,
            "peak_torque_nm": 0.1, "travel_rad": None,
        }
        for way in WAYS
        for phase in way.phases
    ]  # fmt: skip


@pytest.mark.parametrize("ok", [True, False])
def test_it_draws_every_fault(ok: bool, tmp_path: Path) -> None:
    plot_faults(report_of(Plan(), make_cells(ok)), tmp_path / "faults.png")
    assert (tmp_path / "faults.png").read_bytes().startswith(b"\x89PNG")


def test_it_draws_one_cell(tmp_path: Path) -> None:
    plot_faults(report_of(Plan(), make_cells(True)[:1]), tmp_path / "faults.png")
    assert (tmp_path / "faults.png").stat().st_size > 1000
