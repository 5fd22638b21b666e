"""The loop of every fuzz driver: one malformed input after the other, the problems of each, time and memory."""

import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from verification.benchmark import Report, show_progress
from verification.stress.resources import peak_kib, resident_kib

READINGS = 10  # of resident memory
SHOWN_BUGS = 20
LONGEST_TEXT = 300

TryInput = Callable[[int], tuple[str, Sequence[str]]]  # from its number to its outcome and its problems


@dataclass
class Findings:
    """What all inputs did. A bug is an exception, or a problem that an input showed."""

    outcomes: Counter[str] = field(default_factory=Counter)
    bugs: list[str] = field(default_factory=list)
    slowest_s: float = 0.0  # of the thread, so other programs do not count
    slowest: str = ""  # outcome
    most_kib: float = 0.0  # by which one input raised the largest memory of the process
    readings_kib: list[float] = field(default_factory=list)

    @property
    def growth_kib(self) -> float:
        """Return by how much memory grew in the second half: in the first, bounded lists fill."""
        return self.readings_kib[-1] - self.readings_kib[len(self.readings_kib) // 2]

    def report(self) -> Report:
        return {
            "outcomes": dict(self.outcomes),
            "bugs": len(self.bugs),
            "first_bugs": [bug[:LONGEST_TEXT] for bug in self.bugs[:SHOWN_BUGS]],
            "slowest_ms": round(1e3 * self.slowest_s, 1),
            "slowest": self.slowest,
            "most_kib": self.most_kib,
            "growth_kib": round(self.growth_kib, 1),
        }


def fuzz(count: int, what: str, try_input: TryInput) -> Findings:
    """Try inputs 0 to `count` - 1. An exception of one is its bug, and the next one follows."""
    found = Findings()
    for number in range(count):
        before_kib, begin_s = peak_kib(), time.thread_time()
        try:
            outcome, problems = try_input(number)
        except Exception as problem:  # noqa: BLE001 - that none comes is what is measured
            place = traceback.extract_tb(problem.__traceback__)[-1]
            outcome = "exception"
            problems = [f"{type(problem).__name__}: {problem} ({Path(place.filename).name}, line {place.lineno})"]
        duration_s = time.thread_time() - begin_s
        found.outcomes[outcome] += 1
        found.bugs += [f"{number}, {outcome}: {problem}" for problem in problems]
        found.most_kib = max(found.most_kib, peak_kib() - before_kib)
        if duration_s > found.slowest_s:
            found.slowest_s, found.slowest = duration_s, outcome
        if number + 1 >= count * (len(found.readings_kib) + 1) / READINGS:
            found.readings_kib.append(resident_kib())
        show_progress(number, count, what)
    return found
