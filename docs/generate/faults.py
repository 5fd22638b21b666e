"""Writes faults, modes and deliberate failures from the tables that the robot obeys."""

from collections.abc import Iterator

from control.faults import Blocks, Clears, FaultKind, Reaction
from control.modes import TRANSITIONS, Mode
from control.rate import PERIOD_S
from docs.generate.markdown import code, table
from drivers.fault_injection.failure_table import EFFECTS
from experiments.robot.lockstep_robot import simulated_configuration
from verification.faults.energy_bounds import STOP_TO_STOP_RAD, STOPPING, EnergyBounds, energy_bounds

REACTIONS = {
    Reaction.NONE: "nothing; the fault only prevents arming",
    Reaction.WARN: "`status`, `check` and the log report it",
    Reaction.HOLD: "a walk ends where it is and the robot holds its pose; it refuses to walk until the fault is over",
    Reaction.SOFT_STOP: "the flippers rise, for at most 3 s, then the drives go idle",
    Reaction.DAMPING: "at most 0.4 N·m of damping and no stiffness, until the joints rest or for 3 s; then idle drives",
    Reaction.DRIVES_IDLE: "zero torque and idle drives in the same tick",
}
BLOCKS = {Blocks.NO: "no", Blocks.UNLESS_FORCED: "unless forced", Blocks.ALWAYS: "yes"}
ENDS = {Clears.WHEN_GONE: "when gone", Clears.BY_HAND: "`clear`", Clears.BY_RESTART: "restart"}


def reactions() -> Iterator[str]:
    yield from table(("reaction", "what happens"), [(_name(reaction), text) for reaction, text in REACTIONS.items()])


def modes() -> Iterator[str]:
    rows = [(mode.name, row.cause.text, row.target.name) for mode in Mode for row in TRANSITIONS if mode in row.sources]
    yield from table(("mode", "cause", "next mode"), rows)


def faults() -> Iterator[str]:
    bounds = energy_bounds(simulated_configuration())
    head = ("fault", "meaning", "reaction", "ticks", "energy (J)", "prevents arming", "ends", "what to do")
    yield from table(head, [_fault_row(kind, bounds) for kind in FaultKind])


def _fault_row(kind: FaultKind, bounds: EnergyBounds) -> tuple[str, ...]:
    return (
        code(kind),
        kind.meaning,
        _name(kind.reaction),
        str(kind.bound_ticks),
        f"{bounds.fault_j(kind):.1f}" if kind.reaction in STOPPING else "",
        BLOCKS[kind.blocks],
        ENDS[kind.clears],
        kind.what_to_do,
    )


def energies() -> Iterator[str]:
    """Yield the terms of the energy bounds with their values for the default configuration."""
    bounds = energy_bounds(simulated_configuration())
    rows = [
        ("τ", "torque limit", f"{bounds.torque_nm:g} N·m"),
        ("ω", "speed above which a joint is too fast: 1.25 times the velocity limit", f"{bounds.speed_rad_s:g} rad/s"),
        ("½ I ω²", "energy of a joint at that speed", f"{bounds.kinetic_j:.2f} J"),
        ("T", "period of the loop", f"{PERIOD_S * 1e3:.2f} ms"),
        ("stop to stop", "path of a joint between its end stops, at most", f"{STOP_TO_STOP_RAD:.2f} rad"),
        ("stride", "path of a joint in one stride, at most", f"{bounds.stride_rad:.2f} rad"),
        ("raise", "path of a soft stop, at most", f"{bounds.raising_rad:.2f} rad"),
    ]
    yield from table(("", "meaning", "value"), rows)


def failures() -> Iterator[str]:
    rows = [(code(part), code(kind), effect) for part, kinds in EFFECTS.items() for kind, effect in kinds.items()]
    yield from table(("component", "kind", "effect"), rows)


def _name(reaction: Reaction) -> str:
    return reaction.name.lower().replace("_", " ")
