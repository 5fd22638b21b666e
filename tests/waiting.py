"""Waiting for what another process, or the kernel, does in its own time."""

from __future__ import annotations

import time
from collections.abc import Callable

LONGEST_S = 120.0  # on a computer that others keep busy: only a failing test waits for so long


def wait_until(done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.001)
