"""Takes angles, currents, forces and the phase from the rows that the log's writer serves: they cost the loop nothing.

A status costs the loop a tenth of a millisecond and more, so with rows the feed asks for it less often. Without them
(the log is off, or there are too many viewers) the status has everything too.
"""

import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from control.modes import Mode
from control.records import FLIPPERS, Phase
from firmware_host.log.row_stream import stream_path
from firmware_host.log.rows import ROW_KINDS, TICK_KIND
from firmware_host.log_reading.live_rows import LiveRow, LiveRows
from firmware_host.operator.reports import known
from firmware_host.operator.status_client import NoDaemonError, NotPermittedError

MOST_PACKETS = 1000  # in one call: the daemon may send faster than this program reads
TICK = ROW_KINDS[TICK_KIND].topic
DRIVE_FIELDS = ("angle_rad", "velocity_rad_s", "current_a", "angle_age_s", "current_age_s", "torque_command_nm")
LOADS = {  # of a flipper in the status -> field of a row
    "sweep_torque_nm": "sweep_load_nm",
    "adduction_torque_nm": "adduction_load_nm",
    "force_x_n": "force_x_n",
    "force_z_n": "force_z_n",
    "depth_m": "depth_m",
}


class RowFeed:
    """Owns the subscription; `live` says whether rows come."""

    def __init__(self, status_socket: Path) -> None:
        self._path = stream_path(status_socket)
        self._rows: LiveRows | None = None

    @property
    def live(self) -> bool:
        return self._rows is not None

    def open(self) -> None:
        """Subscribe in a thread of its own: with too many viewers the answer takes seconds."""
        threading.Thread(target=self._open, name="rows", daemon=True).start()

    def _open(self) -> None:
        with suppress(NoDaemonError, NotPermittedError):
            self._rows = LiveRows(self._path)

    def newest(self) -> dict[str, Any] | None:
        """Return the newest tick since the last call, and drop those before."""
        source = self._rows
        newest: LiveRow | None = None
        try:
            for _ in range(MOST_PACKETS if source else 0):
                rows = source.read(0.0) if source else []
                if not rows:
                    break
                newest = next((row for row in reversed(rows) if row.kind.topic == TICK), newest)
        except NoDaemonError:
            self.close()
        return newest.values if newest else None

    def close(self) -> None:
        if self._rows is not None:
            self._rows.close()
            self._rows = None


def updated(status: Mapping[str, Any], tick: Mapping[str, Any]) -> dict[str, Any]:
    """Return the status with the values of a newer tick."""
    drives = [
        drive | {name: known(float(tick[name][index])) for name in DRIVE_FIELDS}
        for index, drive in enumerate(status["drives"])
    ]
    loads = {
        flipper: {name: known(float(tick[field][index])) for name, field in LOADS.items()}
        for index, flipper in enumerate(FLIPPERS)
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
