"""Runs many trials in as many processes as there are processors. A trial is a function without arguments."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import active_children
from typing import TypeVar

from experiments.trials.session import Show

POLL_S = 0.5
Result = TypeVar("Result")


def run_parallel(
    trials: Sequence[Callable[[], Result]],
    show: Show,
    processes: int | None = None,
    meanwhile: Callable[[], None] = lambda: None,
    keep: Callable[[int, Result], None] = lambda index, result: None,
) -> list[Result]:
    """Return each trial's result, in their order. Trials cross a process border: `functools.partial` does, lambda not.

    `meanwhile` is called twice a second, for progress within long trials; `keep` with the index and the result of each
    trial as it ends.
    """
    results: dict[int, Result] = {}
    with _workers(processes or os.cpu_count()) as pool:
        indices = {pool.submit(trial): index for index, trial in enumerate(trials)}
        pending = set(indices)
        while pending:
            finished, pending = wait(pending, POLL_S, FIRST_COMPLETED)
            for future in finished:
                results[indices[future]] = future.result()
                keep(indices[future], future.result())
                show(len(results), len(trials))
            meanwhile()
    return [results[index] for index in range(len(trials))]


@contextmanager
def _workers(count: int | None) -> Iterator[ProcessPoolExecutor]:
    """Make processes that end with the work, also after Ctrl-C."""
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
    """Ctrl-C reaches every process of a terminal; a worker would end its trial and begin the next."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
