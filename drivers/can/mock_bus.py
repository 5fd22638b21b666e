"""A CAN bus within one process, without python-can: all other ports receive what one port sends, in order.

It serves tests, and walks in lockstep that are faster than real time. Frames pass as objects; the sender encodes their
payloads and the receiver decodes them as on any bus. A test can make a port fail: it sets the port's `state`, makes it
refuse frames to send (`full`), or passes an error frame to its `on_error_frame`, as the port's own controller would.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from drivers.can.frames import Frame
from drivers.can.port_health import PortHealth

LONGEST_QUEUE = 4096  # an unread port loses its oldest frames, like a controller's receive buffer


class MockPort(PortHealth):
    """Implements CanPort on a bus within this process."""

    def __init__(self, bus: MockBus) -> None:
        super().__init__()
        self._bus = bus
        self.queue: deque[Frame] = deque(maxlen=LONGEST_QUEUE)
        self.full = False

    def listen_to(self, ids: Iterable[int]) -> None:
        """Does nothing: a test receives all frames."""

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
