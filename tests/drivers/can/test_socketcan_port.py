"""Both ports on SocketCAN, ours and python-can's, over python-can's bus on one end of a datagram pair, into whose
other end the kernel's bytes are written. The kernel's ancillary data are synthetic: these sockets lose no frames.
"""

import errno
import os
import socket
import struct
from collections.abc import Iterator
from typing import Any

import pytest
from can.interfaces.socketcan import constants
from hypothesis import given, settings
from hypothesis import strategies as st

from control.records import JOINTS, NEVER_S
from drivers.can.can_port import CanPort, PythonCanPort, open_port
from drivers.can.frames import Frame, encode_frame
from drivers.can.port_health import BusState
from drivers.can.socketcan_port import SO_RXQ_OVFL, SO_TIMESTAMPNS, SocketcanPort
from drivers.drive_types import make_drives
from drivers.drives import Drives
from drivers.moteus import codec as moteus
from drivers.odrive.codec import arbitration_id
from drivers.odrive05 import codec as codec05
from firmware_host.configuration.configuration import Configuration
from tests.drivers.can.test_can_port import stamps_are_right
from verification.wiring import CanSocket, in_place_of_can, open_bus, open_pair

ENCODER = Frame(0x009, bytes(range(8)))
WARNING = Frame(0x004, bytes.fromhex("00 08 00 00 00 00 00 00"), is_error=True)
OFF = Frame(0x040, bytes(8), is_error=True)
RESTARTED = Frame(0x100, bytes(8), is_error=True)
GONE = (errno.ENETDOWN, errno.ENODEV, errno.ENXIO)


class KernelSocket(CanSocket):
    """A socket that returns or raises what the test sets in place of the next frames that arrive."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.reported: list[Any] = []
        self.send_problem: OSError | None = None
        self.socket_options: dict[int, Any] = {}

    def setsockopt(self, level: int, number: int, value: Any, *more: Any) -> None:
        super().setsockopt(level, number, value, *more)
        self.socket_options[number] = value

    def recvmsg(self, *arguments: Any) -> Any:
        arrived = super().recvmsg(*arguments)
        reported = self.reported.pop(0) if self.reported else arrived
        if isinstance(reported, OSError):
            raise reported
        return reported

    def send(self, data: Any, *flags: Any) -> int:
        if self.send_problem is not None:
            raise self.send_problem
        return super().send(data, *flags)


class Bench:
    """A port, the socket below it, and the kernel's end of that socket."""

    def __init__(self, kind: type[SocketcanPort] | type[PythonCanPort] = SocketcanPort) -> None:
        self.kernel, near = open_pair(KernelSocket)
        assert isinstance(near, KernelSocket)
        self.socket = near
        self.port: SocketcanPort | PythonCanPort = kind(open_bus(near))

    def report(self, *frames: Frame) -> None:
        for frame in frames:
            self.kernel.send(encode_frame(frame))

    def replace(self, *reported: Any) -> None:
        """Let frames arrive for which the socket returns or raises this."""
        self.socket.reported += reported
        self.report(*[ENCODER] * len(reported))

    def receive(self) -> list[Frame]:
        return [frame._replace(stamp_s=NEVER_S) for frame in self.port.receive()]

    def close(self) -> None:
        self.port.close()
        self.kernel.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.close()


@pytest.fixture(params=[SocketcanPort, PythonCanPort])
def either(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.param)
    yield made
    made.close()


def message(frame: Frame, marks: int = 0, lost: int | None = None) -> tuple[bytes, list[Any], int, None]:
    """Return the result of `recvmsg` for a frame; the kernel adds its count of lost frames from the first loss on."""
    ancillary = [(socket.SOL_SOCKET, SO_TIMESTAMPNS, struct.pack("@ll", 1_700_000_000, 250_000_000))]
    if lost is not None:
        ancillary.append((socket.SOL_SOCKET, SO_RXQ_OVFL, struct.pack("@I", lost)))
    return encode_frame(frame), ancillary, marks, None


def test_only_socketcan_goes_by_the_fast_path() -> None:
    far, near = open_pair()
    with in_place_of_can(near):
        fast, other = open_port("socketcan", "can0", {}), open_port("virtual", "not-can0", {})
    assert isinstance(fast, SocketcanPort)
    assert isinstance(other, PythonCanPort)
    close_all(fast, other, far)


def test_a_frame_says_when_it_was_on_the_bus(either: Bench) -> None:
    assert stamps_are_right(lambda: either.report(ENCODER), either.port)


def test_error_frames_make_the_state_and_are_not_passed_on(either: Bench) -> None:
    port, seen = either.port, []
    for frames in ((ENCODER, WARNING, ENCODER), (OFF,), (RESTARTED,)):
        either.report(*frames)
        seen.append((len(either.receive()), port.state, port.error_frames, port.last_error))
    assert seen == [
        (2, BusState.WARNING, 1, "transmit warning"),
        (0, BusState.OFF, 2, "bus-off"),
        (0, BusState.ACTIVE, 3, "controller restarted"),
    ]


@pytest.mark.parametrize(
    ("kernel_counts", "lost_frames"),
    [((None, 3, 3), 3), ((3, 10, None), 10), ((2**32 - 2, 1), 2**32 + 1)],
    ids=["once", "grows", "wraps"],
)
def test_frames_that_found_the_queue_full_are_counted_once(
    bench: Bench, kernel_counts: tuple[int | None, ...], lost_frames: int
) -> None:
    assert bench.socket.socket_options[SO_RXQ_OVFL] == 1
    bench.replace(*(message(ENCODER, lost=lost) for lost in kernel_counts))
    assert len(bench.port.receive()) == len(kernel_counts)
    assert bench.port.lost_frames == lost_frames


def test_an_error_frame_carries_the_count_of_lost_frames_and_a_frame_may_lack_its_stamp(bench: Bench) -> None:
    bench.replace(message(OFF, lost=5), (encode_frame(ENCODER), [], 0, None))
    assert bench.port.receive() == [ENCODER._replace(stamp_s=NEVER_S)]
    assert (bench.port.lost_frames, bench.port.error_frames) == (5, 1)


def test_only_the_frame_of_a_peer_ends_bus_off_and_it_ends_no_warning(either: Bench) -> None:
    local, states = message(ENCODER, marks=socket.MSG_DONTROUTE), []
    for reported in (message(WARNING), message(ENCODER), message(OFF), local, message(ENCODER)):
        either.replace(reported)
        either.port.receive()
        states.append(either.port.state)
    assert states == [BusState.WARNING, BusState.WARNING, BusState.OFF, BusState.OFF, BusState.ACTIVE]


@pytest.mark.parametrize("number", [errno.ENOBUFS, errno.EAGAIN, *GONE])
def test_a_failed_send_is_counted_at_once_and_shows_whether_the_interface_is_gone(either: Bench, number: int) -> None:
    either.socket.send_problem = OSError(number, os.strerror(number))
    either.port.send(ENCODER)
    assert (either.port.failed_sends, either.port.state) == (1, BusState.OFF if number in GONE else BusState.ACTIVE)
    text = "Transmit buffer full" if number == errno.EAGAIN else os.strerror(number)
    assert text in either.port.last_send_error
    either.socket.send_problem = None
    either.port.send(ENCODER)
    assert (either.port.failed_sends, len(either.kernel.recv(64))) == (1, 16)


def test_sending_into_a_full_queue_does_not_wait(either: Bench) -> None:
    for _ in range(2000):  # unread, the socket stores a few hundred
        either.port.send(ENCODER)
    assert either.port.failed_sends > 0 and either.port.last_send_error == "Transmit buffer full"


@pytest.mark.parametrize("frame", [Frame(0x800), Frame(0x009, bytes(9)), Frame(-1)])
def test_a_frame_that_has_no_bytes_is_a_failed_send(bench: Bench, frame: Frame) -> None:
    bench.port.send(frame)
    assert bench.port.failed_sends == 1
    bench.kernel.setblocking(False)
    with pytest.raises(BlockingIOError):
        bench.kernel.recv(64)


@pytest.mark.parametrize("number", GONE)
def test_an_interface_that_went_down_is_tried_once_a_read_and_is_back_with_the_first_frame(
    either: Bench, number: int
) -> None:
    either.replace(OSError(number, os.strerror(number)))
    either.report(ENCODER)
    assert either.receive() == []
    assert (either.port.state, either.port.error_frames) == (BusState.OFF, 1)
    assert os.strerror(number) in either.port.last_error
    assert either.receive() == [ENCODER]
    assert either.port.state is BusState.ACTIVE


@pytest.mark.parametrize(
    "garbage",
    [bytes(size) for size in (0, 1, 8, 15, 17, 64, 73, 2000)]
    + [struct.pack("<IB11x", 9, length) for length in (9, 255)],
)
def test_garbage_of_another_size_is_counted_and_hides_nothing(bench: Bench, garbage: bytes) -> None:
    bench.kernel.send(garbage)
    bench.report(ENCODER)
    assert bench.receive() == [ENCODER]
    assert (bench.port.error_frames, bench.port.state) == (1, BusState.ACTIVE)
    assert bench.port.last_error


def test_can_fd_frames_are_received_and_sent(bench: Bench) -> None:
    frame = Frame(0x18FF0205, bytes(range(64)), is_extended=True, is_fd=True, bit_rate_switch=True)
    bench.report(frame)
    assert bench.receive() == [frame]
    bench.port.send(frame)
    assert bench.kernel.recv(100) == encode_frame(frame)


def passes(filters: bytes, word: int) -> bool:
    """Apply the rule of CAN_RAW_FILTER (linux/can.h): received & mask == id & mask, of any one filter."""
    pairs = struct.iter_unpack("=II", filters)
    return any(word & mask == identifier & mask for identifier, mask in pairs)


def test_the_kernel_is_asked_for_what_the_drives_send_and_for_all_error_frames(configuration: Configuration) -> None:
    benches = {name: Bench() for name in configuration.bus}
    ports = {name: bench.port for name, bench in benches.items()}
    drives = make_drives(configuration.drive, ports, configuration.limits)
    assert isinstance(drives, Drives)
    for name, bench in benches.items():
        filters = bench.socket.can_options[constants.CAN_RAW_FILTER]
        wanted = {
            identifier
            for joint, axis in zip(JOINTS, drives.axes, strict=True)
            if configuration.drive[joint].bus == name
            for identifier in axis.receivers
        }
        reports, commands = 9, 16  # of each drive, without emergency stops
        assert len(wanted) == 2 * (reports + commands)
        nodes = [drive.node_id for drive in configuration.drive.values() if drive.bus == name]
        wanted |= {moteus.reply_id(node_id) for node_id in nodes}  # the ids of a moteus's answers
        wanted |= {node_id + 16 for node_id in nodes}  # the ids of a Damiao's answers
        wanted |= {arbitration_id(node_id, codec05.GET_ENCODER_COUNT) for node_id in nodes}  # of ODrive firmware 0.5
        assert {word for word in range(0x800) if passes(filters, word)} == wanted
        for identifier in wanted:
            assert not passes(filters, identifier | constants.CAN_RTR_FLAG)
            assert not passes(filters, identifier | constants.CAN_EFF_FLAG)
        assert bench.socket.can_options[constants.CAN_RAW_ERR_FILTER] == 0x1FFFFFFF
        bench.close()


def test_a_kernel_that_refuses_filters_only_lets_unknown_ids_through(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: CanSocket, level: int, number: int, value: Any, *more: Any) -> None:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    monkeypatch.setattr(KernelSocket, "setsockopt", refuse)
    bench.port.listen_to([0x009])
    bench.report(ENCODER, Frame(0x123))
    assert bench.receive() == [ENCODER, Frame(0x123)]


def close_all(*ends: Any) -> None:
    for end in ends:
        end.close()


ERROR_WORDS = st.integers(0, 0x7FF).map(lambda bits: bits | constants.CAN_ERR_FLAG)  # python-can keeps 11 class bits
WORDS = st.one_of(
    st.integers(0, 0x7FF),
    ERROR_WORDS,
    st.integers(2**30, 2**32 - 1).filter(lambda word: not word & constants.CAN_ERR_FLAG),
)
ANY_FRAME = st.builds(struct.Struct("<IB11s").pack, WORDS, st.integers(0, 8), st.binary(min_size=11, max_size=11))


@settings(max_examples=25)
@given(reads=st.lists(st.lists(ANY_FRAME, max_size=8), max_size=4))
def test_both_paths_decode_any_bytes_of_the_kernel_alike(reads: list[list[bytes]]) -> None:
    (first, near), (second, second_near) = open_pair(), open_pair()
    own, python_can = SocketcanPort(open_bus(near)), PythonCanPort(open_bus(second_near))
    for read in reads:
        for encoded in read:
            first.send(encoded)
            second.send(encoded)
        seen = [[frame._replace(stamp_s=NEVER_S) for frame in port.receive()] for port in (own, python_can)]
        assert seen[0] == seen[1]
        assert health(own) == health(python_can)
    close_all(own, python_can, first, second)


def health(port: CanPort) -> tuple[BusState, int, str]:
    return port.state, port.error_frames, port.last_error
