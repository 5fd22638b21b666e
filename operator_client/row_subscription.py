"""Subscribes to the rows of a daemon, and again whenever it has restarted: for `mudskipper live` and `watch`."""

import time
from math import inf
from pathlib import Path

from operator_client.live_rows import OPENING_S, LiveRow, LiveRows
from operator_client.status_client import NoDaemonError

RETRY_S = 0.5  # between two attempts to connect


class RowSubscription:
    """Owns the connection; `problem` says why no rows come, and is empty while they do."""

    def __init__(self, path: Path) -> None:
        self.problem = ""
        self.daemons = 0  # that have served this subscription
        self.source: LiveRows | None = None  # of the newest of them
        self._path = path
        self._rows: LiveRows | None = None  # the present connection
        self._tried_s = -inf

    @property
    def live(self) -> bool:
        return self._rows is not None and self._rows.is_open

    def read(self, timeout_s: float, now_s: float) -> list[LiveRow]:
        """Return the rows that have come; none after the time, or without a daemon. Raises NotPermittedError."""
        if self._rows is None and now_s < self._tried_s + RETRY_S:
            time.sleep(timeout_s)
            return []
        try:
            return self._receive(timeout_s, now_s)
        except NoDaemonError as problem:
            self.problem = str(problem)
            self.close()
            return []

    def _receive(self, timeout_s: float, now_s: float) -> list[LiveRow]:
        if self._rows is None:
            self._tried_s = now_s
            self._rows = LiveRows(self._path, opening_s=0.0)
        rows, opened = self._rows, self._rows.is_open
        received = rows.read(timeout_s)
        if rows.is_open and not opened:
            self.problem, self.source = "", rows
            self.daemons += 1
        elif not rows.is_open and now_s > self._tried_s + OPENING_S:
            raise rows.silent
        return received

    def close(self) -> None:
        if self._rows is not None:
            self._rows.close()
            self._rows = None
