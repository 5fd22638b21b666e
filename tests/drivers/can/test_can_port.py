"""A port over python-can: what passes, what is counted, and that nothing waits or raises."""

import time
from collections.abc import Iterator

import can
import pytest

from control.records import NEVER_S
from drivers.can.can_port import MOST_FAILURES_PER_READ, MOST_FRAMES_PER_READ, CanPort, PythonCanPort, open_port
from drivers.can.frames import Frame

FRAMES = [
    Frame(0x009, bytes(range(8))),
    Frame(0x7FF),
    Frame(0x060, is_remote=True),
    Frame(0x18FEF100, b"\xff", is_extended=True),
]


@pytest.fixture
def other() -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel="port-test") as bus:
        yield bus


@pytest.fixture
def port(other: can.BusABC) -> Iterator[CanPort]:
    opened = open_port("virtual", "port-test", {})
    yield opened
    opened.close()


def test_can_fd_passes_where_the_interface_was_opened_for_it_and_is_refused_elsewhere(port: CanPort) -> None:
    frame = Frame(0x18FF0205, bytes(64), is_extended=True, is_fd=True, bit_rate_switch=True)
    port.send(frame)
    assert (port.failed_sends, port.last_send_error) == (1, "the interface was not opened for CAN FD")
    near, far = (
        PythonCanPort(can.Bus(interface="virtual", channel="fd", protocol=can.CanProtocol.CAN_FD)) for _ in range(2)
    )
    near.send(frame)
    assert [each._replace(stamp_s=NEVER_S) for each in far.receive()] == [frame]
    near.close()
    far.close()


class FakeBus(can.BusABC):
    """Receives the same message for ever, or fails in both directions."""

    def __init__(self, problem: can.CanError | None = None) -> None:
        super().__init__(channel="fake")
        self.problem = problem
        self.timeouts: list[float | None] = []
        self.answers = 10**6

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self.timeouts.append(timeout)
        if self.problem:
            raise self.problem
        self.answers -= 1
        return can.Message(arbitration_id=9, is_extended_id=False) if self.answers >= 0 else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.problem:
            raise self.problem


def as_message(frame: Frame) -> can.Message:
    return can.Message(
        arbitration_id=frame.arbitration_id,
        data=frame.data,
        is_extended_id=frame.is_extended,
        is_remote_frame=frame.is_remote,
        is_error_frame=frame.is_error,
    )


def unstamped(port: CanPort) -> list[Frame]:
    return [frame._replace(stamp_s=NEVER_S) for frame in port.receive()]


def test_a_frame_says_when_it_was_on_the_bus(port: CanPort, other: can.BusABC) -> None:
    before_s = time.monotonic()
    other.send(as_message(FRAMES[0]))
    after_s = time.monotonic()
    time.sleep(0.02)
    (frame,) = port.receive()
    assert before_s - 0.005 < frame.stamp_s < after_s + 0.005  # the clock on the wall is read a moment later


def test_frames_pass_unchanged_and_in_order_in_both_directions(port: CanPort, other: can.BusABC) -> None:
    for frame in FRAMES:
        other.send(as_message(frame))
        port.send(frame)
    assert unstamped(port) == FRAMES
    for frame in FRAMES:
        message = other.recv(0.0)
        assert message is not None
        assert message.equals(as_message(frame), timestamp_delta=None, check_channel=False, check_direction=False)
    assert other.recv(0.0) is None


def test_nothing_is_waited_for() -> None:
    bus = FakeBus()
    bus.answers = 1
    assert len(PythonCanPort(bus).receive()) == 1
    assert bus.timeouts == [0.0, 0.0]


def test_what_one_read_leaves_the_next_one_takes(port: CanPort, other: can.BusABC) -> None:
    for number in range(MOST_FRAMES_PER_READ + 5):
        other.send(as_message(Frame(number % 1000)))
    assert len(port.receive()) == MOST_FRAMES_PER_READ
    left = [(MOST_FRAMES_PER_READ + number) % 1000 for number in range(5)]
    assert [frame.arbitration_id for frame in port.receive()] == left


def test_a_failed_receive_is_counted_and_does_not_raise() -> None:
    port = PythonCanPort(FakeBus(can.CanOperationError("garbage")))
    assert port.receive() == []
    assert port.error_frames == MOST_FAILURES_PER_READ
    assert "garbage" in port.last_error


def test_garbage_does_not_hide_the_good_frames_after_it() -> None:
    class Noisy(FakeBus):
        def recv(self, timeout: float | None = None) -> can.Message | None:
            self.answers -= 1
            if self.answers % 10 == 0:
                return can.Message(arbitration_id=9, is_extended_id=False)
            if self.answers < 10**6 - 30:
                return None
            raise ValueError("invalid literal for int() with base 16: 'G'")

    port = PythonCanPort(Noisy())
    assert len(port.receive()) == 3
    assert port.error_frames == 27


def test_options_reach_the_interface() -> None:
    port = open_port("virtual", "own-messages", {"receive_own_messages": True})
    port.send(Frame(1))
    assert unstamped(port) == [Frame(1)]
    port.close()
