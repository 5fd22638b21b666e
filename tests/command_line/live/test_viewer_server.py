"""An independent WebSocket client sees the log's rows as the Foxglove protocol describes them (foxglove.sdk.v1)."""

import json
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import ClientConnection, connect

from command_line.live.standard_messages import TOPICS
from command_line.live.viewer_server import ViewerServer
from control.records import JOINTS
from firmware_host.log.rows import ROW_KINDS, TICK
from operator_client.live_rows import LiveRow, LiveRows
from tests.command_line.command_lines import failure

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1  # opcode of a binary message, then subscription id and time


def next_json(socket: ClientConnection, operation: str) -> dict[str, Any]:
    while True:
        message = socket.recv(timeout=60)
        if isinstance(message, str) and json.loads(message)["op"] == operation:
            return dict(json.loads(message))


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    made = ViewerServer("127.0.0.1", 0)
    made.begin(cast(LiveRows, SimpleNamespace(kinds=list(ROW_KINDS), configuration_text="")))
    yield made
    made.close()


@contextmanager
def viewer_of(server: ViewerServer) -> Iterator[tuple[ClientConnection, dict[str, Any]]]:
    """Yield a connection and the advertised channels by topic."""
    with connect(f"ws://127.0.0.1:{server.port}", subprotocols=[SUBPROTOCOL]) as socket:  # type: ignore[list-item]
        yield socket, {channel["topic"]: channel for channel in next_json(socket, "advertise")["channels"]}


def subscribe(socket: ClientConnection, channel_id: int) -> None:
    socket.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel_id}]}))


def decoded(channel: dict[str, Any], payload: bytes) -> Any:
    """Decode a message with the advertised definition."""
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    return types.deserialize_cdr(payload, channel["schemaName"])


def tick_row(number: int) -> LiveRow:
    return LiveRow(TICK, TICK.encode_named(stamp_s=1.5, tick=number, angle_rad=(0.1, 0.2, 0.3, 0.4)))


def test_a_foreign_client_decodes_a_tick_by_the_definition_that_it_was_sent(server: ViewerServer) -> None:
    with viewer_of(server) as (socket, channels):
        assert {"/tick", "/stride", "/event"} <= channels.keys()
        subscribe(socket, channels["/tick"]["id"])
        tick = decoded(channels["/tick"], received(socket, server, lambda number: tick_row(42)))
    assert (tick.stamp_s, tick.tick, tick.angle_rad.tolist()) == (1.5, 42, [0.1, 0.2, 0.3, 0.4])


def test_the_stream_has_standard_messages_with_named_joints(server: ViewerServer) -> None:
    with viewer_of(server) as (socket, channels):
        assert channels.keys() >= TOPICS.keys()
        assert {topic: channels[topic]["schemaName"] for topic in TOPICS} == TOPICS
        subscribe(socket, channels["/joint_states"]["id"])
        state = decoded(channels["/joint_states"], received(socket, server, lambda number: tick_row(4 * number)))
    assert dict(zip(state.name, state.position, strict=True)) == dict(zip(JOINTS, (0.1, 0.2, 0.3, 0.4), strict=True))
    assert state.header.frame_id == "base_link"


def received(socket: ClientConnection, server: ViewerServer, row_of: Callable[[int], LiveRow]) -> bytes:
    """Return the content of the first data message; the subscription may take effect after a few rows."""
    for number in range(1000):
        server.take([row_of(number)], lost=0)
        try:
            message = socket.recv(timeout=0.1)
        except TimeoutError:
            continue
        if isinstance(message, bytes) and message[0] == MESSAGE_DATA:
            assert struct.unpack_from("<I", message, 1) == (1,)
            return message[13:]
    raise AssertionError("no data message came")


def test_a_port_in_use_is_one_sentence(short_folder: Path) -> None:
    server = ViewerServer("127.0.0.1", 0)
    arguments = ("live", "--socket", str(short_folder / "s"), "--port", str(server.port))
    assert "choose another --port" in failure(*arguments)
    assert "choose another --port" in failure(*arguments, "--page")
    server.close()
