"""A CAN bus within one process, without python-can: what one port sends, all others receive, in order.

For tests and for walking in lockstep faster than real time. Frames pass as they are; their payloads were encoded by
the sender and are decoded by the receiver as on any bus. A test may fail a port: set its `state`, let it refuse what
it is to send (`full`), or inject an error frame, which only it sees, as its own controller would report it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from drivers.can.frames import Frame
from drivers.can.port_health import PortHealth

LONGEST_QUEUE = 4096  # a port that nobody reads loses its oldest frames, like a controller's receive buffer


class MockPort(PortHealth):
    """A CanPort."""

    def __init__(self, bus: MockBus) -> None:
        super().__init__()
        self._bus = bus
        self.queue: deque[Frame] = deque(maxlen=LONGEST_QUEUE)
        self.full = False

    def listen_to(self, ids: Iterable[int]) -> None:
        """A test hears everything."""

    def receive(self) -> list[Frame]:
        frames = list(self.queue)
        self.queue.clear()
        return frames

    def send(self, frame: Frame) -> None:
        if self.full:
            self.failed_sends += 1
            self.last_send_error = "No buffer space available"
            return
        for port in self._bus.ports:
            if port is not self:
                port.queue.append(frame)

    def inject_error(self, class_bits: int, data: bytes = bytes(8)) -> None:
        """One of SocketCAN's error frames."""
        self.on_error_frame(class_bits, data)

    def open_beside(self) -> MockPort:
        """Another node on the same bus."""
        return self._bus.open()

    def close(self) -> None:
        if self in self._bus.ports:
            self._bus.ports.remove(self)


class MockBus:
    def __init__(self) -> None:
        self.ports: list[MockPort] = []

    def open(self) -> MockPort:
        port = MockPort(self)
        self.ports.append(port)
        return port
