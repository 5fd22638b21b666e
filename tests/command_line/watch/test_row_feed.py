"""Rows from the log's writer keep the screen up to date between two status requests."""

import time
from pathlib import Path

import pytest

from command_line.watch.feed import STATUS_S, Feed, updated
from firmware_host.configuration.configuration import StatusParameters
from firmware_host.configuration.socket_paths import rows_path
from firmware_host.log.recorder import NullRecorder
from firmware_host.log.row_stream import RowStream
from firmware_host.log.rows import TICK, TICK_KIND
from firmware_host.sockets.user_groups import load_rights
from tests.command_line.watch.served_robot import ServedRobot

SAME = ("mode", "phase", "stride", "depth_m", "body_x_m", "loads")
DRIVE_SAME = ("joint", "angle_rad", "current_a", "torque_command_nm", "closed_loop", "current_limit_a")


class LastRow(NullRecorder):
    row = b""

    def put(self, kind_index: int, payload: bytes) -> bool:
        if kind_index == TICK_KIND:
            self.row = payload
        return True


@pytest.fixture
def recorded(walked: ServedRobot) -> tuple[ServedRobot, LastRow]:
    recorder = walked.robot.loop.recorder = LastRow()
    return walked, recorder


def test_a_row_updates_a_status_to_the_status_of_its_tick(recorded: tuple[ServedRobot, LastRow]) -> None:
    robot, recorder = recorded
    before = robot.ask("status")
    robot.robot.run_for(0.7)
    after, row = robot.ask("status"), TICK.decode(recorder.row)
    found = updated(before, row)
    assert found.keys() == after.keys()
    for name in SAME:
        assert found[name] == after[name], name
    for drive, expected in zip(found["drives"], after["drives"], strict=True):
        assert {name: drive[name] for name in DRIVE_SAME} == {name: expected[name] for name in DRIVE_SAME}


def test_with_rows_the_daemon_is_asked_less_often_and_the_screen_stays_current(
    recorded: tuple[ServedRobot, LastRow], short_folder: Path
) -> None:
    robot, recorder = recorded
    asked = robot.calls_of("status")
    rights = load_rights(StatusParameters())
    with robot.served(short_folder / "s"):
        stream = RowStream(rows_path(short_folder / "s"), rights, {})
        feed = Feed(short_folder / "s", 0.1)
        assert feed.poll(0.0)  # connects to the status socket and the row stream
        while not feed.rows.live:
            stream.publish([])
            feed._newest_tick(0.0)
            time.sleep(0.01)
        while len(feed.history.strides) < feed.history.status["strides_closed"]:
            feed.poll(0.0)
        asked.clear()
        feed.poll(10.0)
        assert len(asked) == 1
        for tick in range(1, 4):
            stream.publish([(TICK_KIND, recorder.row)])
            feed.poll(10.0 + tick * STATUS_S / 4.0)
            assert feed.history.heard_s == 10.0 + tick * STATUS_S / 4.0
        assert len(asked) == 1
        stream.publish([(TICK_KIND, recorder.row)])
        feed.poll(10.0 + STATUS_S)
        assert len(asked) == 2
        stream.close()
        assert feed.poll(10.01 + STATUS_S) and len(asked) == 3  # without rows each poll asks
        feed.stop()
