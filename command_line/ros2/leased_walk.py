"""Walks for as long as a ROS 2 client calls: `walk` is a dead-man, which `ros2 service call --rate 2` holds.

The first call begins a walk under the lease of the daemon, and each one renews it. A client that ends, hangs or loses
its network lets the lease run out, and the daemon stops the robot. Any other end of the walk or of the lease (by an
operator, a fault, `stop`) is final until the client has paused: its repeated calls must not start the robot again.
"""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from command_line import exit_codes
from command_line.operation.confirmation import ANSWER_S, end_motion
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

LEASE_S = 2.0
PAUSE = f"; pause for {LEASE_S:g} s before the next walk"


class LeasedWalk:
    """Owns the connection that has the lease, while a client calls."""

    def __init__(self, socket: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._socket, self._clock = socket, clock
        self._lock = threading.Lock()  # services run side by side
        self._client: StatusClient | None = None
        self._called_s = float("-inf")
        self._ended = ""

    def walk(self) -> str:
        """Begin or continue. Raises CallRefusedError with what ended the walk until the calls have paused."""
        with self._lock:
            paused = self._clock() - self._called_s > LEASE_S
            self._called_s = self._clock()
            try:
                self._begin() if paused else self._continue()
            except (CallRefusedError, NoDaemonError, NotPermittedError) as problem:
                self._close(f"{str(problem).removesuffix(PAUSE)}{PAUSE}")
                raise
            return f"walking: call again within {LEASE_S:g} s, or the robot stops"

    def _begin(self) -> None:
        self._close("")
        self._client = StatusClient(self._socket, ANSWER_S)
        self._client.call("walk", lease_s=LEASE_S)

    def _continue(self) -> None:
        if self._client is None:
            raise CallRefusedError(self._ended)
        report = self._client.call("status")
        if report["mode"] == "walking":
            self._client.call("lease", for_s=LEASE_S)
            return
        self._release()
        cause = report["notice"] or f"the robot is in mode {report['mode']}"
        raise CallRefusedError(f"{cause}{PAUSE}")

    def clear(self) -> str:
        """Clear faults, for which no lease is needed."""
        with StatusClient(self._socket, ANSWER_S) as client:
            return str(client.call("clear"))

    def end(self, method: str) -> str:
        """Stop or disarm, for which no lease is needed. Raises CallRefusedError unless every drive has confirmed it."""
        with self._lock:
            if self._client is not None:
                with suppress(CallRefusedError, NoDaemonError):
                    self._client.call(method)
                    self._release()
                self._close(f"ended by {method}{PAUSE}")
        ended = end_motion(self._socket, method)
        if ended.status != exit_codes.OK:
            raise CallRefusedError(ended.answer)
        return ended.answer

    def _release(self) -> None:
        """Free the lease of a robot that walks no more, so that it holds its pose instead of losing its torque."""
        if self._client is not None:
            with suppress(CallRefusedError):
                self._client.call("release")

    def _close(self, ended: str) -> None:
        """Forget the connection: if the robot still walks, it stops."""
        if self._client is not None:
            self._client.close()
        self._client, self._ended = None, ended
