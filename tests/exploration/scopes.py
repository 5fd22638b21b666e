"""The events that the searches allow: several operators, pairs of faults, a drive that does anything, or all at
once.
"""

from collections.abc import Iterator
from itertools import combinations, pairwise

from control.faults import FaultKind, Reaction
from tests.exploration.memory import Call, Operator
from tests.exploration.search import CLEAR, DISARM, Scope

LEASE_S = 2.0  # it survives one tick without renewal
ANNA, BEN = Operator
ORDERS = (
    Call(ANNA, "arm"),
    Call(ANNA, "arm", (("force", "watchdog_unknown"),)),
    Call(ANNA, "walk"),
    Call(ANNA, "move", (("left_sweep_rad", 0.1),)),
    Call(BEN, "stop"),
    DISARM,
    CLEAR,
)
LEASES = (
    Call(ANNA, "arm", (("lease_s", LEASE_S),)),
    Call(ANNA, "walk", (("lease_s", LEASE_S),)),
    Call(ANNA, "lease", (("for_s", LEASE_S),)),
    Call(ANNA, "release"),
    Call(ANNA, "hang_up"),
    Call(BEN, "arm"),
    Call(BEN, "walk"),
    Call(BEN, "walk", (("take_over", True),)),
    Call(BEN, "release"),
    Call(BEN, "end"),
)
EVERYTHING = (*ORDERS, *LEASES)


def _one_of_each() -> tuple[FaultKind, ...]:
    """Return one fault of each combination that modes and latch distinguish."""
    found = {(kind.reaction, kind.blocks, kind.clears, kind.latches_idle): kind for kind in reversed(FaultKind)}
    return tuple(sorted(found.values(), key=lambda kind: kind.reaction))


ONE_OF_EACH = _one_of_each()
ACTING = tuple(kind for kind in ONE_OF_EACH if kind.reaction >= Reaction.HOLD)


def quick_scopes() -> Iterator[Scope]:
    """Yield scopes that take a few seconds in all."""
    yield Scope(EVERYTHING)
    yield Scope(ORDERS, drives=True)
    yield from (Scope(ORDERS, (kind,)) for kind in ONE_OF_EACH if kind not in ACTING)
    yield from (Scope(ORDERS, pair) for pair in pairwise(ACTING))


def all_scopes() -> Iterator[Scope]:
    """Yield every pair of faults with every operator, and every fault with a drive that does anything and every
    operator.
    """
    yield from (Scope(EVERYTHING, pair) for pair in combinations(ONE_OF_EACH, 2))
    yield from (Scope(EVERYTHING, (kind,), drives=True) for kind in ONE_OF_EACH)
