"""What serving the status socket adds to the ticks of a walk.

After each tick the walk serves its socket, as the daemon does: without a request, with one for the `status` of the
walking robot, or with one for the largest answer that any method can give (serving_time.py). A figure contains polling
the socket, reading the request, the method, and encoding and sending the answer. The requests arrive during the tick
before; a viewer asks for the status as often as `mudskipper watch` does.
"""

import os
import socket
from pathlib import Path
from time import perf_counter
from typing import Any

import msgpack

from control.rate import RATE_HZ
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.rights import Group, Rights
from firmware_host.sockets.rpc import REQUEST
from firmware_host.sockets.status_socket import Methods, StatusSocket
from verification.report import summary_us
from verification.speed.serving_time import READING, answer
from verification.walks.timed_walk import BLOCK_TICKS, TimedWalk

VIEWER_HZ = 10.0  # of `mudskipper watch`
VIEWER_TICKS = round(RATE_HZ / VIEWER_HZ)
LARGEST, IDLE, STATUS = "largest", "idle", "status"


def largest_method(methods: Methods) -> str:
    """Returns the name of the method with the longest answer."""
    return max(READING, key=lambda name: len(answer(methods, name)))


class ServedWalk:
    """Owns the socket of a walk, one client of it, and the durations of serving."""

    def __init__(self, walk: TimedWalk, fullest: Methods, folder: Path) -> None:
        self.walk = walk
        self.durations_s: dict[str, list[float]] = {IDLE: [], STATUS: [], LARGEST: []}
        self._largest = largest_method(fullest)
        self._largest_bytes = len(answer(fullest, self._largest))
        path, own = folder / "status.sock", Group("own", os.getegid())
        methods = OperatorCalls(walk.walk.loop, [], lambda: walk.walk.now_s).methods
        self._status = StatusSocket(path, {**methods, LARGEST: fullest[self._largest]}, Rights(own, own, os.getuid()))
        self._client = socket.socket(socket.AF_UNIX)
        self._client.connect(str(path))
        self._status.serve(walk.walk.now_s)  # accepts the client
        self._client.settimeout(1.0)

    def run_block(self) -> None:
        for number in range(BLOCK_TICKS):
            request = {0: STATUS, VIEWER_TICKS // 2: LARGEST}.get(number % VIEWER_TICKS, IDLE)
            if request != IDLE:
                self._client.sendall(msgpack.packb([REQUEST, number, request, {}]))
            self.walk.tick()
            self.durations_s[request].append(self._serve())
            if request != IDLE:
                self._fetch_answer()

    def _serve(self) -> float:
        start_s = perf_counter()
        self._status.serve(self.walk.walk.now_s)
        return perf_counter() - start_s

    def _fetch_answer(self) -> None:
        """Raises RuntimeError where the answer is an error, TimeoutError where it is not sent in one tick."""
        unpacker = msgpack.Unpacker()
        while True:
            unpacker.feed(self._client.recv(1 << 16))
            for _, _, error, _ in unpacker:
                if error is not None:
                    raise RuntimeError(error)
                return

    def report(self) -> dict[str, Any]:
        """Returns a summary of each kind of request."""
        summaries: dict[str, Any] = {name: summary_us(each) for name, each in self.durations_s.items()}
        summaries[LARGEST] |= {"method": self._largest, "bytes": self._largest_bytes}
        return summaries

    def ratios(self, whole_us: float) -> dict[str, float]:
        """Returns medians divided by a whole tick; `viewer` is what one viewer adds to a tick in the mean."""
        medians_us = {name: summary["median"] for name, summary in self.report().items()}
        viewer_us = (medians_us[STATUS] - medians_us[IDLE]) / VIEWER_TICKS
        medians_us |= {"viewer": viewer_us}
        return {f"serving_{name}_to_hot": round(median_us / whole_us, 3) for name, median_us in medians_us.items()}

    def close(self) -> None:
        self._client.close()
        self._status.close()
