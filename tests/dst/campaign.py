"""Runs many seeds of the deterministic simulation and reports which of them break a promise.

    make dst SEEDS=200                     the seeds 0 to 199
    make dst SEEDS=5000:25000              from 5000 up to 24999
    make dst SEEDS=17 ARGS=--only          the seed 17 alone, with its schedule
    make dst SEEDS=1000 ARGS="--style slow"    only schedules in which something drifts for up to a minute

Each broken promise is shrunk to a short schedule, which is printed as text and as Python for the regression list.
With `--progress FILE` finished blocks of seeds are recorded there, and another call continues after them; Ctrl-C and
`--for-s` end a campaign after the running blocks.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.dst.drawing import SHARED, Style, draw_scenario
from tests.dst.run import Outcome, run_scenario
from tests.dst.scenario import Scenario, describe
from tests.dst.shrinking import shrink

WORKERS = 2
SHOWN_S, SELDOM_S = 1.0, 30.0  # between two lines of progress, on a terminal and in a file


@dataclass
class Campaign:
    """The results of a campaign so far."""

    first: int
    last: int  # not included
    seeds: int = 0
    ticks: int = 0
    broken: list[Outcome] = field(default_factory=list)
    covered: Counter[str] = field(default_factory=Counter)  # seeds in which each kind of event, mode and fault occurred

    def add(self, outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            self.seeds += 1
            self.ticks += outcome.ticks
            self.covered.update(outcome.covered.keys())
            if outcome.problem:
                self.broken.append(outcome)


def run_block(first: int, last: int, style: Style | None = None) -> list[Outcome]:
    """Run consecutive seeds, most of which share their surroundings."""
    return [run_seed(seed, style) for seed in range(first, last)]


def run_seed(seed: int, style: Style | None = None) -> Outcome:
    try:
        return run_scenario(draw_scenario(seed, style))
    except Exception as problem:  # noqa: BLE001 - a harness that fails is a finding too, and the others go on
        return Outcome(seed, f"{type(problem).__name__}: {problem}", "Harness")


def blocks(first: int, last: int) -> Iterator[tuple[int, int]]:
    """Yield spans of seeds with common surroundings."""
    while first < last:
        end = min(last, (first // SHARED + 1) * SHARED)
        yield first, end
        first = end


def shrunk(seed: int, promise: str, style: Style | None = None) -> Scenario:
    """Return a short scenario that breaks the same promise."""
    return shrink(draw_scenario(seed, style), lambda scenario: run_scenario(scenario).promise == promise)


def run_campaign(
    first: int, last: int, workers: int, until_s: float, progress: Path | None, style: Style | None = None
) -> Campaign:
    """Run the seeds in processes of their own until all are done, the time is over, or Ctrl-C."""
    campaign, begun_s = Campaign(first, last), time.monotonic()
    done = _read_progress(progress)
    waiting = iter([block for block in blocks(first, last) if block not in done])
    pending: dict[Future[list[Outcome]], tuple[int, int]] = {}
    shown_s = begun_s
    with ProcessPoolExecutor(workers, initializer=_ignore_interrupts) as pool, _Interrupt() as interrupt:
        while True:
            while len(pending) < workers and not interrupt.came and time.monotonic() < until_s:
                block = next(waiting, None)
                if block is None:
                    break
                pending[pool.submit(run_block, *block, style)] = block
            if not pending:
                break
            finished, _ = wait(pending, SHOWN_S, FIRST_COMPLETED)
            for future in finished:
                campaign.add(future.result())
                _note_progress(progress, pending.pop(future), future.result())
            if time.monotonic() - shown_s > (SHOWN_S if sys.stderr.isatty() else SELDOM_S):
                shown_s = time.monotonic()
                _show(campaign, shown_s - begun_s)
    return campaign


class _Interrupt:
    """Records Ctrl-C and SIGTERM instead of raising, so that running blocks end normally."""

    def __enter__(self) -> _Interrupt:
        self.came = False
        self._before = {number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def _note(self, number: int, frame: object) -> None:
        self.came = True

    def __exit__(self, *problem: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


def _read_progress(path: Path | None) -> set[tuple[int, int]]:
    if path is None or not path.exists():
        return set()
    lines = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    return {(line["first"], line["last"]) for line in lines}


def _note_progress(path: Path | None, block: tuple[int, int], outcomes: Sequence[Outcome]) -> None:
    if path is not None:
        broken = [
            {"seed": each.seed, "promise": each.promise, "problem": each.problem} for each in outcomes if each.problem
        ]
        with path.open("a", encoding="utf-8") as file:
            print(json.dumps({"first": block[0], "last": block[1], "broken": broken}), file=file)


def _show(campaign: Campaign, elapsed_s: float) -> None:
    total = campaign.last - campaign.first
    left_s = elapsed_s * (total - campaign.seeds) / max(1, campaign.seeds)
    text = f"{campaign.seeds} of {total} seeds, {len(campaign.broken)} broken, {left_s / 60.0:.0f} min left"
    end = "\r" if sys.stderr.isatty() else "\n"
    print(f"{text:<60}", end=end, file=sys.stderr, flush=True)


def span_of(text: str) -> tuple[int, int]:
    """Read a count or a span FIRST:LAST, the last one not included. Raises ValueError."""
    first, colon, last = text.partition(":")
    return (int(first), int(last)) if colon else (0, int(first))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="make dst", description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("seeds", help="a count, or FIRST:LAST without the last one")
    parser.add_argument("--style", type=Style, choices=list(Style), help="draw only schedules of this style")
    parser.add_argument("--only", action="store_true", help="run this one seed, and print its schedule")
    parser.add_argument("--workers", type=int, default=WORKERS)
    parser.add_argument("--for-s", type=float, default=float("inf"), help="begin no seed after this time")
    parser.add_argument("--progress", type=Path, help="file of finished seeds, to go on later")
    parser.add_argument("--json", action="store_true", help="print the result for programs")
    parser.add_argument("--no-shrink", action="store_true", help="print broken seeds as they are")
    options = parser.parse_args(arguments)
    first, last = (int(options.seeds), int(options.seeds) + 1) if options.only else span_of(options.seeds)
    begun_s = time.monotonic()
    campaign = run_campaign(first, last, options.workers, begun_s + options.for_s, options.progress, options.style)
    duration_s = time.monotonic() - begun_s
    if options.json:
        print(json.dumps(report_of(campaign, duration_s)))
    else:
        if options.only:
            print(describe(draw_scenario(first, options.style)))
        print_result(campaign, duration_s, not options.no_shrink, options.style)
    return 1 if campaign.broken else 0


def report_of(campaign: Campaign, duration_s: float) -> dict[str, Any]:
    """Return the result for programs; `covered` counts the seeds in which each kind of event, mode and fault was."""
    broken = [{"seed": each.seed, "promise": each.promise, "problem": each.problem} for each in campaign.broken]
    return {**vars(campaign), "covered": dict(campaign.covered), "broken": broken, "duration_s": duration_s}


def print_result(campaign: Campaign, duration_s: float, shrinks: bool, style: Style | None = None) -> None:
    for outcome in campaign.broken:
        print(f"seed {outcome.seed} breaks {outcome.promise} at {outcome.at_s:.3f} s: {outcome.problem}")
        print(describe(draw_scenario(outcome.seed, style)))
        print(f"  again with: make dst SEEDS={outcome.seed} ARGS='--only{f' --style {style}' if style else ''}'")
        if shrinks and outcome.promise != "Harness":
            scenario = shrunk(outcome.seed, outcome.promise, style)
            print(f"as short as it gets, for tests/dst/regressions.py:\n{describe(scenario)}\n{scenario!r}")
    kinds = Counter(kind.split()[0] for kind in campaign.covered)
    coverage = ", ".join(f"{count} of {kind}" for kind, count in sorted(kinds.items()))
    print(f"{campaign.seeds} seeds in {duration_s:.0f} s, {campaign.ticks} ticks, {len(campaign.broken)} broken")
    print(f"different kinds: {coverage}")


if __name__ == "__main__":
    sys.exit(main())
