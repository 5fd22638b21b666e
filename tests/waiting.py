"""Waiting for asynchronous actions of another process or of the kernel."""

import time
from collections.abc import Callable

LONGEST_S = 300.0  # generous for a busy computer; only a failing test waits this long


def wait_until(done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.001)


def shortest_wait_s(do: Callable[[], object]) -> float:
    """Return the least time of many calls in which this thread did not compute, which no other process lengthens."""
    waits_s = []
    for _ in range(50):
        begun_s, computed_s = time.perf_counter(), time.thread_time()
        do()
        waits_s.append(time.perf_counter() - begun_s - (time.thread_time() - computed_s))
    return min(waits_s)
