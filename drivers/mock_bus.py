"""A CAN bus within one process, without python-can: what one port sends, all others receive, in order.

For tests and for walking in lockstep faster than real time. Frames pass as they are; their payloads were encoded by
the sender and are decoded by the receiver as on any bus.
"""

from __future__ import annotations

from collections import deque

from drivers.can_port import BusState
from drivers.frames import Frame

LONGEST_QUEUE = 4096  # a port that nobody reads loses its oldest frames, like a controller's receive buffer


class MockPort:
    """A CanPort."""

    def __init__(self, bus: MockBus) -> None:
        self._bus = bus
        self.queue: deque[Frame] = deque(maxlen=LONGEST_QUEUE)
        self.state = BusState.ACTIVE
        self.failed_sends = 0
        self.error_frames = 0
        self.last_send_error = ""

    def receive(self) -> list[Frame]:
        frames = list(self.queue)
        self.queue.clear()
        return frames

    def send(self, frame: Frame) -> None:
        for port in self._bus.ports:
            if port is not self:
                port.queue.append(frame)

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
