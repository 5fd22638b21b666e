"""Runs many seeds of the deterministic simulation and reports which of them break a promise.

    make dst SEEDS=200                     the seeds 0 to 199
    make dst SEEDS=5000:25000              from 5000 up to 24999
    make dst SEEDS=17 ARGS=--only          the seed 17 alone, with its schedule
    make dst SEEDS=1000 ARGS="--style slow"    only schedules in which something drifts for up to a minute

Each broken promise is shrunk to a short schedule, which is printed as text and as Python for the regression list.
Ctrl-C ends a campaign with what it has found.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from functools import partial

from experiments.study.workers import run_locally
from tests.dst.drawing import SHARED, Style, draw_scenario
from tests.dst.run import Outcome, run_scenario
from tests.dst.scenario import describe
from tests.dst.shrinking import shrink

WORKERS = 2


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


def run_campaign(first: int, last: int, workers: int, style: Style | None = None) -> list[Outcome]:
    """Run the seeds in processes of their own, until all are done or Ctrl-C; return the outcomes in their order."""
    begun_s, outcomes = time.monotonic(), list[Outcome]()
    trials = [partial(run_block, *block, style) for block in blocks(first, last)]
    with suppress(KeyboardInterrupt), closing(run_locally(trials, workers)) as ended:
        for _, block in ended:
            outcomes += block
            broken = sum(bool(each.problem) for each in outcomes)
            left_s = (time.monotonic() - begun_s) * (last - first - len(outcomes)) / len(outcomes)
            text = f"{len(outcomes)} of {last - first} seeds, {broken} broken, {left_s / 60.0:.0f} min left"
            print(f"{text:<60}", end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)
    return sorted(outcomes, key=lambda outcome: outcome.seed)


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
    parser.add_argument("--no-shrink", action="store_true", help="print broken seeds as they are")
    options = parser.parse_args(arguments)
    try:
        first, last = (int(options.seeds), int(options.seeds) + 1) if options.only else span_of(options.seeds)
    except ValueError:
        parser.error(f"{options.seeds}: must be a count or FIRST:LAST, with --only one seed")
    begun_s = time.monotonic()
    outcomes = run_campaign(first, last, options.workers, options.style)
    if options.only:
        print(describe(draw_scenario(first, options.style)))
    broken = [outcome for outcome in outcomes if outcome.problem]
    for outcome in broken:
        print_broken(outcome, not options.no_shrink, options.style)
    ticks, duration_s = sum(outcome.ticks for outcome in outcomes), time.monotonic() - begun_s
    kinds = Counter(kind.split()[0] for kind in {each for outcome in outcomes for each in outcome.covered})
    print(f"{len(outcomes)} seeds in {duration_s:.0f} s, {ticks} ticks, {len(broken)} broken")
    print(f"different kinds: {', '.join(f'{count} of {kind}' for kind, count in sorted(kinds.items()))}")
    return 1 if broken else 0


def print_broken(outcome: Outcome, shrinks: bool, style: Style | None = None) -> None:
    scenario = draw_scenario(outcome.seed, style)
    print(f"seed {outcome.seed} breaks {outcome.promise} at {outcome.at_s:.3f} s: {outcome.problem}")
    print(describe(scenario))
    print(f"  again with: make dst SEEDS={outcome.seed} ARGS='--only{f' --style {style}' if style else ''}'")
    if shrinks and outcome.promise != "Harness":
        scenario = shrink(scenario, lambda each: run_scenario(each).promise == outcome.promise)
        print(f"as short as it gets, for tests/dst/regressions.py:\n{describe(scenario)}\n{scenario!r}")


if __name__ == "__main__":
    sys.exit(main())
