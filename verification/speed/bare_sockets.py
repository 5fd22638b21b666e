"""The least that a tick over sockets can cost: reading and sending as many frames as it does, and nothing else.

The frames are counted in a walk over the `mock` bus. They then pass, as datagrams of a CAN frame's size, through a
pair of sockets for each bus, by `recv` and `send` alone: no decoding, no read that finds nothing, no control.
"""

import socket
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import NullRecorder
from verification.walks.timed_walk import BLOCK_TICKS, TimedWalk
from verification.walks.wirings import Wiring, make_wiring

FRAME_BYTES = 16  # of a classic CAN frame, as the kernel passes it on


class BusFrames(NamedTuple):
    """Frames of one bus in a tick, on average."""

    received: float
    sent: float


class _CountedPort:
    """Passes everything on to a port, and counts its frames."""

    def __init__(self, port: CanPort) -> None:
        self._port = port
        self.received = self.sent = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    def receive(self) -> Any:
        frames = self._port.receive()
        self.received += len(frames)
        return frames

    def send(self, frame: Frame) -> None:
        self.sent += 1
        self._port.send(frame)


def count_frames(configuration: Configuration, folder: Path) -> list[BusFrames]:
    """Returns the frames of each bus while the robot walks."""
    wiring = make_wiring("mock", configuration.bus, folder)
    ports: dict[str, Any] = {name: _CountedPort(port) for name, port in wiring.loop.items()}
    walk = TimedWalk(configuration, Wiring(wiring.robot, ports), NullRecorder())
    walk.warm_up()
    before = {name: (port.received, port.sent) for name, port in ports.items()}
    for _ in range(BLOCK_TICKS):
        walk.tick()
    return [
        BusFrames((port.received - before[name][0]) / BLOCK_TICKS, (port.sent - before[name][1]) / BLOCK_TICKS)
        for name, port in ports.items()
    ]


class BareSockets:
    """Owns a pair of sockets for each bus, and the durations of reading and sending the frames of a tick."""

    def __init__(self, buses: list[BusFrames]) -> None:
        self.durations_s: list[float] = []
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in buses]
        self._buses = [(*pair, round(bus.received), round(bus.sent)) for pair, bus in zip(pairs, buses, strict=True)]
        self._frame = bytes(FRAME_BYTES)

    def run_block(self) -> None:
        for _ in range(BLOCK_TICKS):
            for far, _, received, _ in self._buses:
                for _ in range(received):
                    far.send(self._frame)
            start_s = perf_counter()
            for _, near, received, sent in self._buses:
                for _ in range(received):
                    near.recv(FRAME_BYTES)
                for _ in range(sent):
                    near.send(self._frame)
            self.durations_s.append(perf_counter() - start_s)
            for far, _, _, sent in self._buses:
                for _ in range(sent):
                    far.recv(FRAME_BYTES)

    def close(self) -> None:
        for far, near, *_ in self._buses:
            far.close()
            near.close()
