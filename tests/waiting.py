"""Waiting for asynchronous actions of another process or of the kernel."""

from __future__ import annotations

import time
from collections.abc import Callable

LONGEST_S = 120.0  # generous for a busy computer; only a failing test waits this long


def wait_until(done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.001)
