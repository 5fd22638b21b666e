"""Every fault in every phase: how soon the robot reacts, with what torque and travel, and what it does afterwards.

A cell of the matrix is one failure mode, injected at one tick of one phase into a robot of its own; cell.py evaluates
it. The seed draws the mud, the joint, and the tick within the phase.
"""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from typing import Annotated, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from drivers.drive_types import DEFAULT
from drivers.fault_injection.failure_table import BY_NAME, PHASES
from experiments.reports.style import INK, TRAIL, WIDTH_IN
from experiments.study.option import Option, OptionError
from experiments.study.result import Figure, Result, Table
from experiments.study.session import Ending
from experiments.study.trials import Trials
from simulation.harness.drive_presets import DRIVES
from verification.faults.cell import run_cell
from verification.faults.protocol_differences import differences

SCHEMA = 2
FAULTS = tuple(dict.fromkeys(mode.fault for mode in BY_NAME.values()))
TICKS = ("bound_ticks", "reaction_ticks", "reported_ticks", "zero_torque_ticks")  # whole numbers, or None
COLUMNS = 2  # panels side by side: there are many faults
HIGHEST_PERCENT = 100.0
DARK_PERCENT = 55.0  # from here on letters are white
FULL_SIZE = 3  # letters that fit into a cell
Cells = Sequence[dict[str, Any]]


def study(
    trials: Trials,
    *,
    seeds: Annotated[int, Option("cells of each pair", low=1, high=1000)] = 1,
    fault: Annotated[tuple[str, ...], Option("that a failure must lead to", metavar="NAME", choices=FAULTS)] = FAULTS,
    phase: Annotated[tuple[str, ...], Option("of operation", metavar="NAME", choices=PHASES)] = PHASES,
    drive: Annotated[str, Option("type of the robot's drives", metavar="TYPE", choices=tuple(DRIVES))] = DEFAULT,
) -> Result:
    """Every fault in every phase, with the bounds of its reaction."""
    phases, own = tuple(dict.fromkeys(phase)), differences(drive)
    modes = [mode for mode in BY_NAME.values() if mode.fault in fault and set(mode.phases) & set(phases)]
    rows = [
        {"mode_name": mode.name, "phase": each, "seed": seed, "drive": drive}
        for seed in range(1, seeds + 1)
        for mode in modes
        if mode.name not in own or own[mode.name].exists
        for each in phases
        if each in mode.phases
    ]
    if not rows:
        raise OptionError("none of these faults can occur in these phases")
    cells = _run(trials, rows)
    different = {mode.name: own[mode.name].text for mode in modes if mode.name in own}
    by_name = {mode.name: [cell for cell in cells if cell["mode_name"] == mode.name] for mode in modes}
    by_mode = [summarise(own_cells) for own_cells in by_name.values() if own_cells]
    settings = {"seeds": seeds, "phases": phases, "drive": drive}
    ok = sum(cell["ok"] for cell in cells)
    failed = [
        f"{cell['mode_name']} in {cell['phase']}, seed {cell['seed']}: {'; '.join(cell['why'])}"
        for cell in cells
        if not cell["ok"]
    ]
    notes = [f"{name} with {drive}: {text}" for name, text in different.items()]
    return Result(
        tables=[_table(by_mode)],
        figures=[Figure("faults", "Each reaction as a fraction of its bound.", partial(draw, cells, by_mode))],
        summary={"cells": cells, "faults": by_mode, "ok": ok, "differences": different, "settings": settings},
        notes=[*notes, *failed, f"{ok} of {len(cells)} cells ok"],
        ending=Ending.DONE if ok == len(cells) else Ending.UNHEALTHY,
    )


def measure(mode_name: str, phase: str, seed: int, drive: str) -> dict[str, Any]:
    """Run one cell and return its measurements."""
    cell = asdict(run_cell(mode_name, phase, seed, drive))
    return {name: value for name, value in cell.items() if name not in ("mode_name", "phase", "seed")}


def _run(trials: Trials, rows: Cells) -> Cells:
    """Run the longest rows first, so that the last ones end together; return the cells in the order of the rows."""
    order = sorted(
        range(len(rows)), key=lambda i: -BY_NAME[rows[i]["mode_name"]].lasts_s - PHASES.index(rows[i]["phase"])
    )
    found = trials.run(measure, [rows[i] for i in order]).set_axis(order).sort_index().drop(columns="drive")
    whole = found.astype(dict.fromkeys(TICKS, "Int64")).astype(object)
    cells: Cells = whole.where(found.notna(), None).to_dict("records")
    return cells


def summarise(cells: Cells) -> dict[str, Any]:
    """Return one failure mode over all of its cells: the slowest reaction, the largest torque and travel.

    The energy is that of the cell that comes closest to its bound.
    """
    first = cells[0]
    closest = max(cells, key=lambda cell: cell["energy_j"] - cell["energy_bound_j"])
    return {
        "mode_name": first["mode_name"],
        "fault": first["fault"],
        "reaction": first["reaction"],
        "cells": len(cells),
        "ok": sum(cell["ok"] for cell in cells),
        "slowest_ticks": _largest(cells, "reaction_ticks"),
        "bound_ticks": first["bound_ticks"],
        "peak_torque_nm": _largest(cells, "peak_torque_nm"),
        "energy_j": closest["energy_j"],
        "energy_bound_j": closest["energy_bound_j"],
        "travel_rad": _largest(cells, "travel_rad"),
    }


def _largest(cells: Cells, name: str) -> Any:
    return max((cell[name] for cell in cells if cell[name] is not None), default=None)


def _table(by_mode: Cells) -> Table:
    rows = [
        {
            "fault": row["mode_name"],
            "reaction": row["reaction"].replace("_", " "),
            "ok": f"{row['ok']}/{row['cells']}",
            "slowest": row["slowest_ticks"],
            "bound": row["bound_ticks"],
            "peak torque": row["peak_torque_nm"],
            "energy": row["energy_j"],
            "energy bound": row["energy_bound_j"],
            "travel": row["travel_rad"],
        }
        for row in by_mode
    ]
    units = {"slowest": "ticks", "bound": "ticks", "peak torque": "N·m", "travel": "rad"}
    units |= {"energy": "J", "energy bound": "J"}
    return Table("faults", "Reactions to each fault", units, DataFrame(rows))


def draw(cells: Cells, by_mode: Cells) -> Drawing:
    """Draw the ticks of the slowest seed, coloured by their fraction of the bound; a red cross is a failed cell.

    Where no reaction is demanded the energy of a motor takes the place of the ticks. The label of a row has the bound,
    or the smallest and the largest one where the energy depends on the phase.
    """
    phases = [phase for phase in PHASES if any(cell["phase"] == phase for cell in cells)]
    columns = min(COLUMNS, len(by_mode))
    per_panel = -(-len(by_mode) // columns)
    figure = Drawing(figsize=(WIDTH_IN, 1.6 + 0.22 * per_panel))
    panels = figure.subplots(1, columns, squeeze=False)[0]
    for i, panel in enumerate(panels):
        mesh = _draw_panel(panel, cells, by_mode[i * per_panel : (i + 1) * per_panel], phases)
    bar = figure.colorbar(mesh, ax=list(panels), location="bottom", pad=0.01, shrink=0.6, aspect=40, extend="max")
    bar.set_label("% of the bound: slowest reaction in ticks of 2.63 ms; where none is demanded, energy in J")
    ok = sum(cell["ok"] for cell in cells)
    title = f"From the injection to the reaction: {ok} of {len(cells)} cells within every bound"
    figure.suptitle(title, fontsize="medium")
    return figure


def _draw_panel(panel: Axes, cells: Cells, rows: Cells, phases: Sequence[str]) -> Any:
    percent = np.full((len(rows), len(phases)), np.nan)
    by_name = {row["mode_name"]: [cell for cell in cells if cell["mode_name"] == row["mode_name"]] for row in rows}
    for y, of_mode in enumerate(by_name.values()):
        for x, phase in enumerate(phases):
            if own := [cell for cell in of_mode if cell["phase"] == phase]:
                percent[y, x] = _write_cell(panel, x, y, own)
    mesh = panel.pcolormesh(
        np.ma.masked_invalid(percent), cmap="YlGnBu", vmin=0.0, vmax=HIGHEST_PERCENT, edgecolors="white", linewidth=1.0
    )
    panel.set_facecolor("#f4f4f4")
    panel.invert_yaxis()
    panel.set_xticks(np.arange(len(phases)) + 0.5, list(phases), rotation=60, ha="left", fontsize="small")
    panel.xaxis.tick_top()
    panel.set_yticks(np.arange(len(rows)) + 0.5, [_label(*each) for each in by_name.items()], fontsize="x-small")
    panel.grid(visible=False)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    return mesh


def _label(mode_name: str, cells: Cells) -> str:
    bounds_j = sorted(cell["energy_bound_j"] for cell in cells)
    energies = " to ".join(dict.fromkeys(f"{bound_j:.1f}" for bound_j in (bounds_j[0], bounds_j[-1])))
    return f"{mode_name}  ≤ {cells[0]['bound_ticks'] or f'{energies} J'}"


def _write_cell(panel: Axes, x: int, y: int, cells: Cells) -> float:
    """Write the slowest reaction in ticks, or the largest energy. Return it in percent of the bound."""
    percent: float
    if bound := cells[0]["bound_ticks"]:
        ticks = max(cell["reaction_ticks"] or 0 for cell in cells)
        text, percent = str(ticks), 100.0 * ticks / bound
    else:
        largest = max(cells, key=lambda cell: cell["energy_j"] - cell["energy_bound_j"])
        text, percent = f"{largest['energy_j']:.1f}", 100.0 * largest["energy_j"] / max(largest["energy_bound_j"], 1e-9)
    colour = "white" if percent > DARK_PERCENT else INK
    size = 6.5 if len(text) <= FULL_SIZE else 5.0
    panel.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=size, color=colour)
    if not all(cell["ok"] for cell in cells):
        panel.plot(x + 0.5, y + 0.5, "x", color=TRAIL, markersize=11, markeredgewidth=2.0)
    return percent
