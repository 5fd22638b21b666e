"""Runs many trials at once. A trial is a function without arguments whose result depends on nothing but the function.

`Workers` run them in processes of this computer, or on a cluster (cluster_workers.py). Trials end in any order and on
any of them; results are returned in the order of the trials, so they are the same wherever they were computed.
"""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from multiprocessing import active_children
from typing import Any, TypeVar

from experiments.study.session import Show
from simulation.harness.parent_process import end_with_parent

POLL_S = 0.5
MOST_LOSSES = 3  # of workers in a row, without a trial that ends
Result = TypeVar("Result")
# Yields index and result of each trial as it ends. A lost worker's trials are repeated. Raises WorkersError.
# Trials cross a process border: `functools.partial` does, lambda not.
Workers = Callable[[Sequence[Callable[[], Any]]], Generator[tuple[int, Any], None, None]]


class WorkersError(Exception):
    """Workers that cannot be used, or not any longer; the text says why, and what to do."""


def run_locally(
    trials: Sequence[Callable[[], Any]], processes: int | None = None, meanwhile: Callable[[], None] = lambda: None
) -> Generator[tuple[int, Any], None, None]:
    """Be Workers on this computer: as many processes as it has processors, unless `processes` says otherwise.

    `meanwhile` is called twice a second, for progress within long trials.
    """
    left, losses = dict(enumerate(trials)), 0
    while left:
        try:
            for index, result in _run_in_pool(left, processes or os.cpu_count(), meanwhile):
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


def _run_in_pool(
    trials: Mapping[int, Callable[[], Any]], processes: int | None, meanwhile: Callable[[], None]
) -> Iterator[tuple[int, Any]]:
    """Run trials in processes that end with the work, also after Ctrl-C.

    Ctrl-C reaches every process of a terminal; a worker would end its trial and begin the next. Raises
    BrokenProcessPool where a process ended in the middle of a trial.
    """
    pool = ProcessPoolExecutor(processes, initializer=_begin_worker)
    try:
        indices = {pool.submit(trial): index for index, trial in trials.items()}
        pending = set(indices)
        while pending:
            finished, pending = wait(pending, POLL_S, FIRST_COMPLETED)
            for future in finished:
                yield indices[future], future.result()
            meanwhile()
    except BaseException:
        for worker in active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown()


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()  # one whose program was killed would wait for its next trial for ever


def run_parallel(
    trials: Sequence[Callable[[], Result]],
    show: Show,
    workers: Workers = run_locally,
    keep: Callable[[int, Result], None] = lambda index, result: None,
) -> list[Result]:
    """Return each trial's result, in their order. `keep` is called with index and result of each trial as it ends."""
    results: dict[int, Result] = {}
    show(0, len(trials))
    with closing(workers(trials)) as ended:
        for index, result in ended:
            results[index] = result
            keep(index, result)
            show(len(results), len(trials))
    return [results[index] for index in range(len(trials))]
