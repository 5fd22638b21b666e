"""Runs trials on a Dask cluster: a scheduler and its workers, processes on any number of computers.

    dask scheduler                                           on one computer
    dask worker tcp://ADDRESS:8786 --nworkers -1 --nthreads 1    on each

Every worker has to have the sources that the trials import, or its digits may differ: all workers are compared before
the first trial, and each trial compares them again, because workers may join later. Dask repeats the trials of a worker
that is lost. This module needs the extra `cluster`.
"""

import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

from distributed import CancelledError, Client, KilledWorker, as_completed
from distributed.comm import CommClosedError

from experiments.study.provenance import Record, identity, program_text
from experiments.study.workers import WorkersError

CONNECT_S = 10.0
MOST_SUBMITTED = 1000  # trials at the scheduler at once; more than a cluster has processors


def run_on_cluster(trials: Sequence[Callable[[], Any]], address: str) -> Generator[tuple[int, Any], None, None]:
    """Be Workers: those of the scheduler at an address such as tcp://10.0.0.7:8786."""
    with _connected(address) as client:
        modules = sorted({getattr(trial, "func", trial).__module__ for trial in trials})
        _require_this_program(client, modules)
        waiting, program = iter(enumerate(trials)), identity(*modules)

        def submit(most: int) -> list[Any]:
            return [client.submit(_run, program, modules, *each, pure=False) for each in islice(waiting, most)]

        ended = as_completed(submit(MOST_SUBMITTED))
        for future in ended:
            yield future.result()
            ended.update(submit(1))


def _run(program: Record, modules: Sequence[str], index: int, trial: Callable[[], Any]) -> tuple[int, Any]:
    """Run a trial on a worker. Raises WorkersError where it runs another program."""
    _require_same("a worker", identity(*modules), program)
    return index, trial()


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    """Raises WorkersError where the cluster cannot be reached or is lost."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what it logs is in our message
    try:
        client = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError) as problem:
        raise WorkersError(
            f"no cluster answers at {address}: check the address, or start 'dask scheduler' there"
        ) from problem
    with client:
        try:
            yield client
        except KilledWorker as problem:
            raise WorkersError(f"the cluster at {address} gave up a trial that ended its workers: {problem}") from None
        except (CancelledError, CommClosedError) as problem:
            raise WorkersError(f"the cluster at {address} was lost: {problem or type(problem).__name__}") from problem


def _require_this_program(client: Client, modules: Sequence[str]) -> None:
    """Raises WorkersError where there is no worker, or one that runs another program."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError:
        address = client.scheduler.address
        raise WorkersError(
            f"the cluster at {address} has no workers: start some with 'dask worker {address}'"
        ) from None
    for worker, found in client.run(identity, *modules, on_error="return").items():
        _require_same(f"the worker {worker}", found, identity(*modules))


def _require_same(worker: str, found: Record | Exception, expected: Record) -> None:
    """`found` is an exception where the worker could not answer. Raises WorkersError."""
    if found != expected:
        runs = str(found) if isinstance(found, Exception) else program_text(found)
        raise WorkersError(
            f"{worker} runs {runs}, and this is {program_text(expected)}: install the same version of mudskipper on all"
            " workers"
        )
