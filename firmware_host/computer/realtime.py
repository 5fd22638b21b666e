"""Asks the operating system for real-time scheduling and locked memory, where that is permitted.

The loop's thread gets SCHED_FIFO (its children start as ordinary processes), one processor, memory that is locked
against paging, and no garbage collection while it runs. The robot also runs without a setting that is refused; a
warning reports it to the operator.
"""

import ctypes
import gc
import os
import sys

MCL_CURRENT, MCL_FUTURE = 1, 2
PR_SET_TIMERSLACK = 29
SWITCH_INTERVAL_S = 1e-4  # another Python thread would give way after this time


def prepare_loop(priority: int, cpu: int, lock_memory: bool) -> list[str]:
    """Apply all settings; return a warning for each that is refused."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1)  # ns, where an ordinary process may be woken 50 us late
    warnings = [pin(cpu) if cpu >= 0 else "", _lock_memory() if lock_memory else "", _schedule(priority)]
    freeze_garbage()
    return [warning for warning in warnings if warning]


def freeze_garbage() -> None:
    """Collect garbage once and switch the collection off: a full one takes several ticks."""
    gc.collect()
    gc.freeze()
    gc.disable()


def pin(cpu: int) -> str:
    """Run on this processor alone; return a warning where that is refused."""
    try:
        os.sched_setaffinity(0, {cpu})
    except OSError as problem:
        return f"not pinned to processor {cpu}: {problem.strerror}"
    return ""


def _lock_memory() -> str:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
        return f"memory not locked: {os.strerror(ctypes.get_errno())}; raise the memlock limit"
    return ""


def _schedule(priority: int) -> str:
    if priority == 0:
        return "no real-time priority: loop.priority is 0"
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except OSError as problem:
        return f"no real-time priority {priority}: {problem.strerror}; raise the rtprio limit"
    return ""
