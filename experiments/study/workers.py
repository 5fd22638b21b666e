"""Runs many trials at once. A trial is a function without arguments whose result depends on nothing but the function.

`Workers` are processes of this computer, or those of a cluster (cluster_workers.py). Trials end in any order and on any
of them; results are returned in the order of the trials, so they are the same wherever they were computed.
"""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from multiprocessing import active_children
from typing import Protocol, TypeVar

from experiments.study.session import Show

POLL_S = 0.5
MOST_LOSSES = 3  # of workers in a row, without a trial that ends
Result = TypeVar("Result")


class WorkersError(Exception):
    """Workers that cannot be used, or not any longer; the text says why, and what to do."""


class Workers(Protocol):
    def results(self, trials: Sequence[Callable[[], Result]]) -> Generator[tuple[int, Result], None, None]:
        """Yield index and result of each trial as it ends. A lost worker's trials are repeated. Raises WorkersError.

        Trials cross a process border: `functools.partial` does, lambda not.
        """


class LocalWorkers:
    """Processes of this computer: as many as it has processors, unless `processes` says otherwise."""

    def __init__(self, processes: int | None = None, meanwhile: Callable[[], None] = lambda: None) -> None:
        """`meanwhile` is called twice a second, for progress within long trials."""
        self._processes = processes or os.cpu_count()
        self._meanwhile = meanwhile

    def results(self, trials: Sequence[Callable[[], Result]]) -> Generator[tuple[int, Result], None, None]:
        left, losses = dict(enumerate(trials)), 0
        while left:
            try:
                for index, result in self._run_in_pool(left):
                    del left[index]
                    losses = 0
                    yield index, result
            except BrokenProcessPool:
                losses += 1
                if losses == MOST_LOSSES:
                    raise WorkersError(
                        f"{losses} worker processes in a row ended before their trials: this computer may have too "
                        "little memory; try fewer with --workers"
                    ) from None

    def _run_in_pool(self, trials: Mapping[int, Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
        """Raises BrokenProcessPool where a process ended in the middle of a trial."""
        with _pool(self._processes) as pool:
            indices = {pool.submit(trial): index for index, trial in trials.items()}
            pending = set(indices)
            while pending:
                finished, pending = wait(pending, POLL_S, FIRST_COMPLETED)
                for future in finished:
                    yield indices[future], future.result()
                self._meanwhile()


def run_parallel(
    trials: Sequence[Callable[[], Result]],
    show: Show,
    workers: Workers | None = None,
    keep: Callable[[int, Result], None] = lambda index, result: None,
) -> list[Result]:
    """Return each trial's result, in their order. `keep` is called with index and result of each trial as it ends."""
    results: dict[int, Result] = {}
    show(0, len(trials))
    with closing((workers or LocalWorkers()).results(trials)) as ended:
        for index, result in ended:
            results[index] = result
            keep(index, result)
            show(len(results), len(trials))
    return [results[index] for index in range(len(trials))]


@contextmanager
def _pool(processes: int | None) -> Iterator[ProcessPoolExecutor]:
    """Make processes that end with the work, also after Ctrl-C.

    Ctrl-C reaches every process of a terminal; a worker would end its trial and begin the next.
    """
    pool = ProcessPoolExecutor(processes, initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN))
    try:
        yield pool
    except BaseException:
        for worker in active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown()
