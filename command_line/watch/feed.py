"""Asks the daemon for its status again and again, in a thread of its own: a daemon that hangs must not stop the keys.

A status costs the loop a tenth of a millisecond and more. So angles, currents, forces and the phase are taken from the
rows that the log's writer serves, which cost the loop nothing, and a status is asked for less often. Without rows (the
log is off, or there are too many viewers) the status has everything too.

It survives a restart of the daemon: both of its connections, for status and rows, are made again.
"""

import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from command_line.watch.history import History
from control.modes import Mode
from control.records import Phase
from firmware_host.configuration.socket_paths import rows_path
from firmware_host.log.rows import ROW_KINDS, TICK_KIND
from firmware_host.operator.reports import known
from operator_client.live_rows import LiveRow
from operator_client.row_subscription import RowSubscription
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError, StatusClient

ANSWER_S = 2.0
RETRY_S = 0.5
STATUS_S = 0.4  # between two while rows come: fewer than one tick in a hundred answers then
MOST_PACKETS = 1000  # in one poll: the daemon may send faster than this program reads
TICK = ROW_KINDS[TICK_KIND].topic
DRIVE_FIELDS = (
    *("angle_rad", "velocity_rad_s", "current_a", "angle_age_s", "current_age_s", "torque_command_nm"),
    *("bus_voltage_v", "bus_current_a"),
)
LOADS = {  # of a flipper in the status -> field of a row
    "sweep_torque_nm": "sweep_load_nm",
    "adduction_torque_nm": "adduction_load_nm",
    "force_x_n": "force_x_n",
    "force_z_n": "force_z_n",
    "depth_m": "depth_m",
}


class Feed:
    """Owns the history and the connection; hold `lock` while reading the history."""

    def __init__(self, path: Path, period_s: float) -> None:
        self.history = History()
        self.lock = threading.Lock()
        self._path, self._period_s = path, period_s
        self._client: StatusClient | None = None
        self.rows = RowSubscription(rows_path(path))
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
        tick = self._newest_tick(now_s)
        if tick is not None and now_s < self._asked_s + STATUS_S:
            report = updated(self.history.status, tick)
            if report["mode"] == self.history.status["mode"]:  # else the reason is wanted at once
                with self.lock:
                    self.history.add_status(report, now_s, from_row=True)
                return True
        return self._ask(now_s)

    def _newest_tick(self, now_s: float) -> dict[str, Any] | None:
        """Return the newest tick since the last poll, and drop those before."""
        newest: LiveRow | None = None
        with suppress(NotPermittedError):  # the status says so too
            for _ in range(MOST_PACKETS):
                rows = self.rows.read(0.0, now_s)
                newest = next((row for row in reversed(rows) if row.kind.topic == TICK), newest)
                if not rows:
                    break
        return newest.values if newest else None

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


def updated(status: Mapping[str, Any], tick: Mapping[str, Any]) -> dict[str, Any]:
    """Return the status with the values of a newer tick."""
    drives = [
        drive | {name: known(float(tick[name][index])) for name in DRIVE_FIELDS}
        for index, drive in enumerate(status["drives"])
    ]
    loads = {
        flipper: {name: known(float(tick[field][index])) for name, field in LOADS.items()}
        for index, flipper in enumerate(status["loads"])
    }
    return {
        **status,
        "now_s": tick["stamp_s"],
        "mode": Mode(tick["mode"]).name.lower(),
        "phase": Phase(tick["phase"]).name.lower(),
        "stride": tick["stride"],
        "depth_m": tick["stride_depth_m"],
        "body_x_m": known(tick["body_x_m"]),
        "drives": drives,
        "loads": loads,
    }
