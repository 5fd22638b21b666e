"""Runs trials on a Dask cluster: a scheduler and its workers, processes on any number of computers.

    dask scheduler                                           on one computer
    dask worker tcp://ADDRESS:8786 --nworkers -1 --nthreads 1    on each

Every worker has to run this program's own sources, or its digits may differ: all workers are compared before the first
trial, and each trial compares them again, because workers may join later. Dask repeats the trials of a worker that is
lost. This module needs the extra `cluster`.
"""

import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

from distributed import CancelledError, Client, KilledWorker, as_completed
from distributed.comm import CommClosedError

from experiments.trials.parallel_trials import Result, WorkersError
from experiments.trials.program import program_text

CONNECT_S = 10.0
MOST_SUBMITTED = 1000  # trials at the scheduler at once; more than a cluster has processors


class OtherProgramError(Exception):
    """A worker runs another program; the text names both."""


class ClusterWorkers:
    """The workers of the scheduler at an address such as tcp://10.0.0.7:8786."""

    def __init__(self, address: str) -> None:
        self._address = address

    def results(self, trials: Sequence[Callable[[], Result]]) -> Generator[tuple[int, Result], None, None]:
        with _connected(self._address) as client:
            _require_this_program(client)
            waiting, program = iter(enumerate(trials)), program_text()

            def submit(most: int) -> list[Any]:
                return [client.submit(_run, program, *each, pure=False) for each in islice(waiting, most)]

            ended = as_completed(submit(MOST_SUBMITTED))
            for future in ended:
                yield future.result()
                ended.update(submit(1))


def _run(program: str, index: int, trial: Callable[[], Result]) -> tuple[int, Result]:
    """Run a trial on a worker. Raises OtherProgramError."""
    if program_text() != program:
        raise OtherProgramError(_other_program("a worker", program_text(), program))
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
        except OtherProgramError as problem:
            raise WorkersError(str(problem)) from None
        except KilledWorker as problem:
            raise WorkersError(f"the cluster at {address} gave up a trial that ended its workers: {problem}") from None
        except (CancelledError, CommClosedError) as problem:
            raise WorkersError(f"the cluster at {address} was lost: {problem or type(problem).__name__}") from problem


def _require_this_program(client: Client) -> None:
    """Raises WorkersError where there is no worker, OtherProgramError where one runs another program."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError:
        address = client.scheduler.address
        raise WorkersError(
            f"the cluster at {address} has no workers: start some with 'dask worker {address}'"
        ) from None
    for worker, found in client.run(program_text, on_error="return").items():
        if found != program_text():
            raise OtherProgramError(_other_program(f"the worker {worker}", str(found), program_text()))


def _other_program(worker: str, found: str, expected: str) -> str:
    return f"{worker} runs {found}, and this is {expected}: install the same version of mudskipper on all workers"
