"""Every fault in every phase: how soon the robot reacts, with what torque and travel, and what it does afterwards.

A cell is one fault, made at one tick of one phase by a robot of its own; cell.py says what is judged. The seed
draws mud, joint, and the moment within the phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from experiments.faults.cell import run_cell
from experiments.faults.injection import BY_NAME, WAYS
from experiments.faults.phases import PHASES
from experiments.trials.parallel_trials import run_parallel
from experiments.trials.session import Show

FAULTS = tuple(dict.fromkeys(way.fault for way in WAYS))


class Place(NamedTuple):
    """Of a cell in the table."""

    way: str
    phase: str
    seed: int


@dataclass(frozen=True)
class Plan:
    faults: tuple[str, ...] = FAULTS
    phases: tuple[str, ...] = PHASES
    seeds: int = 1

    def __post_init__(self) -> None:
        """Raises ValueError for a fault or a phase that there is not."""
        for what, names, known in (("fault", self.faults, FAULTS), ("phase", self.phases, PHASES)):
            for name in names:
                if name not in known:
                    raise ValueError(f"{what} {name!r}: must be one of {', '.join(known)}")

    @property
    def places(self) -> list[Place]:
        return [
            Place(way.name, phase, seed)
            for seed in range(1, self.seeds + 1)
            for way in WAYS
            if way.fault in self.faults
            for phase in self.phases
            if phase in way.phases
        ]


def run(plan: Plan, show: Show, processes: int | None = None) -> dict[str, Any]:
    """The report. The longest cells begin first, so that the last ones end together."""
    places = sorted(plan.places, key=lambda place: -BY_NAME[place.way].lasts_s - PHASES.index(place.phase))
    cells = run_parallel([partial(run_cell, *place) for place in places], show, processes)
    order = {place: i for i, place in enumerate(plan.places)}
    cells = [cell for _, cell in sorted(zip(places, cells, strict=True), key=lambda pair: order[pair[0]])]
    return report_of(plan, cells)


def report_of(plan: Plan, cells: Sequence[dict[str, Any]]) -> dict[str, Any]:
    by_way = {name: [cell for cell in cells if cell["way"] == name] for name in BY_NAME}
    return {
        "experiment": "faults",
        "cells": list(cells),
        "faults": [_summary(name, reported) for name, reported in by_way.items() if reported],
        "ok": sum(cell["ok"] for cell in cells),
        "settings": {"seeds": plan.seeds, "phases": list(plan.phases)},
    }


def _summary(name: str, cells: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Over all cells of one way to a fault."""
    reactions = [cell["reaction_ticks"] for cell in cells if cell["reaction_ticks"] is not None]
    travels = [cell["travel_rad"] for cell in cells if cell["travel_rad"] is not None]
    return {
        "way": name,
        "fault": cells[0]["fault"],
        "reaction": cells[0]["reaction"],
        "cells": len(cells),
        "ok": sum(cell["ok"] for cell in cells),
        "slowest_ticks": max(reactions, default=None),
        "bound_ticks": cells[0]["bound_ticks"],
        "peak_torque_nm": max(cell["peak_torque_nm"] for cell in cells),
        "travel_rad": max(travels, default=None),
    }
