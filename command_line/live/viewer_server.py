"""Serves rows to Foxglove and Lichtblick by the SDK's WebSocket server; the rows are the log's own messages in CDR.

The SDK queues messages for each viewer and drops the oldest of one that does not read.
"""

from collections.abc import Sequence
from time import time_ns

import foxglove
from foxglove import Channel, Schema

from firmware_host.log_reading.live_rows import LiveRow, LiveRows


class ViewerServer:
    """Owns the WebSocket server and a channel for each kind of row. Raises OSError if the port is in use."""

    def __init__(self, host: str, port: int) -> None:
        try:
            self._server = foxglove.start_server(name="mudskipper", host=host, port=port)
        except RuntimeError as problem:
            raise OSError(str(problem)) from problem
        self.port = self._server.port
        self._channels: dict[str, Channel] = {}

    def begin(self, source: LiveRows) -> None:
        for kind in source.kinds:
            if kind.topic not in self._channels:
                schema = Schema(name=kind.schema_name, encoding="ros2msg", data=kind.definition.encode())
                self._channels[kind.topic] = Channel(kind.topic, schema=schema, message_encoding="cdr")
        self._server.clear_session()

    def take(self, rows: Sequence[LiveRow], lost: int) -> None:
        now_ns = time_ns()
        for row in rows:
            self._channels[row.kind.topic].log(row.content, log_time=now_ns)

    def close(self) -> None:
        self._server.stop()
