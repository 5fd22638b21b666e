"""A serial CAN adapter: python-can's slcan and pyserial over a pseudo-terminal with an adapter at its other end."""

from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.records import NEVER_S
from drivers.can.can_port import SlcanPort
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.can.port_health import BusState
from tests.drivers.can.slcan_adapter import OPENING_LINES, SlcanAdapter
from tests.waiting import shortest_wait_s, wait_until

FRAMES = [
    Frame(0x009, bytes(range(8))),
    Frame(0x7FF),
    Frame(0x060, is_remote=True),
    Frame(0x18FEF100, b"\xff", is_extended=True),
    Frame(0x18FEF100, is_remote=True, is_extended=True),
]
LINES = [b"t00980001020304050607\r", b"t7FF0\r", b"r0600\r", b"T18FEF1001FF\r", b"R18FEF1000\r"]


class Bench:
    """The daemon's port, the adapter, and a node on its bus."""

    def __init__(self) -> None:
        bus = MockBus()
        self.node = bus.open()
        self.adapter = SlcanAdapter(bus.open())
        self.port = self.adapter.open_port()
        self.read_bytes = 0
        wait_until(lambda: stepped(self.adapter).heard_lines == OPENING_LINES)
        self.settle()

    def report(self, *frames: Frame) -> None:
        for frame in frames:
            self.node.send(frame)
        self.adapter.step()
        self.settle()

    def write(self, line: bytes) -> None:
        self.adapter.write(line)
        self.settle()

    def send(self, frame: Frame) -> None:
        """Send a frame, and wait until the adapter has passed or refused it and its answer has arrived."""
        heard = self.adapter.heard_lines
        self.port.send(frame)
        wait_until(lambda: stepped(self.adapter).heard_lines > heard)
        self.settle()

    def receive(self) -> list[Frame]:
        frames = [frame._replace(stamp_s=NEVER_S) for frame in self.port.receive()]
        self.read_bytes = self.adapter.written_bytes
        return frames

    def settle(self) -> None:
        """Wait until the pseudo-terminal has delivered all bytes."""
        wait_until(lambda: self.adapter.unread_bytes == self.adapter.written_bytes - self.read_bytes)


def stepped(adapter: SlcanAdapter) -> SlcanAdapter:
    adapter.step()
    return adapter


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.port.close()
    made.adapter.unplug()


def test_python_can_opens_the_adapter_at_its_bit_rate(bench: Bench) -> None:
    assert isinstance(bench.port, SlcanPort)
    assert (bench.adapter.is_open, bench.adapter.bit_rate) == (True, "S8")
    bench.port.close()
    wait_until(lambda: not stepped(bench.adapter).is_open)


def test_frames_pass_in_both_directions(bench: Bench) -> None:
    bench.report(*FRAMES)
    assert bench.receive() == FRAMES
    for frame in FRAMES:
        bench.send(frame)
    assert bench.node.receive() == FRAMES
    assert bench.port.error_frames == 0


def test_a_line_that_arrives_in_pieces_is_one_frame(bench: Bench) -> None:
    bench.write(LINES[0][:7])
    assert bench.receive() == []
    bench.write(LINES[0][7:])
    assert bench.receive() == [FRAMES[0]]


def test_an_empty_read_does_not_wait(bench: Bench) -> None:
    bench.receive()
    assert shortest_wait_s(bench.port.receive) < 0.0005  # pyserial alone waits for 1 ms on any machine


def test_a_frame_that_the_adapter_refuses_is_a_failed_send(bench: Bench) -> None:
    bench.receive()
    assert bench.port.failed_sends == 0  # though python-can closes the channel first, which is not open
    bench.adapter.is_open = False
    bench.send(FRAMES[0])
    assert bench.receive() == []
    assert bench.port.failed_sends == 1
    assert bench.port.last_send_error == "the adapter refused a frame"


def test_malformed_lines_are_counted_and_hide_nothing(bench: Bench) -> None:
    bench.write(b"tG0980001020304050607\rt00\rt0093GG\r\xff\xfe\r" + LINES[1])
    assert bench.receive() == [FRAMES[1]]
    assert bench.port.error_frames == 3  # python-can takes the line without a letter for an answer
    assert bench.port.state is BusState.ACTIVE


@settings(max_examples=20)
@given(noise=st.binary(max_size=200))
def test_no_noise_on_the_line_raises(noise: bytes) -> None:
    bench = Bench()
    bench.write(noise + b"\r")
    for _ in range(4):  # each read ends after MOST_FAILURES_PER_READ
        bench.receive()
    bench.report(FRAMES[0])
    assert bench.receive() == [FRAMES[0]]
    bench.port.close()
    bench.adapter.unplug()


def test_an_adapter_that_takes_no_more_does_not_hold_the_sender_and_gets_whole_lines(bench: Bench) -> None:
    taken: list[Frame] = []  # there may be gaps: the kernel hands on what it has while the sender goes on
    for number in range(3000):
        frame, failed_before = Frame(number % 0x700, number.to_bytes(8, "big")), bench.port.failed_sends
        bench.port.send(frame)
        taken += [frame] * (bench.port.failed_sends == failed_before)
    assert bench.port.failed_sends > 0
    assert bench.port.last_send_error == "Transmit buffer full"
    kept: list[Frame] = []

    def last_arrived() -> bool:
        bench.port.send(FRAMES[1])  # also sends the rest of a line
        bench.adapter.step()
        bench.port.receive()
        kept.extend(bench.node.receive())
        return FRAMES[1] in kept

    wait_until(last_arrived)
    assert len(taken) > 10
    assert kept[: kept.index(FRAMES[1])] == taken


def test_an_unplugged_adapter_is_reported_and_raises_nothing() -> None:
    bench = Bench()
    bench.adapter.unplug()
    bench.port.receive()
    assert bench.port.state is BusState.OFF
    assert bench.port.error_frames == 1
    bench.port.send(FRAMES[0])
    assert bench.port.failed_sends == 1
    assert "Input/output error" in bench.port.last_error and "Input/output error" in bench.port.last_send_error
    bench.port.close()
