"""The simulated robot walks in lockstep with the daemon's loop over two serial CAN adapters.

Frames pass as LAWICEL's lines through two pseudo-terminals, pyserial and python-can.
"""

import time
from collections.abc import Iterator

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockPort
from drivers.drive_types import make_drives
from firmware_host.configuration.configuration import Configuration
from firmware_host.loop import Loop
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.drivers.can.slcan_adapter import OPENING_LINES, SlcanAdapter
from tests.waiting import wait_until


class Line:
    """One bus over a serial line; it counts lines and bytes, because a pseudo-terminal delivers with a delay."""

    def __init__(self, end: CanPort) -> None:
        assert isinstance(end, MockPort)
        self.adapter = SlcanAdapter(end)
        self.port = self.adapter.open_port()
        self.plugged = True
        self._lines, self._read_bytes = OPENING_LINES, 0
        self._send = self.port.send
        vars(self.port)["send"] = self._counted_send

    def _counted_send(self, frame: Frame) -> None:
        failed = self.port.failed_sends
        self._send(frame)
        self._lines += self.port.failed_sends == failed

    def obey(self) -> None:
        """Deliver the frames of the loop to the robot."""
        while self.plugged:
            self.adapter.step()
            if self.adapter.heard_lines >= self._lines:
                break
            time.sleep(0.0)

    def deliver(self) -> None:
        """Deliver the frames of the robot to the loop."""
        if self.plugged:
            self.adapter.step()
            wait_until(lambda: self.adapter.unread_bytes == self.adapter.written_bytes - self._read_bytes)
            self._read_bytes = self.adapter.written_bytes

    def unplug(self) -> None:
        self.adapter.unplug()
        self.plugged = False


class SerialWalk(Lockstep):
    """A lockstep whose loop reaches the bus over the serial lines."""

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration, Track([(1.0, MUDS["48.5"])]))
        self.lines = {name: Line(port) for name, port in self.loop.drives.ports.items()}
        ports = {name: line.port for name, line in self.lines.items()}
        drives = make_drives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
        self.loop = Loop(configuration, drives, self.loop.pose, None, lambda: self.now_s)

    def step(self) -> None:
        self.tick_number += 1
        for line in self.lines.values():
            line.obey()
        self.robot.advance(self.now_s)
        for line in self.lines.values():
            line.deliver()
        self.loop.tick(Tick(self.now_s, 0.0, self.tick_number, 0))

    def close(self) -> None:
        self.loop.drives.close()
        for line in self.lines.values():
            if line.plugged:
                line.unplug()


@pytest.fixture
def walk(configuration: Configuration) -> Iterator[SerialWalk]:
    walk = SerialWalk(configuration)
    walk.arm()
    walk.walk(WalkOrder(0.03))
    yield walk
    walk.close()


def test_the_robot_walks_on_serial_adapters_and_an_unplugged_one_ends_the_walk_in_a_fault(walk: SerialWalk) -> None:
    assert walk.run_until(lambda: len(walk.loop.learning.strides) >= 2, 3.0)
    assert walk.loop.mode is Mode.WALKING and not walk.loop.faults.present
    assert walk.robot.plant.body_m > 0.01
    for name, port in walk.loop.drives.ports.items():
        assert (port.error_frames, port.failed_sends, walk.lines[name].adapter.lost_lines) == (0, 0, 0)
    walk.lines["left"].unplug()
    walk.run_for(2 / 380)
    assert "bus_off" in {fault.name for fault in walk.loop.faults.present}
    assert walk.run_until(lambda: walk.loop.mode is Mode.FAULT, 2.5)
    assert walk.loop.drives.ports["left"].failed_sends > 0
