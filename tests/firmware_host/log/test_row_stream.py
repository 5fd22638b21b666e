"""Rows reach every subscriber; a slow subscriber loses only its own rows and is informed of their number."""

import os
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from firmware_host.configuration.toml_records import LARGEST_FILE_BYTES
from firmware_host.log.row_stream import PACKET_BYTES, RowStream, packets
from firmware_host.sockets.rights import Group, Peer, Rights
from operator_client.live_rows import LiveRows
from operator_client.status_client import NoDaemonError, NotPermittedError
from tests.firmware_host.synthetic_rows import make_event, make_tick, make_ticks

OWN = Rights(Group("own", os.getegid()), Group("own", os.getegid()), os.geteuid())
RIGHTS_OF_OTHERS = Rights(Group("readers", 77777), Group("operators", 77778), 77779)


@pytest.fixture
def path(short_folder: Path) -> Path:
    return short_folder / "rows"


@pytest.fixture
def stream(path: Path) -> Iterator[RowStream]:
    made = RowStream(path, OWN, {"robot": "test"})
    assert made.problem == ""
    yield made
    made.close()


def subscribe(stream: RowStream, path: Path) -> LiveRows:
    with ThreadPoolExecutor(1) as threads:
        waiting = threads.submit(LiveRows, path)
        while not waiting.done():
            stream.publish([])
            time.sleep(0.001)
        return waiting.result()


def received(rows: LiveRows) -> list[int]:
    numbers: list[int] = []
    while found := rows.read(0.05):
        numbers += [row.values["tick"] for row in found if row.kind.topic == "/tick"]
    return numbers


def test_every_subscriber_gets_every_row_with_its_values(stream: RowStream, path: Path) -> None:
    first, second = subscribe(stream, path), subscribe(stream, path)
    stream.publish([make_tick(1), make_event("walk", 0.2), make_tick(2)])
    for subscriber in (first, second):
        rows = subscriber.read(1.0)
        assert [row.kind.topic for row in rows] == ["/tick", "/event", "/tick"]
        assert rows[1].values == {"stamp_s": 0.2, "text": "walk"}
        assert subscriber.metadata == {"robot": "test"}


def test_a_subscriber_gets_the_rows_of_a_robot_with_the_largest_file(path: Path) -> None:
    text = "é" * (LARGEST_FILE_BYTES // 2)
    with closing(RowStream(path, OWN, {}, text)) as stream, closing(subscribe(stream, path)) as rows:
        assert rows.configuration_text == text


def test_a_subscriber_that_hangs_loses_its_own_rows_and_learns_how_many(stream: RowStream, path: Path) -> None:
    reading, hanging = subscribe(stream, path), subscribe(stream, path)
    got: list[int] = []
    for number in range(3000):
        stream.publish([make_tick(number)])
        if number % 100 == 99:
            got += received(reading)
    assert got == list(range(3000)) and reading.lost == 0
    late = received(hanging)
    stream.publish([make_tick(3000)])
    late += received(hanging)
    assert late[-1] == 3000 and hanging.lost > 0
    assert len(late) + hanging.lost == 3001
    stream.publish([make_tick(3001)])
    assert received(hanging) == [3001] and len(late) + hanging.lost == 3001  # each loss is sent once


def test_a_subscriber_that_leaves_costs_the_others_nothing(stream: RowStream, path: Path) -> None:
    leaving, staying = subscribe(stream, path), subscribe(stream, path)
    leaving.close()
    stream.publish([make_tick(1)])
    stream.publish([make_tick(2)])
    assert received(staying) == [1, 2]


def test_silent_readers_leave_places_for_operators_and_one_too_many_is_refused_in_words(path: Path) -> None:
    uids = iter([65001] * 7 + [65000] * 3)  # readers, then operators
    rights = Rights(Group("readers", 65001), Group("operators", 65000), 1)

    def next_peer(connection: socket.socket) -> Peer:
        uid = next(uids)
        return Peer(1, uid, frozenset({uid}))

    stream = RowStream(path, rights, {"robot": "test"}, peer_of=next_peer)
    places = [subscribe(stream, path) for _ in range(6)]
    with pytest.raises(NoDaemonError, match="all 6 places for the level read are taken"):
        subscribe(stream, path)
    places += [subscribe(stream, path) for _ in range(2)]
    with pytest.raises(NoDaemonError, match="all 8 places for the level drive are taken"):
        subscribe(stream, path)
    stream.publish([make_tick(1)])
    assert received(places[-1]) == [1]
    stream.close()


def test_a_user_without_the_right_to_read_is_refused_with_the_reason(path: Path) -> None:
    stream = RowStream(path, RIGHTS_OF_OTHERS, {}, peer_of=lambda connection: Peer(1, 1, frozenset()))
    with pytest.raises(NotPermittedError, match="readers"):
        subscribe(stream, path)
    stream.close()


def test_the_socket_of_an_earlier_daemon_s_writer_that_hangs_is_replaced(path: Path, stream: RowStream) -> None:
    with closing(RowStream(path, OWN, {"robot": "new"})) as new:
        stream.close()  # much later
        with closing(subscribe(new, path)) as rows:
            assert rows.metadata == {"robot": "new"}
    path.touch()
    assert "no socket" in RowStream(path, OWN, {}).problem


def test_a_packet_is_never_longer_than_its_bound() -> None:
    made = packets(make_ticks(0, 200))
    assert all(len(packet) <= PACKET_BYTES for packet, _ in made)
    assert sum(count for _, count in made) == 200
