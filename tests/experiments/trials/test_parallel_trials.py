"""Trials in processes: their order, their progress, their problems."""

import os
import time
from functools import partial

import pytest

from experiments.trials.parallel_trials import run_parallel


def late(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


def broken() -> float:
    raise ValueError("a trial that cannot be")


def ignore(done: int, total: int) -> None:
    pass


def test_outcomes_come_in_the_order_of_the_trials_not_of_their_ends() -> None:
    waits = [0.2, 0.0, 0.05, 0.0]
    assert run_parallel([partial(late, wait) for wait in waits], ignore, processes=2) == waits


def test_progress_counts_every_trial() -> None:
    shown = list[tuple[int, int]]()
    run_parallel([partial(late, 0.0)] * 3, lambda done, total: shown.append((done, total)), processes=1)
    assert shown == [(1, 3), (2, 3), (3, 3)]


def test_trials_run_in_other_processes() -> None:
    assert os.getpid() not in run_parallel([os.getpid] * 2, ignore, processes=1)


def test_an_exception_of_a_trial_reaches_the_caller() -> None:
    with pytest.raises(ValueError, match="cannot be"):
        run_parallel([partial(broken), partial(late, 0.0)], ignore, processes=1)


def test_a_long_trial_is_looked_at_meanwhile() -> None:
    looks: list[float] = []
    run_parallel([partial(late, 1.2)], ignore, 1, lambda: looks.append(time.monotonic()))
    assert len(looks) >= 3  # two while it ran, one at its end
