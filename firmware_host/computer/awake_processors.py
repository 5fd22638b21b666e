"""Keeps the computer's processors awake while torque is on, where the kernel permits it.

A processor that sleeps between two ticks takes up to some 100 µs to wake, and then runs slowly until its clock and its
caches have recovered. A program that holds /dev/cpu_dma_latency open may write to it how many microseconds the
processors may take to wake, as a 32-bit number: 0 keeps them out of every sleep state, which costs power. The request
ends with the process (Documentation/power/pm_qos_interface.rst of Linux; PM_QOS_DEFAULT_VALUE is -1).
"""

import os
import struct
from contextlib import suppress
from pathlib import Path

DEVICE = Path("/dev/cpu_dma_latency")
LIMIT = struct.Struct("=i")
NO_SLEEP, ANY_SLEEP = LIMIT.pack(0), LIMIT.pack(-1)
CLOSED = -1


class AwakeProcessors:
    """Owns the request to the kernel. `problem` says why there is none."""

    def __init__(self, wanted: bool = True, device: Path = DEVICE) -> None:
        self.problem = ""
        self._awake = False
        self._descriptor = CLOSED
        if not wanted:
            return
        try:
            self._descriptor = os.open(device, os.O_WRONLY | os.O_CLOEXEC)
        except OSError as problem:
            self.problem = f"the processors may sleep between two ticks: {device} {problem.strerror}"

    def update(self, energised: bool) -> None:
        """Forbid sleep from the first tick with torque to the last. Writes only where that changes; never raises."""
        if energised is self._awake:
            return
        self._awake = energised
        if self._descriptor != CLOSED:
            with suppress(OSError):  # a late tick is no reason to end a walk
                os.write(self._descriptor, NO_SLEEP if energised else ANY_SLEEP)

    def close(self) -> None:
        if self._descriptor != CLOSED:
            os.close(self._descriptor)
            self._descriptor = CLOSED
