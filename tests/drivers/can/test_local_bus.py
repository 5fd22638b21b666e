"""The local bus: which node hears which, while nodes join, leave, stop and die."""

import os
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from drivers.can.frames import Frame, encode_frame
from drivers.can.local_bus import BUSES, LocalBus, LocalLink
from drivers.can.run_folder import NAME

Open = Callable[[], LocalBus]


@pytest.fixture
def open_bus(short_folder: Path) -> Iterator[Open]:
    opened: list[LocalBus] = []

    def open_one() -> LocalBus:
        opened.append(LocalBus(short_folder))
        return opened[-1]

    yield open_one
    for bus in opened:
        bus.shutdown()


IDLE_NODE = """
from sys import argv, stdin
from drivers.can.local_bus import LocalBus
bus = LocalBus(argv[1])
print("ready", flush=True)
stdin.read()
"""


def make_message(number: int) -> can.Message:
    return can.Message(arbitration_id=0x123, data=number.to_bytes(8, "little"), is_extended_id=False)


def drain(bus: can.BusABC) -> list[int]:
    numbers = []
    while message := bus.recv(0):
        numbers.append(int.from_bytes(message.data, "little"))
    return numbers


def test_frames_arrive_in_order_and_no_node_receives_its_own(open_bus: Open) -> None:
    sender, receiver = open_bus(), open_bus()
    for number in range(100):
        sender.send(make_message(number))
    assert drain(receiver) == list(range(100))
    assert drain(sender) == []


def test_nodes_that_join_at_once_are_all_connected(short_folder: Path) -> None:
    buses: list[LocalBus] = []
    threads = [threading.Thread(target=lambda: buses.append(LocalBus(short_folder))) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for number, bus in enumerate(buses):
        bus.send(make_message(number))
    for number, bus in enumerate(buses):
        assert sorted(drain(bus)) == [other for other in range(12) if other != number]
        bus.shutdown()


def test_frames_that_a_node_sent_before_it_left_still_arrive(open_bus: Open) -> None:
    stayer, leaver = open_bus(), open_bus()
    stayer.send(make_message(7))  # never read: the kernel answers its sender with a reset
    leaver.send(make_message(8))
    leaver.shutdown()
    stayer.send(make_message(9))
    assert drain(stayer) == [8]
    assert stayer.lost_frames == 0


def test_a_killed_node_does_no_harm_and_its_socket_is_cleaned(open_bus: Open, short_folder: Path) -> None:
    sender, receiver = open_bus(), open_bus()
    command = [sys.executable, "-c", IDLE_NODE, str(short_folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as victim:
        assert victim.stdout is not None and victim.stdout.readline() == "ready\n"
        sender.send(make_message(1))
        victim.kill()
    stale = list(short_folder.glob(f"{victim.pid}-*.node"))
    sender.send(make_message(2))
    late = open_bus()
    sender.send(make_message(3))
    assert drain(receiver) == [1, 2, 3]
    assert drain(late) == [3]
    assert sender.lost_frames == 0
    assert len(stale) == 1
    assert not stale[0].exists()


def test_a_file_that_is_no_socket_is_left_alone(open_bus: Open, short_folder: Path) -> None:
    (short_folder / "notes.node").write_text("mine")
    open_bus()
    assert (short_folder / "notes.node").read_text() == "mine"


def test_a_node_that_never_reads_loses_the_newest_frames_only(open_bus: Open) -> None:
    sender, idle = open_bus(), open_bus()
    for kept in range(100_000):
        sender.send(make_message(kept))
        if sender.lost_frames:
            break
    assert kept >= 200  # with the kernel's smallest usual buffer
    assert drain(idle) == list(range(kept))
    sender.send(make_message(kept + 1))
    assert drain(idle) == [kept + 1]
    assert sender.lost_frames == 1


def test_a_first_receive_hears_a_newcomer_that_sent_before(open_bus: Open) -> None:
    first, newcomer = open_bus(), open_bus()
    newcomer.send(make_message(1))
    assert drain(first) == [1]


@pytest.mark.parametrize("size", [1, 5, 16, 17, 31])
def test_frames_cut_anywhere_by_the_stream_are_put_together(short_folder: Path, size: int) -> None:
    frames = [encode_frame(Frame(number, bytes([number]), is_fd=number % 3 == 2)) for number in range(20)]
    stream = b"".join(frames)
    link = LocalLink(short_folder)
    with socket.socket(socket.AF_UNIX) as raw:
        raw.connect(str(next(short_folder.glob("*.node"))))
        received = []
        for start in range(0, len(stream), size):
            raw.sendall(stream[start : start + size])
            for _ in range(4):  # the first call only accepts
                if data := link.receive():
                    received.append(data)
        assert received == frames
    link.close()


def test_garbage_is_reported_as_a_can_error(open_bus: Open, short_folder: Path) -> None:
    bus, link = open_bus(), LocalLink(short_folder)
    link.send(b"\xff" * 5 + bytes(11))
    with pytest.raises(can.CanOperationError, match="255"):
        bus.recv(0.1)
    link.close()


def test_a_frame_arrives_whole_with_the_time_of_its_reading(open_bus: Open) -> None:
    sender, receiver = open_bus(), open_bus()
    message = can.Message(arbitration_id=0x18FF0205, data=bytes(range(64)), is_fd=True, bitrate_switch=True)
    before_s = time.time()
    sender.send(message)
    received = receiver.recv(0)
    assert received is not None
    assert received.equals(message, timestamp_delta=None, check_channel=False)
    assert before_s <= received.timestamp <= time.time()


def test_python_can_opens_it_by_name_with_filters(short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(short_folder))
    wanted = [can.typechecking.CanFilter(can_id=0x123, can_mask=0x7FF)]
    with (
        can.Bus(interface="mudskipper_local", channel="demo", can_filters=wanted) as receiver,
        can.Bus(interface="mudskipper_local", channel="demo") as sender,
    ):
        sender.send(can.Message(arbitration_id=0x124, is_extended_id=False))
        sender.send(make_message(1))
        assert drain(receiver) == [1]
    folder = short_folder / NAME / BUSES / "demo"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert folder.parent.stat().st_mode & 0o777 == 0o700
    assert [path.name for path in folder.iterdir()] == ["lock"]


def test_a_receive_waits_for_its_whole_timeout_despite_other_events(open_bus: Open) -> None:
    bus, start_s = open_bus(), time.monotonic()
    open_bus()  # wakes the first one, without a frame
    assert bus.recv(0.05) is None
    assert time.monotonic() - start_s > 0.049


def test_select_sees_frames_that_were_read_but_not_yet_taken(open_bus: Open) -> None:
    sender, receiver = open_bus(), open_bus()
    receiver.recv(0)
    assert select.select([receiver], [], [], 0)[0] == []
    for number in range(3):
        sender.send(make_message(number))
    for _ in range(3):
        assert select.select([receiver], [], [], 0)[0] == [receiver]
        assert receiver.recv(0)
    assert select.select([receiver], [], [], 0)[0] == []


def test_shutting_down_twice_is_fine_and_leaves_no_descriptor_open(short_folder: Path) -> None:
    with LocalBus(short_folder) as bus:  # python-can itself opens a few files at first
        pass
    before = sorted(os.listdir("/proc/self/fd"))
    first, second = LocalBus(short_folder), LocalBus(short_folder)
    first.send(make_message(1))
    assert drain(second) == [1]
    for bus in (first, second, first, second):
        bus.shutdown()
    assert sorted(os.listdir("/proc/self/fd")) == before
    assert [path.name for path in short_folder.iterdir()] == ["lock"]


def test_a_wrong_channel_and_own_messages_are_refused(short_folder: Path) -> None:
    for channel in ("", ".", "..", "a/b", "../demo", "demo/"):
        with pytest.raises(can.CanInitializationError, match="plain name"):
            LocalBus(channel)
    with pytest.raises(can.CanInitializationError, match="107 bytes"):
        LocalBus(short_folder / ("x" * 100))
    with pytest.raises(can.CanInitializationError, match="own messages"):
        LocalBus(short_folder, receive_own_messages=True)
