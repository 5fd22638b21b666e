"""The failures that an operator injects: which component fails, how, and until when.

A stop that has never been exercised cannot be trusted, so an operator can make parts of the robot fail: in simulation,
and on hardware where the configuration allows it. The table of failures (failure_table.py) lists them; a component that
cannot fail in the requested way is refused with a message. Every failure ends by itself. Nothing here touches a wire:
the `failing_*` classes ask `Failures` what fails and change what passes through them. Time is that of the last
`update`, and random draws come from a seed, so a failure in lockstep is reproducible to the last bit.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, nan
from random import Random
from typing import Annotated, NamedTuple

from control.bounds import Meaning
from control.records import JOINTS, NEVER_S
from drivers.fault_injection.failure_table import EFFECTS, FailureKind

USUAL_S = 2.0
SHORTEST_S, LONGEST_S = 0.01, 60.0
LEAST_DELAY_S, MOST_DELAY_S = 0.005, 0.02  # of slow messages: two to eight ticks
LOST_FRACTION = 0.5  # of intermittent messages
NO_NUMBERS = (nan, inf, -inf, 3e38, -3e38)  # the last two still fit into the four bytes of a message


@dataclass(frozen=True)
class FailureParameters:
    allowed: Annotated[bool, Meaning("whether `mudskipper fail` may make parts of this robot fail")] = False


class Failure(NamedTuple):
    component: str
    kind: FailureKind
    until_s: float


def begin_text(component: str, kind: str, for_s: float, who: str) -> str:
    return f"failing on purpose: {component} {kind} for {for_s:g} s, asked by {who}"


def end_text(failure: Failure) -> str:
    return f"end of failing on purpose: {failure.component} {failure.kind}"


class Failures:
    """Owns the active failures by component. A healthy tick only checks that `failing` is empty."""

    def __init__(self, buses: Iterable[str], seed: int = 1, joints: Sequence[str] = JOINTS) -> None:
        self.families = _families(buses, joints)  # of every component
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self.failing: dict[str, Failure] = {}
        self.random = Random(self._seed)
        self.now_s = NEVER_S

    def begin(self, component: str, kind: str, now_s: float, for_s: float = USUAL_S) -> str | None:
        """Begin a failure in place of any other of this component. Returns why it is refused, or None."""
        refused = self.refusal(component, kind, for_s)
        if refused is None:
            self.failing[component] = Failure(component, FailureKind(kind), now_s + for_s)
        return refused

    def refusal(self, component: str, kind: str, for_s: float = USUAL_S) -> str | None:
        if component not in self.families:
            return f"there is no component {component!r}; 'mudskipper fail --list' lists those that can fail"
        effects = EFFECTS[self.families[component]]
        if kind not in set(effects):
            return f"{component} cannot be {kind!r}; it can be {', '.join(effects)}"
        if not SHORTEST_S <= for_s <= LONGEST_S:
            return f"{for_s:g} s: must be from {SHORTEST_S:g} to {LONGEST_S:g} s"
        return None

    def update(self, now_s: float) -> list[Failure]:
        """Advance the time, first in every tick. Returns the failures that have just ended by themselves."""
        self.now_s = now_s
        if not self.failing:
            return []
        return [self.failing.pop(each.component) for each in self.active if each.until_s <= now_s]

    def end(self, component: str) -> Failure | None:
        return self.failing.pop(component, None)

    def end_all(self) -> list[Failure]:
        ended = list(self.active)
        self.failing.clear()
        return ended

    @property
    def active(self) -> tuple[Failure, ...]:
        return tuple(self.failing.values())

    def of(self, component: str) -> Failure | None:
        return self.failing.get(component)

    def table(self) -> Iterator[tuple[str, FailureKind, str]]:
        """Yield every component, each kind of failure that it can have, and the effect."""
        for component, family in self.families.items():
            for kind, effect in EFFECTS[family].items():
                yield component, kind, effect

    def loses(self) -> bool:
        """Draw whether an intermittent message is lost."""
        return self.random.random() < LOST_FRACTION

    def arrival_s(self) -> float:
        """Draw when a slow message that leaves now arrives."""
        return self.now_s + self.random.uniform(LEAST_DELAY_S, MOST_DELAY_S)


def _families(buses: Iterable[str], joints: Sequence[str]) -> dict[str, str]:
    named = {"JOINT": joints, "NAME": tuple(buses)}
    families: dict[str, str] = {}
    for family in EFFECTS:
        placeholder = next((each for each in named if each in family), "")
        for name in named.get(placeholder, ("",)):
            families[family.replace(placeholder, name) if placeholder else family] = family
    return families
