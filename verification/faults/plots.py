"""The fault matrix as a picture: each reaction time as a fraction of its bound, by failure mode and phase."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from verification.faults.evaluation import Cell
from verification.faults.matrix import FaultsReport, ModeSummary

COLUMNS = 2  # panels side by side: there are many faults
HIGHEST_PERCENT = 100.0
DARK_PERCENT = 65.0  # from here on letters are white


def plot_faults(report: FaultsReport, path: Path) -> None:
    """Draw the ticks of the slowest seed, coloured by their fraction of the bound; a red cross is a failed cell.

    Where no reaction is demanded the energy takes the place of the ticks. The label of a row has the bound of the
    ticks, and the energy of a motor with its bound.
    """
    rows = report.faults
    phases = [phase for phase in report.settings.phases if any(cell.phase == phase for cell in report.cells)]
    columns = min(COLUMNS, len(rows))
    per_panel = -(-len(rows) // columns)
    figure = Figure(figsize=(12.0, 1.6 + 0.22 * per_panel), layout="constrained")
    panels = figure.subplots(1, columns, squeeze=False)[0]
    for i, panel in enumerate(panels):
        mesh = _plot_panel(panel, report, rows[i * per_panel : (i + 1) * per_panel], phases)
    bar = figure.colorbar(mesh, ax=list(panels), pad=0.01, shrink=0.6, aspect=40, extend="max")
    bar.set_label("% of the bound: slowest reaction in ticks of 2.63 ms; where none is demanded, energy in J")
    ok, cells = report.ok, len(report.cells)
    figure.suptitle(f"From the injection to the reaction: {ok} of {cells} cells within every bound", fontsize="medium")
    figure.savefig(path, dpi=110)


def _plot_panel(panel: Axes, report: FaultsReport, rows: Sequence[ModeSummary], phases: Sequence[str]) -> Any:
    percent = np.full((len(rows), len(phases)), np.nan)
    for y, row in enumerate(rows):
        for x, phase in enumerate(phases):
            cells = [cell for cell in report.cells if (cell.mode_name, cell.phase) == (row.mode_name, phase)]
            if cells:
                percent[y, x] = _write_cell(panel, x, y, cells)
    colours = colormaps["YlGnBu"].with_extremes(bad="#f4f4f4")
    mesh = panel.imshow(percent, cmap=colours, vmin=0.0, vmax=HIGHEST_PERCENT, aspect="auto")
    panel.set_xticks(range(len(phases)), list(phases), rotation=35, ha="left", fontsize="small")
    panel.xaxis.tick_top()
    panel.set_yticks(range(len(rows)), [_label(row) for row in rows], fontsize="x-small")
    panel.set_xticks(np.arange(len(phases) + 1) - 0.5, minor=True)
    panel.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
    panel.grid(which="minor", color="white", linewidth=1.0)
    panel.tick_params(length=0, which="both")
    for side in panel.spines.values():
        side.set_visible(False)
    return mesh


def _label(row: ModeSummary) -> str:
    bound = "" if row.bound_ticks is None else f"  ≤ {row.bound_ticks}"
    return f"{row.mode_name}{bound}  {row.energy_j:.1f} ≤ {row.energy_bound_j:.1f} J"


def _write_cell(panel: Axes, x: int, y: int, cells: Sequence[Cell]) -> float:
    """Write the slowest reaction in ticks, or the largest energy. Return it in percent of the bound."""
    text, percent = _reaction(cells) if cells[0].bound_ticks else _energy(cells)
    panel.text(
        x, y, text, ha="center", va="center", fontsize=6.5, color="white" if percent > DARK_PERCENT else "#333333"
    )
    if not all(cell.ok for cell in cells):
        panel.plot(x, y, "x", color="tab:red", markersize=11, markeredgewidth=2.0)
    return percent


def _reaction(cells: Sequence[Cell]) -> tuple[str, float]:
    ticks = max(cell.reaction_ticks or 0 for cell in cells)
    return str(ticks), 100.0 * ticks / (cells[0].bound_ticks or 1)


def _energy(cells: Sequence[Cell]) -> tuple[str, float]:
    largest = max(cells, key=lambda cell: cell.energy_j - cell.energy_bound_j)
    return f"{largest.energy_j:.1f}", 100.0 * largest.energy_j / max(largest.energy_bound_j, 1e-9)
