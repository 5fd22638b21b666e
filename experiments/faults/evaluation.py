"""What was seen in one cell, and what of it should not be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from control.controller import DAMPING_NM, DAMPING_S, SOFT_STOP_S
from control.faults import Blocks, FaultKind, Reaction
from experiments.faults.injection import BRINGS, Way
from firmware_host.operator.counted_nouns import counted

LONGEST_STOP_S = max(SOFT_STOP_S, DAMPING_S) + 0.2
GOING_ON = ("arming", "hold", "walking", "stopping")


@dataclass
class Cell:
    """What was seen, as it goes into the report."""

    fault: str
    way: str
    phase: str
    seed: int
    joint: str
    reaction: str
    bound_ticks: int | None
    reaction_ticks: int | None = None
    reported_ticks: int | None = None
    reported: list[str] = field(default_factory=list)
    mode: str = ""  # in the end
    peak_torque_nm: float = 0.0  # of any motor, from the cause on
    damping_torque_nm: float = 0.0  # once damping has begun
    zero_torque_ticks: int | None = None  # from the cause to the last torque, where there is none in the end
    travel_rad: float | None = None  # of the joint that moved most, where the walk ends
    stop_s: float | None = None  # from a soft stop or damping to idle drives
    true_too: list[str] = field(default_factory=list)  # of what the joints did: thrown or falling, out of bounds
    rows_lost: int = 0
    disarmed: bool = True  # stayed so, once torque was off
    exception: str = ""
    ok: bool = False
    why: list[str] = field(default_factory=list)


def problems(cell: Cell, way: Way) -> Iterator[str]:
    """In words, what should not be."""
    yield from cell.why
    yield from _never_right(cell, way)
    if way.fault == "none":
        if cell.reported:
            yield f"without a cause it told of {', '.join(cell.reported)}"
        return
    yield from _late(cell)
    others = set(cell.reported) - {cell.fault, *cell.true_too, *BRINGS.get(cell.fault, ())}
    if others:
        yield f"it also told of {', '.join(sorted(others))}"
    if way.kind is None or way.kind.reaction >= Reaction.SOFT_STOP:
        yield from _not_stopped(cell)
    elif way.kind.reaction <= Reaction.WARN and cell.phase != "idle" and not _goes_on(cell, way.kind):
        yield f"a warning ended in mode {cell.mode}"
    if way.kind and cell.fault not in cell.reported:
        yield "the log holds no word of it"


def _never_right(cell: Cell, way: Way) -> Iterator[str]:
    """Whatever the fault."""
    if way.ends_daemon and not cell.exception:
        yield "the bug never came"
    if cell.exception and not way.ends_daemon:
        yield f"an exception escaped: {cell.exception}"
    if not cell.disarmed:
        yield "torque or closed loop came back by itself"
    if cell.rows_lost > (1 if way.ends_daemon else 0):
        yield f"missing in the log: {counted(cell.rows_lost, 'row')}"
    if cell.damping_torque_nm > DAMPING_NM + 1e-6:
        yield f"{cell.damping_torque_nm:.3f} N·m while damping"


def _late(cell: Cell) -> Iterator[str]:
    bound = cell.bound_ticks or 0
    if cell.reaction_ticks is None:
        yield "no reaction"
    elif cell.reaction_ticks > bound:
        yield f"the reaction came after {counted(cell.reaction_ticks, 'tick')}, {bound} are the most"
    if cell.reported_ticks is not None and cell.reported_ticks > bound:
        yield f"told after {counted(cell.reported_ticks, 'tick')}, {bound} are the most"


def _not_stopped(cell: Cell) -> Iterator[str]:
    if cell.zero_torque_ticks is None:
        yield "torque in the end"
    if cell.mode not in ("idle", "fault", "boot") and cell.fault not in ("daemon_killed", "bug_in_the_tick"):
        yield f"in the end it is in mode {cell.mode}"
    if cell.stop_s is not None and cell.stop_s > LONGEST_STOP_S:
        yield f"{cell.stop_s:.1f} s from the stop to idle drives"


def _goes_on(cell: Cell, kind: FaultKind) -> bool:
    """Or was not armed to begin with: what stands against arming may come in the tick of the request."""
    refused = cell.phase == "arming" and cell.mode == "idle" and kind.blocks is not Blocks.NO
    return cell.mode in GOING_ON or refused
