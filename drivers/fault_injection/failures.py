"""What is made to fail on purpose, how, and until when.

A stop that was never seen to work cannot be trusted, so parts of the robot can be told to fail: in simulation, and on
hardware where the configuration allows it. Components and kinds follow PX4's `failure` command; what makes no sense
together is refused with a sentence. Every failure ends by itself. Nothing here touches a wire: the `failing_*` parts
ask this owner what fails and act on what passes through them. Time is that of the last `update`, and chance comes
from a seed, so in lockstep the same failure is the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import inf, nan
from random import Random
from typing import Annotated, NamedTuple

from control.bounds import Meaning
from control.records import JOINTS, NEVER_S

USUAL_S = 2.0
SHORTEST_S, LONGEST_S = 0.01, 60.0
LEAST_DELAY_S, MOST_DELAY_S = 0.005, 0.02  # of slow messages: two to eight ticks
LOST_FRACTION = 0.5  # of intermittent messages
NO_NUMBERS = (nan, inf, -inf, 3e38, -3e38)  # the last two still fit into the four bytes of a message


@dataclass(frozen=True)
class FailureParameters:
    allowed: Annotated[bool, Meaning("whether `mudskipper fail` may make parts of this robot fail")] = False


class FailureKind(StrEnum):
    OFF = "off"
    STUCK = "stuck"
    GARBAGE = "garbage"
    SLOW = "slow"
    INTERMITTENT = "intermittent"
    WARNING = "warning"
    PASSIVE = "passive"
    BUS_OFF = "bus-off"


Kind = FailureKind
Effects = Mapping[FailureKind, str]


def _signal(name: str) -> Effects:
    return {
        Kind.OFF: f"its {name} does not come",
        Kind.STUCK: f"its {name} stands still while messages keep coming",
        Kind.GARBAGE: f"its {name} is random, no number, huge, or of a wrong length",
        Kind.SLOW: f"its {name} comes 5 to 20 ms late",
        Kind.INTERMITTENT: f"half of the messages of its {name} are lost, at random",
    }


EFFECTS: Mapping[str, Effects] = {  # JOINT and NAME stand for each joint and each bus
    "JOINT": {
        Kind.OFF: "nothing comes from the drive and nothing reaches it, as if it were unplugged",
        Kind.STUCK: "all that it tells stands still; commands reach it",
        Kind.GARBAGE: "all that it tells is random, no number, huge, or of a wrong length; commands reach it",
        Kind.SLOW: "all messages from and to it are 5 to 20 ms late",
        Kind.INTERMITTENT: "half of the messages from and to it are lost, at random",
    },
    "JOINT.position": _signal("position"),
    "JOINT.current": _signal("current"),
    "JOINT.heartbeat": _signal("heartbeat"),
    "JOINT.temperature": _signal("temperature"),
    "JOINT.voltage": _signal("bus voltage"),
    "JOINT.error": {
        Kind.OFF: "it tells that it left closed loop, without an error",
        Kind.STUCK: "it tells of a gate driver fault and that it left closed loop",
        Kind.GARBAGE: "it tells of random errors",
        Kind.INTERMITTENT: "half of the time it tells of a gate driver fault and that it left closed loop",
    },
    "JOINT.command": {
        Kind.OFF: "nothing that is sent reaches it",
        Kind.SLOW: "what is sent reaches it 5 to 20 ms late",
        Kind.INTERMITTENT: "half of the frames that are sent to it are lost, at random",
    },
    "bus.NAME": {
        Kind.OFF: "the interface is gone: nothing comes, sending fails",
        Kind.STUCK: "the transmit queue is full: sending fails",
        Kind.GARBAGE: "half of what comes is garbled, with random frames between",
        Kind.SLOW: "all frames are 5 to 20 ms late",
        Kind.INTERMITTENT: "half of the frames are lost, at random",
        Kind.WARNING: "error frames come, and the controller warns",
        Kind.PASSIVE: "error frames come, and the controller is error-passive",
        Kind.BUS_OFF: "the controller took itself off the bus: error frames, nothing else comes, sending fails",
    },
    "pose": {
        Kind.OFF: "no pose comes",
        Kind.STUCK: "the body seems to stand",
        Kind.GARBAGE: "the place is random, no number or huge",
        Kind.SLOW: "the place is that of 0.2 s ago",
        Kind.INTERMITTENT: "half of the time no pose comes, at random",
    },
    "log": {
        Kind.OFF: "the log's writer looks dead and takes no row",
        Kind.STUCK: "the log takes no row",
        Kind.INTERMITTENT: "half of the rows are refused, at random",
    },
    "loop": {
        Kind.STUCK: "the loop stands still for 30 ms, once",
        Kind.SLOW: "every tick takes 4 ms longer",
    },
    "clock": {
        Kind.STUCK: "the clock on the wall stands still",
        Kind.GARBAGE: "the clock on the wall is an hour ahead, and steps back in the end",
    },
}


class Failure(NamedTuple):
    component: str
    kind: FailureKind
    until_s: float


def begin_text(component: str, kind: str, for_s: float, who: str) -> str:
    return f"failing on purpose: {component} {kind} for {for_s:g} s, asked by {who}"


def end_text(failure: Failure) -> str:
    return f"end of failing on purpose: {failure.component} {failure.kind}"


class Failures:
    """Owns what fails. `failing` is empty where nothing does, which is all that a healthy tick looks at."""

    def __init__(self, buses: Iterable[str], seed: int = 1) -> None:
        self.families = _families(buses)  # of every component
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self.failing: dict[str, Failure] = {}
        self.random = Random(self._seed)
        self.now_s = NEVER_S

    def begin(self, component: str, kind: str, now_s: float, for_s: float = USUAL_S) -> str | None:
        """Instead of what fails there already. Returns why it is refused, or None."""
        refused = self.refusal(component, kind, for_s)
        if refused is None:
            self.failing[component] = Failure(component, FailureKind(kind), now_s + for_s)
        return refused

    def refusal(self, component: str, kind: str, for_s: float = USUAL_S) -> str | None:
        if component not in self.families:
            return f"there is no {component!r} that could fail; 'mudskipper fail --list' shows what can"
        effects = EFFECTS[self.families[component]]
        if kind not in set(effects):
            return f"{component} cannot be {kind!r}; it can be {', '.join(effects)}"
        if not SHORTEST_S <= for_s <= LONGEST_S:
            return f"{for_s:g} s: must be from {SHORTEST_S:g} to {LONGEST_S:g} s"
        return None

    def update(self, now_s: float) -> list[Failure]:
        """Once a tick, before anything else of it. Those that have just ended by themselves."""
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
        """Every component, each way in which it can fail, and what that does."""
        for component, family in self.families.items():
            for kind, does in EFFECTS[family].items():
                yield component, kind, does

    def loses(self) -> bool:
        """Whether chance takes one intermittent message."""
        return self.random.random() < LOST_FRACTION

    def arrival_s(self) -> float:
        """When a slow message that left now is there."""
        return self.now_s + self.random.uniform(LEAST_DELAY_S, MOST_DELAY_S)


def _families(buses: Iterable[str]) -> dict[str, str]:
    named = {"JOINT": JOINTS, "NAME": tuple(buses)}
    families: dict[str, str] = {}
    for family in EFFECTS:
        place = next((place for place in named if place in family), None)
        for name in named[place] if place else ("",):
            families[family.replace(place, name) if place else family] = family
    return families
