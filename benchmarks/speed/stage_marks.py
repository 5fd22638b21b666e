"""Measures the stages of a tick: the clock is read whenever a tick enters a stage, which lasts until the next begins.

The loop's own methods are wrapped while the marks are attached, so the loop knows nothing of it. The cost of marking is
measured, to be taken off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter
from typing import Any

from firmware_host.loop import Loop

CALIBRATION_CALLS = 20000
STAGES = (  # in their order
    "read",  # drain the buses, decode
    "pose",  # simulated here
    "estimate",  # both flippers
    "adapt",  # no stride closes
    "mode",  # examine, request, next mode
    "controller",  # gait, inverse kinematics, PD
    "limits",
    "command",  # encode and send four torques
    "record",  # row packing and the pipe
)


class StageMarks:
    """Owns the times of the current tick's stages."""

    def __init__(self, loop: Loop) -> None:
        self.moments_s: list[float] = []
        self._entries: tuple[tuple[Any, str], ...] = (
            (loop.drives, "read"),
            (loop.pose, "read"),
            (loop.learning, "update"),
            (loop, "_adapt_gait"),
            (loop, "_examine"),
            (loop.controller, "step"),
            (loop, "_limit"),
            (loop, "_command"),
            (loop, "_record"),
        )

    @contextmanager
    def attached(self) -> Iterator[None]:
        for owner, name in self._entries:
            setattr(owner, name, self.marked(getattr(owner, name)))
        yield
        for owner, name in self._entries:
            delattr(owner, name)

    def marked(self, method: Callable[..., Any]) -> Callable[..., Any]:
        mark = self.moments_s.append

        def marked_method(*arguments: Any) -> Any:
            mark(perf_counter())
            return method(*arguments)

        return marked_method


def marking_cost_s(marks: StageMarks) -> float:
    """Returns the time that one mark adds to the stage that it begins and to the one that it ends."""

    def nothing(argument: object) -> None:
        return None

    plain_s, marked_s = _call_s(nothing), _call_s(marks.marked(nothing))
    marks.moments_s.clear()
    return max(0.0, marked_s - plain_s)


def _call_s(method: Callable[[object], None]) -> float:
    rounds = []
    for _ in range(5):
        start_s = perf_counter()
        for _ in range(CALIBRATION_CALLS // 5):
            method(None)
        rounds.append((perf_counter() - start_s) * 5 / CALIBRATION_CALLS)
    return median(rounds)
