"""Many trials at once, in as many processes as there are processors: a trial is a function without arguments."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import active_children
from typing import TypeVar

from experiments.trials.session import Show

LOOK_S = 0.5
Outcome = TypeVar("Outcome")


def run_parallel(
    trials: Sequence[Callable[[], Outcome]],
    show: Show,
    processes: int | None = None,
    meanwhile: Callable[[], None] = lambda: None,
    keep: Callable[[int, Outcome], None] = lambda place, outcome: None,
) -> list[Outcome]:
    """What each trial returned, in their order. Trials cross a process border: `functools.partial` does, lambda not.

    `meanwhile` is called twice a second, for progress within long trials; `keep` with each outcome as it comes, and its
    trial's place among them.
    """
    outcomes: dict[int, Outcome] = {}
    with _workers(processes or os.cpu_count()) as pool:
        places = {pool.submit(trial): place for place, trial in enumerate(trials)}
        pending = set(places)
        while pending:
            finished, pending = wait(pending, LOOK_S, FIRST_COMPLETED)
            for future in finished:
                outcomes[places[future]] = future.result()
                keep(places[future], future.result())
                show(len(outcomes), len(trials))
            meanwhile()
    return [outcomes[place] for place in range(len(trials))]


@contextmanager
def _workers(count: int | None) -> Iterator[ProcessPoolExecutor]:
    """They end with the work, also where that ends early: after Ctrl-C nobody waits for the trials under way."""
    pool = ProcessPoolExecutor(count, initializer=_ignore_interrupts)
    try:
        yield pool
    except BaseException:
        for worker in active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown()


def _ignore_interrupts() -> None:
    """Ctrl-C reaches every process of a terminal; a worker would take it for the trial's result and begin the next."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
