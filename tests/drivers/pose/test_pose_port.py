"""Poses over a socket: the newest wins, old ones expire, garbage is counted."""

import socket
import struct
from collections.abc import Iterator
from math import isnan
from pathlib import Path

import pytest

from control.records import NEVER_S
from drivers.pose.pose_port import STALE_S, PosePort, PoseSender, PoseSourceError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "pose.sock"


@pytest.fixture
def port(path: Path) -> Iterator[PosePort]:
    opened = PosePort(path)
    yield opened
    opened.close()


@pytest.fixture
def sender(path: Path) -> Iterator[PoseSender]:
    opened = PoseSender(path)
    yield opened
    opened.close()


def send_bytes(path: Path, data: bytes) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as source:
        source.sendto(data, str(path))


def test_the_newest_pose_wins_and_is_stamped_when_it_is_read(port: PosePort, sender: PoseSender) -> None:
    sender.send(100.0, 0.1)
    sender.send(100.1, 0.12)
    assert port.read(7.0) == (7.0, 0.12)


def test_a_jump_leaves_a_read_without_a_pose(port: PosePort, sender: PoseSender) -> None:
    """Strokes would count it as motion of the body."""
    for source_s, x_m in enumerate((0.1, 0.14, 0.15)):
        sender.send(source_s, x_m)
        assert isnan(port.read(1.0 + 0.01 * source_s).x_m) == (x_m == 0.14)


def test_a_bridge_of_an_operator_may_send_and_no_other_user(port: PosePort, path: Path) -> None:
    assert path.stat().st_mode & 0o777 == 0o660


def test_a_pose_has_these_bytes(port: PosePort, path: Path) -> None:
    send_bytes(path, bytes.fromhex("0000000000005940 000000000000d03f"))  # 100.0 s, 0.25 m
    assert port.read(1.0).x_m == 0.25


def test_a_pose_ends_when_it_is_stale(port: PosePort, sender: PoseSender) -> None:
    sender.send(0.0, 0.1)
    assert port.read(1.0).x_m == 0.1
    assert port.read(0.99 + STALE_S).x_m == 0.1
    assert port.read(1.01 + STALE_S).stamp_s == NEVER_S


@pytest.mark.parametrize("data", [b"", bytes(15), bytes(17), bytes(200), struct.pack("<dd", 1.0, float("inf"))])
def test_garbage_is_counted_and_the_last_pose_stays(
    port: PosePort, sender: PoseSender, path: Path, data: bytes
) -> None:
    sender.send(0.0, 0.1)
    send_bytes(path, data)
    assert port.read(1.0) == (1.0, 0.1)
    assert port.malformed_messages == 1


def test_a_sender_without_a_listener_does_not_raise(path: Path) -> None:
    sender = PoseSender(path)
    sender.send(0.0, 0.1)  # there is no socket yet
    port = PosePort(path)
    sender.send(0.0, 0.2)
    assert port.read(1.0).x_m == 0.2
    port.close()
    assert not path.exists()
    sender.send(0.0, 0.3)
    sender.close()


def test_a_sender_whose_listener_does_not_read_does_not_wait(port: PosePort, sender: PoseSender) -> None:
    for number in range(1000):
        sender.send(0.0, 1e-6 * number)
    assert 0.0 <= port.read(1.0).x_m < 999e-6  # the first few: a full socket drops what comes after


def test_a_socket_left_by_a_killed_process_is_replaced(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as left:
        left.bind(str(path))
    port = PosePort(path)
    send_bytes(path, struct.pack("<dd", 0.0, 0.5))
    assert port.read(1.0).x_m == 0.5
    port.close()


def test_a_socket_that_cannot_be_opened_is_reported_in_one_message(tmp_path: Path) -> None:
    with pytest.raises(PoseSourceError, match="^the pose socket .*/missing/pose cannot be opened: No such file"):
        PosePort(tmp_path / "missing" / "pose")


def test_the_report_says_whether_poses_arrive(port: PosePort, sender: PoseSender, path: Path) -> None:
    port.read(0.0)
    assert port.report().trouble == f"no pose arrives at {path} yet."
    sender.send(0.0, 0.1)
    send_bytes(path, b"short")
    port.read(1.0)
    assert port.report()[1:5] == (1, 1, 0, "")
    port.read(1.0 + 2.0 * STALE_S)
    assert "any more" in port.report().trouble and port.report().what_to_do


def test_the_socket_of_another_daemon_is_not_taken_away(port: PosePort, sender: PoseSender, path: Path) -> None:
    with pytest.raises(PoseSourceError, match="Address already in use"):
        PosePort(path)
    sender.send(0.0, 0.1)
    assert port.read(1.0).x_m == 0.1
