"""A subscription survives the absence and the restart of its daemon, and waits only if its caller wants it to."""

import os
import socket
from pathlib import Path

import pytest

from firmware_host.log.row_stream import RowStream
from firmware_host.log.rows import TICK, TICK_KIND
from firmware_host.sockets.rights import Group, Rights
from operator_client.live_rows import OPENING_S
from operator_client.row_subscription import RETRY_S, RowSubscription

OWN = Rights(Group("own", os.getegid()), Group("own", os.getegid()), os.geteuid())


@pytest.fixture
def path(short_folder: Path) -> Path:
    return short_folder / "rows"


def publish(stream: RowStream, number: int) -> None:
    stream.publish([(TICK_KIND, TICK.encode_named(stamp_s=0.1 * number, tick=number))])


def test_it_connects_again_to_a_daemon_that_has_restarted(path: Path) -> None:
    rows = RowSubscription(path)
    assert rows.read(0.0, 0.0) == [] and "no daemon serves rows" in rows.problem
    for daemon in (1, 2):
        now_s = 10.0 * daemon
        stream = RowStream(path, OWN, {"robot": f"of daemon {daemon}"})
        assert rows.read(0.0, now_s) == [] and not rows.live
        publish(stream, 1)
        rows.read(0.0, now_s)
        assert rows.live and rows.daemons == daemon and rows.problem == ""
        assert rows.source is not None and rows.source.metadata["robot"] == f"of daemon {daemon}"
        publish(stream, 2)
        found = rows.read(0.0, now_s)
        while len(found) < 2:
            found += rows.read(0.0, now_s)
        assert [(row.values["tick"], row.stamp_s) for row in found] == [(1, 0.1), (2, 0.2)]
        stream.close()
        assert rows.read(0.0, now_s) == [] and "ended" in rows.problem and not rows.live


def test_it_tries_again_only_after_a_while(path: Path) -> None:
    rows = RowSubscription(path)
    rows.read(0.0, 1.0)
    stream = RowStream(path, OWN, {})
    rows.read(0.0, 1.0 + 0.9 * RETRY_S)
    publish(stream, 1)
    assert not rows.live
    rows.read(0.0, 1.0 + RETRY_S)
    publish(stream, 1)
    rows.read(0.0, 1.0 + RETRY_S)
    assert rows.live
    stream.close()


def test_a_daemon_that_accepts_nobody_is_not_waited_for_and_not_called_full(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as full:
        full.bind(str(path))
        full.listen(0)
        first, second = RowSubscription(path), RowSubscription(path)
        assert first.read(0.0, 0.0) == [] and first.problem == ""  # it waits in the queue
        assert second.read(0.0, 0.0) == [] and "does not answer" in second.problem
        assert first.read(0.0, OPENING_S + 1.0) == [] and "does not answer" in first.problem
