"""Serves rows to Foxglove and Lichtblick by the SDK's WebSocket server: the log's own messages, and standard ones.

The standard ROS 2 messages are made of ticks only while a viewer has subscribed to one of them. The SDK queues
messages for each viewer and drops the oldest of one that does not read; a viewer that asks for a channel which does not
exist is answered with an error and keeps its other channels.
"""

from collections.abc import Sequence
from time import monotonic_ns, time_ns

import foxglove
from foxglove import Channel, Schema

from command_line.live.standard_messages import ROS, TOPICS, StandardMessages, standard_messages_of
from control.geometry import FlipperGeometry
from operator_client.live_rows import LiveRow, LiveRows


class ViewerServer:
    """Owns the WebSocket server and a channel for each kind of message. Raises OSError if the port is in use."""

    def __init__(self, host: str, port: int) -> None:
        try:
            self._server = foxglove.start_server(name="mudskipper", host=host, port=port)
        except RuntimeError as problem:
            raise OSError(str(problem)) from problem
        self.port = self._server.port
        self._channels: dict[str, Channel] = {}
        for topic, message in TOPICS.items():
            self._add_channel(topic, message, ROS.generate_msgdef(message, ros_version=2)[0])
        self._standard = StandardMessages(FlipperGeometry())

    def _add_channel(self, topic: str, name: str, definition: str) -> None:
        schema = Schema(name=name, encoding="ros2msg", data=definition.encode())
        self._channels[topic] = Channel(topic, schema=schema, message_encoding="cdr")

    def begin(self, source: LiveRows) -> None:
        for kind in source.kinds:
            if kind.topic not in self._channels:
                self._add_channel(kind.topic, kind.schema_name, kind.definition)
        self._standard = standard_messages_of(source)
        self._server.clear_session()

    def take(self, rows: Sequence[LiveRow], lost: int) -> None:
        offset_ns = time_ns() - monotonic_ns()  # the daemon's clock is the one of this computer
        wanted = any(self._channels[topic].has_sinks() for topic in TOPICS)
        for row in rows:
            stamp_ns = offset_ns + round(1e9 * row.stamp_s)
            self._channels[row.kind.topic].log(row.content, log_time=stamp_ns)
            for topic, content in self._standard.of_row(row, stamp_ns, wanted).items():
                self._channels[topic].log(content, log_time=stamp_ns)

    def close(self) -> None:
        self._server.stop()
