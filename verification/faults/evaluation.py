"""The record of one cell of the fault matrix, and the problems in it."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

from control.controller import DAMPING_NM, DAMPING_S, SOFT_STOP_S
from control.faults import Blocks, FaultKind, Reaction
from drivers.fault_injection.failure_table import CONSEQUENCES, FailureMode
from experiments.reports.counted_nouns import counted

LONGEST_STOP_S = max(SOFT_STOP_S, DAMPING_S) + 0.2
GOING_ON = ("arming", "hold", "walking", "stopping")


@dataclass
class Cell:
    """The measurements of one cell. Their names are the keys of the report in JSON."""

    fault: str
    mode_name: str
    phase: str
    seed: int
    joint: str
    reaction: str
    bound_ticks: int | None
    reaction_ticks: int | None = None
    reported_ticks: int | None = None
    reported: list[str] = field(default_factory=list)
    mode: str = ""  # of the robot at the end
    peak_torque_nm: float = 0.0  # of any motor since the injection
    damping_torque_nm: float = 0.0  # after the start of damping
    zero_torque_ticks: int | None = None  # from the injection to the last torque; None where there is torque at the end
    energy_j: float = 0.0  # that its motor put into the joint that received most, since the injection
    energy_bound_j: float = 0.0
    pushed_ticks: int = 0  # against an end stop by the motor
    pushed_bound_ticks: int = 0
    travel_rad: float | None = None  # of the joint that moved most, where the walk ends
    stop_s: float | None = None  # from a soft stop or damping to idle drives
    true_too: list[str] = field(default_factory=list)  # other faults of joints that are true in the plant
    rows_lost: int = 0
    disarmed: bool = True  # no torque and no closed loop came back
    exception: str = ""
    ok: bool = False
    why: list[str] = field(default_factory=list)


def problems(cell: Cell, mode: FailureMode) -> Iterator[str]:
    """Describe every deviation from the demanded behaviour."""
    yield from cell.why
    yield from _always_wrong(cell, mode)
    if mode.fault == "none":
        if cell.reported:
            yield f"without a failure it reported {', '.join(cell.reported)}"
        return
    if not mode.demands_reaction:
        return
    yield from _late(cell)
    expected = {*mode.names, *mode.also, *chain.from_iterable(CONSEQUENCES.get(name, ()) for name in mode.names)}
    others = set(cell.reported) - expected.union(cell.true_too)
    if others:
        yield f"it also reported {', '.join(sorted(others))}"
    if mode.fault_kind is None or mode.fault_kind.reaction >= Reaction.SOFT_STOP:
        yield from _not_stopped(cell)
    elif mode.fault_kind.reaction <= Reaction.WARN and cell.phase != "idle" and not _goes_on(cell, mode.fault_kind):
        yield f"a warning ended in mode {cell.mode}"
    if mode.fault_kind and not set(mode.names) & set(cell.reported):
        yield "the log has no event of the fault"


def _always_wrong(cell: Cell, mode: FailureMode) -> Iterator[str]:
    """Describe deviations that are wrong with every fault."""
    if mode.raises and not cell.exception:
        yield "the injected bug did not occur"
    if cell.exception and not mode.raises:
        yield f"an exception escaped: {cell.exception}"
    if not cell.disarmed:
        yield "torque or closed loop came back by itself"
    if cell.rows_lost > (1 if mode.raises else 0) and not mode.loses_rows:
        yield f"{counted(cell.rows_lost, 'row')} missing in the log"
    yield from _out_of_bounds(cell)
    if cell.damping_torque_nm > DAMPING_NM + 1e-6:
        yield f"{cell.damping_torque_nm:.3f} N·m while damping, {DAMPING_NM} are the most"


def _out_of_bounds(cell: Cell) -> Iterator[str]:
    if cell.energy_j > cell.energy_bound_j:
        yield f"a motor put {cell.energy_j:.2f} J into its joint, {cell.energy_bound_j:.2f} J are the most"
    if cell.pushed_ticks > cell.pushed_bound_ticks:
        pushed = counted(cell.pushed_ticks, "tick")
        yield f"a motor pushed its joint against the end stop for {pushed}, {cell.pushed_bound_ticks} are the most"


def _late(cell: Cell) -> Iterator[str]:
    bound = cell.bound_ticks or 0
    if cell.reaction_ticks is None:
        yield "no reaction"
    elif cell.reaction_ticks > bound:
        yield f"the reaction came after {counted(cell.reaction_ticks, 'tick')}, {bound} are the most"
    if cell.reported_ticks is not None and cell.reported_ticks > bound:
        yield f"reported after {counted(cell.reported_ticks, 'tick')}, {bound} are the most"


def _not_stopped(cell: Cell) -> Iterator[str]:
    if cell.zero_torque_ticks is None:
        yield "torque at the end"
    if cell.mode not in ("idle", "fault", "boot") and cell.fault not in ("daemon_killed", "bug_in_the_tick"):
        yield f"at the end it is in mode {cell.mode}"
    if cell.stop_s is not None and cell.stop_s > LONGEST_STOP_S:
        yield f"{cell.stop_s:.1f} s from the stop to idle drives"


def _goes_on(cell: Cell, kind: FaultKind) -> bool:
    """Return whether the robot continues, or was refused arming by a fault in the tick of the request."""
    refused = cell.phase == "arming" and cell.mode == "idle" and kind.blocks is not Blocks.NO
    return cell.mode in GOING_ON or refused
