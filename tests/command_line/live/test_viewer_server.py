"""An independent WebSocket client sees the log's rows as the Foxglove protocol describes them (foxglove.sdk.v1)."""

import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import ClientConnection, connect

from command_line.live.viewer_server import ViewerServer
from firmware_host.log.rows import ROW_KINDS, TICK
from firmware_host.log_reading.live_rows import LiveRow, LiveRows
from tests.command_line.command_lines import failure

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1  # opcode of a binary message, then subscription id and time


def next_json(socket: ClientConnection, operation: str) -> dict[str, Any]:
    while True:
        message = socket.recv(timeout=60)
        if isinstance(message, str) and json.loads(message)["op"] == operation:
            return dict(json.loads(message))


def test_a_foreign_client_decodes_a_tick_by_the_definition_that_it_was_sent() -> None:
    server = ViewerServer("127.0.0.1", 0)
    server.begin(cast(LiveRows, SimpleNamespace(kinds=list(ROW_KINDS))))
    with connect(f"ws://127.0.0.1:{server.port}", subprotocols=[SUBPROTOCOL]) as socket:  # type: ignore[list-item]
        channels = {c["topic"]: c for c in next_json(socket, "advertise")["channels"]}
        assert {"/tick", "/stride", "/event"} <= channels.keys()
        channel = channels["/tick"]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel["id"]}]}))
        row = TICK.encode_named(stamp_s=1.5, tick=42, angle_rad=(0.1, 0.2, 0.3, 0.4))
        payload = received(socket, server, LiveRow(TICK, row))
    server.close()
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    tick = cast(Any, types.deserialize_cdr(payload, channel["schemaName"]))
    assert (tick.stamp_s, tick.tick, tick.angle_rad.tolist()) == (1.5, 42, [0.1, 0.2, 0.3, 0.4])


def received(socket: ClientConnection, server: ViewerServer, row: LiveRow) -> bytes:
    """Returns the content of the first data message; the subscription may take effect after a few rows."""
    for _ in range(1000):
        server.take([row], lost=0)
        try:
            message = socket.recv(timeout=0.1)
        except TimeoutError:
            continue
        if isinstance(message, bytes) and message[0] == MESSAGE_DATA:
            assert struct.unpack_from("<I", message, 1) == (1,)
            return message[13:]
    raise AssertionError("no data message came")


def test_a_port_in_use_is_one_sentence(capsys: pytest.CaptureFixture[str], short_folder: Path) -> None:
    server = ViewerServer("127.0.0.1", 0)
    arguments = ("live", "--socket", str(short_folder / "s"), "--port", str(server.port))
    assert "choose another --port" in failure(capsys, *arguments)
    assert "choose another --port" in failure(capsys, *arguments, "--page")
    server.close()
