"""Publishes a robot's rows to ROS 2: the standard messages of ticks, each stride, and then the mud's map."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import zenoh

from command_line.live.standard_messages import ROS, TOPICS, StandardMessages, standard_messages_of
from command_line.ros2.own_messages import MAP, MAP_TOPIC, OWN, map_message
from command_line.ros2.ros_node import RosNode
from command_line.screen import complain
from control.geometry import FlipperGeometry
from firmware_host.log.rows import STRIDE
from operator_client.live_rows import LiveRow, LiveRows
from operator_client.status_client import CallRefusedError, NoDaemonError, NotPermittedError

CHECK_S = 1.0  # between two looks at whether the router is there


class RosAudience:
    """Owns a publisher for each topic; `read_map` asks the daemon for the mud's map."""

    def __init__(self, session: zenoh.Session, node: RosNode, read_map: Callable[[], list[dict[str, Any]]]) -> None:
        self._session, self._router_is_there, self._checked_s = session, True, 0.0
        self._ticks = {topic: node.publisher(topic, name, ROS.hash_rihs01(name)) for topic, name in TOPICS.items()}
        self._strides, self._map = (
            node.publisher(topic, name, OWN.hash_rihs01(name))
            for topic, name in ((STRIDE.topic, STRIDE.schema_name), (MAP_TOPIC, MAP))
        )
        self._read_map = read_map
        self._standard = StandardMessages(FlipperGeometry())

    def begin(self, source: LiveRows) -> None:
        self._standard = standard_messages_of(source)

    def take(self, rows: Sequence[LiveRow], lost: int) -> None:
        self._check_router()
        offset_ns = time.time_ns() - time.monotonic_ns()  # the daemon's clock is the one of this computer
        wanted = any(publisher.is_wanted for publisher in self._ticks.values())
        for row in rows:
            stamp_ns = offset_ns + round(1e9 * row.stamp_s)
            if row.kind.topic == STRIDE.topic:  # encoded again: a daemon of another version may have other fields
                self._strides.publish(STRIDE.encode_named(**row.values))
            for topic, content in self._standard.of_row(row, stamp_ns, wanted).items():
                self._ticks[topic].publish(content)
        if any(row.kind.topic == STRIDE.topic for row in rows) and self._map.is_wanted:
            with suppress(NoDaemonError, CallRefusedError, NotPermittedError):  # the next stride brings it
                self._map.publish(map_message(rows[-1].stamp_s, self._read_map()))

    def _check_router(self) -> None:
        if time.monotonic() < self._checked_s + CHECK_S:
            return
        self._checked_s, was_there = time.monotonic(), self._router_is_there
        self._router_is_there = bool(self._session.info.routers_zid())
        if was_there and not self._router_is_there:
            complain("the zenoh router is gone; waiting for it")
