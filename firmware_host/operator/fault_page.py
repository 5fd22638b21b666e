"""Writes docs/faults.md from the tables that the robot obeys.

`python -m firmware_host.operator.fault_page > docs/faults.md`

The diagram is Mermaid's, one arrow for each pair of modes, the causes in the table's order.
"""

from __future__ import annotations

from collections.abc import Iterator

from control.faults import Blocks, Clears, FaultKind, Reaction
from control.modes import TRANSITIONS, Mode
from firmware_host.operator.fault_texts import FAULT_TEXTS

REACTIONS = {
    Reaction.NONE: "nothing; it only stands against arming",
    Reaction.WARN: "told in `status`, `check` and the log",
    Reaction.HOLD: "a walk ends where it is, the measured pose is held; walking is refused until it is over",
    Reaction.SOFT_STOP: "flippers are raised, for at most 3 s, then the drives go idle",
    Reaction.DAMPING: "no stiffness, only damping of at most 0.4 N·m, until the joints rest or 3 s are over; then idle",
    Reaction.DRIVES_IDLE: "zero torque and idle drives in the same tick",
}
BLOCKS = {Blocks.NO: "", Blocks.UNLESS_FORCED: "unless forced", Blocks.ALWAYS: "yes"}
ENDS = {
    Clears.WHEN_GONE: "when gone",
    Clears.BY_HAND: "`clear`",
    Clears.BY_RESTART: "restart",
}
HEAD = """\
# Faults and modes

Written from `control/faults.py`, `control/modes.py` and `firmware_host/operator/fault_texts.py` by
`python -m firmware_host.operator.fault_page`; a test compares.
"""
RULES = """\
The first cause in each mode counts. Nothing arms by itself: after a fault, a clear or a restart a person arms again.
`stop` and `disarm` are accepted in every mode and from anybody who may use the socket. In ARMING a soft stop and more
lead to FAULT, since there is no torque yet. A software stop is no emergency stop.
"""
LASTING = """\
*Ticks* are the most that pass from the cause to the reaction, at 380 Hz and with the default bounds. *Ends* tells what
ends a fault that met a robot with torque on: a cause that has been gone for 50 ticks, or a person's `clear` once it is
gone. Where torque was off, every fault ends with its cause. *Against arming* faults are the lines that `mudskipper
check` fails; `arm --force` overrules those that are marked so.
"""


def fault_page() -> str:
    return "\n".join([HEAD, *_diagram(), "", RULES, "## Reactions", "", *_reactions(), "", *_faults(), "", LASTING])


def _diagram() -> Iterator[str]:
    yield "```mermaid"
    yield "stateDiagram-v2"
    yield "    [*] --> BOOT"
    for (source, target), causes in _arrows().items():
        yield f"    {source.name} --> {target.name} : {' / '.join(causes)}"
    yield "```"


def _arrows() -> dict[tuple[Mode, Mode], list[str]]:
    arrows: dict[tuple[Mode, Mode], list[str]] = {}
    for row in TRANSITIONS:
        for source in sorted(row.sources):
            if source is not row.target:
                arrows.setdefault((source, row.target), []).append(row.cause.text)
    return arrows


def _reactions() -> Iterator[str]:
    yield "| reaction | what happens |"
    yield "|---|---|"
    for reaction, text in REACTIONS.items():
        yield f"| {_words(reaction)} | {text} |"


def _faults() -> Iterator[str]:
    yield "## Faults"
    yield ""
    yield "| fault | what it means | reaction | ticks | against arming | ends | what to do |"
    yield "|---|---|---|---|---|---|---|"
    for kind in FaultKind:
        yield _row(kind)


def _row(kind: FaultKind) -> str:
    cells = (
        f"`{kind}`",
        FAULT_TEXTS[kind].meaning,
        _words(kind.reaction),
        str(kind.bound_ticks),
        BLOCKS[kind.blocks],
        ENDS[kind.clears],
        FAULT_TEXTS[kind].what_to_do,
    )
    return f"| {' | '.join(cells)} |"


def _words(reaction: Reaction) -> str:
    return reaction.name.lower().replace("_", " ")


if __name__ == "__main__":
    print(fault_page(), end="")
