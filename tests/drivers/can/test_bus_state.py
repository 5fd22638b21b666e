"""The state of a port: over python-can's socketcan bus on a pair of sockets, by both paths, and over mock ports.

These tests need no CAN: the socket that python-can would open is replaced by one end of a datagram pair, and the
kernel's frames are written into the other end as the 16 bytes of `struct can_frame`.
"""

from __future__ import annotations

import errno
import logging
import socket
from collections.abc import Iterator

import can
import pytest
from can.interfaces.socketcan import socketcan

from drivers.can.can_port import CanPort, PythonCanPort, open_port
from drivers.can.frames import Frame, encode_frame
from drivers.can.port_health import BusState

ENCODER = Frame(0x009, bytes(8))
WARNING = Frame(0x004, bytes.fromhex("00 08 00 00 00 00 00 00"), is_error=True)
OFF = Frame(0x040, bytes(8), is_error=True)
RESTARTED = Frame(0x100, bytes(8), is_error=True)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """Return the far end of the socket of the next bus that python-can opens."""
    far, near = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    monkeypatch.setattr(socketcan, "create_socket", lambda: near)
    monkeypatch.setattr(socketcan, "bind_socket", lambda *arguments: None)
    yield far
    far.close()
    near.close()


@pytest.fixture(params=["its own frames", "python-can's messages"])
def port(kernel: socket.socket, request: pytest.FixtureRequest) -> Iterator[CanPort]:
    opened: CanPort
    if request.param == "its own frames":
        opened = open_port("socketcan", "can0", {})
    else:
        opened = PythonCanPort(can.Bus(interface="socketcan", channel="can0"))
    yield opened
    opened.close()


def report(kernel: socket.socket, *frames: Frame) -> None:
    for frame in frames:
        kernel.send(encode_frame(frame))


def ids(port: CanPort) -> list[int]:
    return [frame.arbitration_id for frame in port.receive()]


def test_error_frames_make_the_state_and_are_not_passed_on(port: CanPort, kernel: socket.socket) -> None:
    assert port.state is BusState.ACTIVE
    report(kernel, ENCODER, WARNING, ENCODER)
    assert ids(port) == [0x009, 0x009]
    assert (port.state, port.error_frames, port.last_error) == (BusState.WARNING, 1, "transmit warning")
    report(kernel, OFF)
    assert ids(port) == []
    assert (port.state, port.error_frames, port.last_error) == (BusState.OFF, 2, "bus-off")
    report(kernel, RESTARTED)
    port.receive()
    assert (port.state, port.error_frames) == (BusState.ACTIVE, 3)


def test_a_peer_s_frame_ends_bus_off_but_no_warning(port: CanPort, kernel: socket.socket) -> None:
    states = []
    for frames in ((WARNING, ENCODER), (ENCODER, OFF), (ENCODER,)):
        report(kernel, *frames)
        port.receive()
        states.append(port.state)
    assert states == [BusState.WARNING, BusState.OFF, BusState.ACTIVE]


def test_a_frame_of_another_local_process_does_not_end_bus_off() -> None:
    class Local(can.BusABC):
        reported = [
            can.Message(arbitration_id=0x040, is_error_frame=True, is_extended_id=False, data=bytes(8)),
            can.Message(arbitration_id=0x009, is_rx=False, is_extended_id=False),
        ]

        def __init__(self) -> None:
            super().__init__(channel="local")

        def recv(self, timeout: float | None = None) -> can.Message | None:
            return self.reported.pop(0) if self.reported else None

        def send(self, msg: can.Message, timeout: float | None = None) -> None: ...

    port = PythonCanPort(Local())
    assert len(port.receive()) == 1
    assert port.state is BusState.OFF


class Gone(can.BusABC):
    """An interface that went away, which counts how often it is read."""

    def __init__(self, problem: Exception) -> None:
        super().__init__(channel="gone")
        self.problem, self.asked = problem, 0

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self.asked += 1
        raise self.problem

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise self.problem


@pytest.mark.parametrize("number", [errno.ENETDOWN, errno.ENODEV, errno.ENXIO])
@pytest.mark.parametrize("kind", [OSError, can.CanOperationError])
def test_an_interface_that_is_gone_is_reported_and_tried_once_a_read(number: int, kind: type[Exception]) -> None:
    problem = OSError(number, "gone") if kind is OSError else can.CanOperationError("gone", number)
    bus = Gone(problem)
    port = PythonCanPort(bus)
    assert port.receive() == []
    assert (bus.asked, port.error_frames, port.state) == (1, 1, BusState.OFF)
    assert "gone" in port.last_error


def test_a_send_into_a_missing_interface_changes_the_state_and_a_full_queue_does_not() -> None:
    full = PythonCanPort(Gone(can.CanOperationError("No buffer space available", errno.ENOBUFS)))
    full.send(ENCODER)
    assert (full.failed_sends, full.state) == (1, BusState.ACTIVE)
    gone = PythonCanPort(Gone(can.CanOperationError("Network is down", errno.ENETDOWN)))
    gone.send(ENCODER)
    assert (gone.failed_sends, gone.state, gone.last_send_error) == (
        1,
        BusState.OFF,
        "Network is down [Error Code 100]",
    )


def test_sending_makes_the_kernel_s_bytes_and_no_entry_in_any_log(
    port: CanPort, kernel: socket.socket, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG):
        port.send(Frame(0x04E, bytes.fromhex("0000803e")))
    sent = kernel.recv(64)
    assert (sent[:5], sent[8:]) == (bytes.fromhex("4e000000 04"), bytes.fromhex("0000803e 00000000"))
    assert [record for record in caplog.records if record.name.startswith("can")] == []


def test_sending_into_a_full_queue_does_not_wait(port: CanPort) -> None:
    for _ in range(2000):  # unread, the socket stores a few hundred
        port.send(ENCODER)
    assert port.failed_sends > 0
    assert port.last_send_error == "Transmit buffer full"
