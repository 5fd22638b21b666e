"""Every fault in every phase: how soon the robot reacts, with what torque and travel, and what it does afterwards.

A cell of the matrix is one failure mode, injected at one tick of one phase into a robot of its own; cell.py evaluates
it. The seed draws the mud, the joint, and the tick within the phase. The fields of the report are the keys of the
summary in JSON.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from drivers.drive_types import DEFAULT
from drivers.fault_injection.failure_table import BY_NAME, PHASES, FailureMode
from experiments.study.workers import Workers, run_parallel
from experiments.trials.session import Show
from simulation.harness.drive_presets import DRIVES
from verification.faults.cell import run_cell
from verification.faults.evaluation import Cell
from verification.faults.protocol_differences import differences

FAULTS = tuple(dict.fromkeys(mode.fault for mode in BY_NAME.values()))


class CellKey(NamedTuple):
    """The arguments of one cell."""

    mode_name: str
    phase: str
    seed: int
    drive: str = DEFAULT


@dataclass(frozen=True)
class Plan:
    faults: tuple[str, ...] = FAULTS
    phases: tuple[str, ...] = PHASES
    seeds: int = 1
    drive: str = DEFAULT  # of the robot, as in `with_drive_type`

    def __post_init__(self) -> None:
        """Raises ValueError for an unknown fault, phase or type of drive."""
        given = (("fault", self.faults, FAULTS), ("phase", self.phases, PHASES), ("drive", (self.drive,), DRIVES))
        for what, names, known in given:
            for name in names:
                if name not in known:
                    raise ValueError(f"{what} {name!r}: must be one of {', '.join(known)}")

    @property
    def modes(self) -> list[FailureMode]:
        return [mode for mode in BY_NAME.values() if mode.fault in self.faults and set(mode.phases) & set(self.phases)]

    @property
    def cells(self) -> list[CellKey]:
        table = differences(self.drive)
        return [
            CellKey(mode.name, phase, seed, self.drive)
            for seed in range(1, self.seeds + 1)
            for mode in self.modes
            if mode.name not in table or table[mode.name].exists
            for phase in self.phases
            if phase in mode.phases
        ]

    @property
    def differences(self) -> dict[str, str]:
        """What differs with this type of drive, by failure mode."""
        table = differences(self.drive)
        return {mode.name: table[mode.name].text for mode in self.modes if mode.name in table}


@dataclass(frozen=True)
class ModeSummary:
    """One failure mode over all of its cells: the slowest reaction, the largest torque, energy and travel.

    The energy is that of the cell that comes closest to its bound.
    """

    mode_name: str = field(metadata={"key": "way"})
    fault: str
    reaction: str
    cells: int
    ok: int
    slowest_ticks: int | None
    bound_ticks: int | None
    peak_torque_nm: float
    energy_j: float
    energy_bound_j: float
    travel_rad: float | None


@dataclass(frozen=True)
class Settings:
    seeds: int
    phases: Sequence[str]
    drive: str


@dataclass(frozen=True, kw_only=True)
class FaultsReport:
    experiment: str = "faults"
    cells: Sequence[Cell]
    faults: Sequence[ModeSummary]
    ok: int
    differences: Mapping[str, str]  # of this type of drive from the table of failure modes, with the reasons
    settings: Settings


def run(plan: Plan, show: Show, workers: Workers | None = None) -> FaultsReport:
    """Run all cells. The longest begin first, so that the last ones end together."""
    keys = sorted(plan.cells, key=lambda key: -BY_NAME[key.mode_name].lasts_s - PHASES.index(key.phase))
    cells = dict(zip(keys, run_parallel([partial(run_cell, *key) for key in keys], show, workers), strict=True))
    return report_of(plan, [cells[key] for key in plan.cells])


def report_of(plan: Plan, cells: Sequence[Cell]) -> FaultsReport:
    by_mode = {name: [cell for cell in cells if cell.mode_name == name] for name in BY_NAME}
    return FaultsReport(
        cells=cells,
        faults=[_summary(own) for own in by_mode.values() if own],
        ok=sum(cell.ok for cell in cells),
        differences=plan.differences,
        settings=Settings(plan.seeds, plan.phases, plan.drive),
    )


def _summary(cells: Sequence[Cell]) -> ModeSummary:
    first = cells[0]
    closest = max(cells, key=lambda cell: cell.energy_j - cell.energy_bound_j)
    return ModeSummary(
        mode_name=first.mode_name,
        fault=first.fault,
        reaction=first.reaction,
        cells=len(cells),
        ok=sum(cell.ok for cell in cells),
        slowest_ticks=max((cell.reaction_ticks for cell in cells if cell.reaction_ticks is not None), default=None),
        bound_ticks=first.bound_ticks,
        peak_torque_nm=max(cell.peak_torque_nm for cell in cells),
        energy_j=closest.energy_j,
        energy_bound_j=closest.energy_bound_j,
        travel_rad=max((cell.travel_rad for cell in cells if cell.travel_rad is not None), default=None),
    )
