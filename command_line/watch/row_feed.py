"""Takes angles, currents, forces and the phase from the rows that the log's writer serves: they cost the loop nothing.

A status costs the loop a tenth of a millisecond and more, so with rows the feed asks for it less often. Without them
(the log is off, or there are too many viewers) the status has everything too.
"""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from control.modes import Mode
from control.records import Phase
from firmware_host.log.row_stream import stream_path
from firmware_host.log.rows import ROW_KINDS, TICK_KIND
from firmware_host.operator.reports import known
from operator_client.live_rows import LiveRow
from operator_client.row_subscription import RowSubscription
from operator_client.status_client import NotPermittedError

MOST_PACKETS = 1000  # in one call: the daemon may send faster than this program reads
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


class RowFeed:
    """Owns the subscription; `live` says whether rows come."""

    def __init__(self, status_socket: Path) -> None:
        self._rows = RowSubscription(stream_path(status_socket))

    @property
    def live(self) -> bool:
        return self._rows.live

    def newest(self, now_s: float) -> dict[str, Any] | None:
        """Return the newest tick since the last call, and drop those before."""
        newest: LiveRow | None = None
        with suppress(NotPermittedError):  # the status says so too
            for _ in range(MOST_PACKETS):
                rows = self._rows.read(0.0, now_s)
                newest = next((row for row in reversed(rows) if row.kind.topic == TICK), newest)
                if not rows:
                    break
        return newest.values if newest else None

    def close(self) -> None:
        self._rows.close()


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
