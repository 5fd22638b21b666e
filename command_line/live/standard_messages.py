"""Makes standard ROS 2 messages of rows as they come: from a log for an export, from a daemon for viewers.

Every fourth tick has its messages (95 Hz; ticks that were thinned at rest all have them), and the diagnostics come once
a second and with the first such tick after a stride or an event.
"""

from collections.abc import Mapping
from math import inf
from typing import Any

from command_line.live.ros_messages import DIAGNOSTICS, Row, diagnostics, tick_messages
from control.geometry import FlipperGeometry
from control.rate import RATE_HZ
from control.records import FLIPPERS, TWO_FLIPPERS, Rig

MESSAGE_HZ = 95.0
TICKS_A_MESSAGE = max(1, round(RATE_HZ / MESSAGE_HZ))
DIAGNOSTICS_S = 1.0  # between two of them


class StandardMessages:
    """Owns the latest stride of each flipper and the latest event."""

    def __init__(self, geometry: FlipperGeometry, rig: Rig = TWO_FLIPPERS) -> None:
        self._rig = rig
        self._geometry = geometry
        self._strides: dict[str, Mapping[str, Any]] = {}
        self._event = ""
        self._last_tick, self._diagnosed_s = -TICKS_A_MESSAGE, -inf

    def add_stride(self, stride: Mapping[str, Any]) -> None:
        self._strides[FLIPPERS[bool(stride["flipper"])]] = stride
        self._diagnosed_s = -inf

    def add_event(self, event: Mapping[str, Any]) -> None:
        self._event = str(event["text"])
        self._diagnosed_s = -inf

    def is_due(self, tick: int) -> bool:
        return tick >= self._last_tick + TICKS_A_MESSAGE

    def of_tick(self, stamp_ns: int, tick: Row) -> dict[str, bytes]:
        """Return the messages of a tick that is due, by topic."""
        self._last_tick, stamp_s = int(tick["tick"]), float(tick["stamp_s"])
        messages = tick_messages(stamp_ns, tick, self._geometry, self._rig)
        if stamp_s >= self._diagnosed_s + DIAGNOSTICS_S:
            self._diagnosed_s = stamp_s
            messages[DIAGNOSTICS] = diagnostics(stamp_ns, tick, self._strides, self._event, self._rig)
        return messages
