"""A random operator of a robot: arms, walks, stops, disarms, clears, and makes parts of it fail."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any, NamedTuple

from drivers.fault_injection.failures import Failures

QUESTIONS = ("status", "strides", "map", "check", "hello", "failures")
DEPTHS_M = (0.02, 0.03, 0.04, 0.05)
UNHARMED = "log"  # its failures lose rows on purpose


class Call(NamedTuple):
    method: str
    params: dict[str, Any]


class RandomOperator:
    """Owns the random numbers; the same seed gives the same calls."""

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

    def next_call(self, mode: str, blocked: bool) -> Call:
        """Returns the next call that makes sense in this mode, or a question."""
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
