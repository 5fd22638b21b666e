"""Asks the daemon for its status again and again, in a thread of its own: a daemon that hangs must not stop the keys.

It survives a restart of the daemon: both of its connections, for status and rows, are made again.
"""

import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from command_line.watch.history import History
from command_line.watch.row_feed import RowFeed, updated
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

ANSWER_S = 2.0
RETRY_S = 0.5
STATUS_S = 0.4  # between two while rows come: fewer than one tick in a hundred answers then


class Feed:
    """Owns the history and the connection; hold `lock` while reading the history."""

    def __init__(self, path: Path, period_s: float) -> None:
        self.history = History()
        self.lock = threading.Lock()
        self._path, self._period_s = path, period_s
        self._client: StatusClient | None = None
        self.rows = RowFeed(path)
        self._asked_s = float("-inf")
        self._pid = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="status", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(ANSWER_S)
        self._close()
        self.rows.close()

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._ending.is_set():
            heard = self.poll(time.monotonic())
            due_s = max(due_s + (self._period_s if heard else RETRY_S), time.monotonic())
            self._ending.wait(due_s - time.monotonic())

    def poll(self, now_s: float) -> bool:
        """Take the newest row, or ask for the status; returns whether the daemon is there."""
        tick = self.rows.newest(now_s)
        if tick is not None and now_s < self._asked_s + STATUS_S:
            report = updated(self.history.status, tick)
            if report["mode"] == self.history.status["mode"]:  # else the reason is wanted at once
                with self.lock:
                    self.history.add_status(report, now_s, from_row=True)
                return True
        return self._ask(now_s)

    def _ask(self, now_s: float) -> bool:
        try:
            client = self._client or self._connect()
            report = client.call("status")
            strides = self._new_strides(client, report)
        except (NoDaemonError, NotPermittedError, CallRefusedError) as problem:
            with self.lock:
                self.history.problem = str(problem)
            self._close()
            return False
        with self.lock:
            self.history.add_status(report, now_s)
            self.history.add_strides(strides)
        self._asked_s = now_s
        return True

    def _connect(self) -> StatusClient:
        self._client = StatusClient(self._path, ANSWER_S)
        if self._client.daemon_pid != self._pid:
            self._pid = self._client.daemon_pid
            with self.lock:
                self.history.forget()
        return self._client

    def _new_strides(self, client: StatusClient, report: dict[str, Any]) -> list[dict[str, Any]]:
        """Return the strides that closed since the last poll, as many as one answer holds."""
        since = self.history.next_stride
        return client.call("strides", since=since) if report["strides_closed"] > since else []

    def _close(self) -> None:
        if self._client is not None:
            with suppress(OSError):
                self._client.close()
            self._client = None
