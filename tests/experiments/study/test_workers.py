"""Trials in processes: their order, their progress, their problems, and workers that are lost."""

import os
import signal
import time
from functools import partial
from multiprocessing import Pipe, get_context
from pathlib import Path

import pytest

from experiments.study.workers import WorkersError, run_locally, run_parallel
from tests.waiting import wait_until

ONE, TWO = (partial(run_locally, processes=number) for number in (1, 2))


def late(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


def broken() -> float:
    raise ValueError("a trial that cannot be")


def killed_at_first(mark: Path) -> str:
    """End this process as one that is out of memory, unless an earlier run of the trial left the mark."""
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def ignore(done: int, total: int) -> None:
    pass


def test_results_come_in_the_order_of_the_trials_not_of_their_ends_and_each_is_counted() -> None:
    waits, shown = [0.2, 0.0, 0.05, 0.0], list[tuple[int, int]]()
    trials = [partial(late, wait) for wait in waits]
    assert run_parallel(trials, lambda done, total: shown.append((done, total)), TWO) == waits
    assert shown == [(done, 4) for done in range(5)]


def test_an_exception_of_a_trial_reaches_the_caller() -> None:
    with pytest.raises(ValueError, match="cannot be"):
        run_parallel([partial(broken), partial(late, 0.0)], ignore, ONE)


def test_a_long_trial_is_looked_at_meanwhile(tmp_path: Path) -> None:
    """The trial ends only after it was looked at twice."""
    mark, looks = tmp_path / "looked at", list[int]()

    def look() -> None:
        looks.append(1)
        if len(looks) == 2:
            mark.touch()

    run_parallel([partial(wait_for_file, mark)], ignore, partial(run_locally, processes=1, meanwhile=look))


def wait_for_file(path: Path) -> None:
    wait_until(path.exists)


def test_the_trials_of_a_lost_worker_are_repeated(tmp_path: Path) -> None:
    marks = [tmp_path / str(number) for number in range(4)]
    kept: list[int] = []
    trials = [partial(killed_at_first, mark) for mark in marks]
    results = run_parallel(trials, ignore, TWO, lambda index, result: kept.append(index))
    assert results == ["done"] * 4 and sorted(kept) == [0, 1, 2, 3]


def test_the_workers_of_a_program_that_is_killed_end(tmp_path: Path) -> None:
    begun, (reader, writer) = tmp_path / "begun", Pipe(duplex=False)
    trials = [partial(begun.touch), partial(late, 60.0)]
    program = get_context("fork").Process(target=run_parallel, args=(trials, ignore, TWO))
    program.start()
    wait_for_file(begun)
    program.kill()
    program.join()
    writer.close()
    assert reader.poll(20.0)  # no process holds the other end any more


def test_a_trial_that_ends_every_worker_is_given_up_with_a_message() -> None:
    with pytest.raises(WorkersError, match="3 worker processes in a row"):
        run_parallel([os.getpid, kill_this_process], ignore, ONE)


def kill_this_process() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
