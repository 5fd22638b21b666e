"""What a person does with a robot all day, by chance: arms, walks, stops, disarms, clears, and makes it fail."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any, NamedTuple

from drivers.fault_injection.failures import Failures

QUESTIONS = ("status", "strides", "map", "check", "hello", "failures")
DEPTHS_M = (0.02, 0.03, 0.04, 0.05)
UNHARMED = "log"  # what fails there is meant to lose rows


class Call(NamedTuple):
    method: str
    params: dict[str, Any]


class Attendant:
    """Owns the chance; the same seed does the same."""

    def __init__(self, buses: Sequence[str], seed: int) -> None:
        self.chance = Random(seed)
        table = Failures(buses).table()
        self._failures = [(component, str(kind)) for component, kind, _ in table if component != UNHARMED]

    def question(self) -> Call:
        method = self.chance.choice(QUESTIONS)
        return Call(method, {"since": self.chance.randrange(1000)} if method == "strides" else {})

    def failure(self) -> Call:
        component, kind = self.chance.choice(self._failures)
        for_s = round(self.chance.choice((0.02, 0.1, 0.5, 1.0)) * self.chance.uniform(0.5, 1.5), 3)
        return Call("fail", {"component": component, "kind": kind, "for_s": for_s})

    def wish(self, mode: str, blocked: bool) -> Call:
        """What the mode lets a person want next; a question where that is nothing."""
        draw = self.chance.random()
        if mode in ("fault", "damping") or (mode == "idle" and blocked):
            return Call("clear", {})
        if mode == "idle":
            return Call("arm", {})
        if mode == "hold":
            return Call("disarm", {}) if draw < 0.05 else self._walk()
        if mode == "walking" and draw < 0.05:
            return Call("stop" if draw < 0.03 else "disarm", {})
        return self.question()

    def _walk(self) -> Call:
        walk: dict[str, Any] = {"strides": self.chance.choice((0, 0, 0, 1, 5))}
        if self.chance.random() < 0.3:
            walk["depth_m"] = self.chance.choice(DEPTHS_M)
        return Call("walk", walk)
