"""Formats text for a terminal: tables, colours, progress. Piped output has no colours."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from experiments.reports.text_tables import number
from experiments.reports.value_text import coefficient_text

RED, GREEN, YELLOW, BOLD, PLAIN = "\033[31m", "\033[32m", "\033[33m", "\033[1m", "\033[0m"
MARKS = {"ok": ("ok  ", GREEN), "warn": ("warn", YELLOW), "fail": ("FAIL", RED)}  # of a check's line, by its level
QUIET_S = 2.0  # before progress is shown
PACE_S = 1.0  # of work before its end can be foreseen
REFRESH_S = 0.1
BAR_WIDTH = 20  # characters
complaints: list[str] = []  # what this command has complained of: with --json it is the reason why it failed


def drop_output() -> None:
    """Discard what is printed from now on: its reader, such as `head`, has closed standard output."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def coloured(text: str, colour: str) -> str:
    if not sys.stdout.isatty() or "NO_COLOR" in os.environ:
        return text
    return f"{colour}{text}{PLAIN}"


def bar(done: int, total: int) -> str:
    filled = BAR_WIDTH * min(done, total) // max(total, 1)
    return f"[{'#' * filled}{'.' * (BAR_WIDTH - filled)}]"


class Count(NamedTuple):
    """How much was done at a time of the monotonic clock."""

    now_s: float
    done: int


def time_left_text(begun: Count, now: Count, total: int) -> str:
    """Format the time that the rest will take at the pace so far; empty before there is a pace."""
    done, elapsed_s = now.done - begun.done, now.now_s - begun.now_s
    if done <= 0 or elapsed_s < PACE_S or now.done >= total:
        return ""
    left_s = round(elapsed_s * (total - now.done) / done)
    return f", {left_s} s left" if left_s < 120 else f", {left_s // 60} min left"


class Progress:
    """Shows progress and the time left in one line on standard error's terminal, after `quiet_s`; nothing elsewhere."""

    def __init__(self, what: str, quiet_s: float = 0.0) -> None:
        self._what = what
        self._begun: Count | None = None
        self._shown = sys.stderr.isatty()
        self._interval_s = REFRESH_S if quiet_s else 0.0  # rows come faster than a terminal draws
        self._due_s = time.monotonic() + quiet_s

    def follow(self, what: str, done: int, total: int) -> None:
        """Show a part of the work that has its own count."""
        if what != self._what:
            self._what, self._begun = what, None
        self.show(done, total)

    def show(self, done: int, total: int) -> None:
        """The first call is the beginning of the work, also of one that continues what was done before."""
        now_s = time.monotonic()
        self._begun = self._begun or Count(now_s, done)
        if self._shown and now_s >= self._due_s:
            self._due_s = now_s + self._interval_s
            left = time_left_text(self._begun, Count(now_s, done), total)
            text = f"{bar(done, total)} {done} of {total} {self._what}{left}"
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


@contextmanager
def watched() -> Iterator[Callable[[str, int, int], None]]:
    """Yield a function that shows progress: what is done, how much, of how much."""
    progress = Progress("", QUIET_S)
    try:
        yield progress.follow
    finally:
        progress.clear()


def clock_text(age_s: float) -> str:
    """Format the time of day that was `age_s` ago."""
    return time.strftime("%H:%M:%S", time.localtime(time.time() - age_s))


def complain(*messages: str) -> None:
    """Print messages to standard error."""
    complaints.extend(messages)
    for message in messages:
        print(f"mudskipper: {message}", file=sys.stderr)


def coefficient(estimate: dict[str, Any]) -> str:
    """Format an estimate in N/cm³ with its standard error; ≥ marks a lower bound, brackets an invalid one."""
    if estimate["value"] is None or estimate["std_error"] is None:
        return "-"
    text = coefficient_text(estimate["value"], estimate["std_error"], at_least=estimate["at_least"])
    return text if estimate["valid"] else f"({text})"


STRIDE_HEAD = (
    f"{'flipper':7} {'no':>3} {'at':>7} {'insert':>6} {'stance':>6} {'extract':>7} "
    f"{'k_p':>17} {'k_s':>17} {'k_e':>17} {'depth':>6} {'next':>5} {'step':>6}"
)
STRIDE_UNITS = (
    f"{'':7} {'':3} {'(s)':>7} {'(s)':>6} {'(s)':>6} {'(s)':>7} "
    f"{'(N/cm³)':>17} {'(N/cm³)':>17} {'(N/cm³)':>17} {'(cm)':>6} {'(cm)':>5} {'(cm)':>6}"
)


def stride_line(stride: dict[str, Any], start_s: float = 0.0) -> str:
    """Format one stride of one flipper: time, durations of its phases, estimates, depth and step."""
    chosen_m = stride.get("chosen_depth_m")
    return (
        f"{stride['flipper']:7} {stride['index']:3d} {stride['t_end_s'] - start_s:7.2f} "
        f"{stride['insertion_s']:6.2f} {stride['stance_s']:6.2f} {stride['extraction_s']:7.2f} "
        f"{coefficient(stride['k_p']):>17} {coefficient(stride['k_s']):>17} {coefficient(stride['k_e']):>17} "
        f"{number(_in_cm(stride['depth_m']), 1):>6} {number(_in_cm(chosen_m), 2):>5} "
        f"{number(_in_cm(stride['step_m']), 1):>6}{'' if stride['released'] else '  stuck'}"
    )


def other_surface(stride: dict[str, Any]) -> str:
    """Return a note on a stride of a trial that has two surfaces; empty for the others."""
    other_m = stride.get("other_surface_m")
    return "" if other_m is None else f"  other surface {100.0 * other_m:.1f} cm"


def _in_cm(value_m: float | None) -> float | None:
    return None if value_m is None else 100.0 * value_m
