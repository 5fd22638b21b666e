"""The energy that the motors put into the joints of one cell since the injection, and the bound that applies to it."""

from collections.abc import Iterable
from dataclasses import replace

from control.faults import FAULT_KINDS, Reaction
from control.modes import Mode
from control.rate import PERIOD_S
from drivers.fault_injection.failure_table import FailureMode
from simulation.harness.joint_energy import JointEnergy
from verification.faults.energy_bounds import (
    DELAY_TICKS,
    SLEWING_TICKS,
    STOPPING,
    WATCHDOG_TICKS,
    detection_ticks,
    energy_bounds,
)
from verification.faults.evaluation import Cell
from verification.faults.failing_robot import FaultBench

REACTING_TICKS = SLEWING_TICKS + DELAY_TICKS


class MotorEnergy:
    """Owns the work of the motors since it was made."""

    def __init__(self, bench: FaultBench, mode: FailureMode) -> None:
        configuration = bench.loop.configuration
        self._failure = mode
        self._bounds = energy_bounds(configuration)
        if mode.torque_nm:
            self._bounds = replace(self._bounds, torque_nm=mode.torque_nm)
        self._loop = bench.loop
        self._walked_s = 0.0
        self._work = JointEnergy(bench.robot, configuration.joint_ranges)

    def step(self) -> None:
        if self._loop.mode in (Mode.WALKING, Mode.STOPPING):
            self._walked_s += PERIOD_S

    def record(self, cell: Cell) -> None:
        """Write the energy since the injection and its bound into the cell."""
        cell.energy_j, cell.energy_bound_j = self._work.energy_j, self._bound_j(cell.reported)
        cell.pushed_ticks, cell.pushed_bound_ticks = round(self._work.pushed_s / PERIOD_S), self._pushing_ticks

    def _bound_j(self, reported: Iterable[str]) -> float:
        mode, bounds = self._failure, self._bounds
        if mode.restarted:
            return bounds.stopping_j(round(mode.lasts_s / PERIOD_S), Reaction.DRIVES_IDLE)
        if mode.ends_loop:
            return bounds.stopping_j(WATCHDOG_TICKS, Reaction.DRIVES_IDLE)
        if mode.fault_kind and mode.fault_kind.reaction in STOPPING and not mode.waived:
            return bounds.fault_j(mode.fault_kind, WATCHDOG_TICKS if mode.loses_commands else 0)
        kinds = (FAULT_KINDS[name] for name in reported)
        stopped_j = [bounds.fault_j(kind) for kind in kinds if kind.reaction in STOPPING]
        return max(bounds.walking_j(self._walked_s), *stopped_j, 0.0)

    @property
    def _pushing_ticks(self) -> int:
        """Return the ticks for which a motor may push against an end stop: until the reaction takes effect."""
        mode = self._failure
        if mode.restarted:
            return round(mode.lasts_s / PERIOD_S) + REACTING_TICKS
        if mode.ends_loop or mode.loses_commands:
            return WATCHDOG_TICKS
        kind = FAULT_KINDS[mode.pushes_until] if mode.pushes_until else mode.fault_kind
        return REACTING_TICKS + (detection_ticks(kind) if kind and kind.reaction in STOPPING else 0)
