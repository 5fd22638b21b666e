"""Observes what a loop sends: simulated drives that hear it, and nothing else, must stay without torque."""

from collections.abc import Sequence
from random import Random

from drivers.can.frames import Frame
from firmware_host.ticker import Tick
from simulation.devices.drive_types import make_simulated_drive
from simulation.harness.lockstep import Lockstep, drives_of


class Observer:
    """Owns a third node on each bus of a robot, by which frames come in, and the drives that listen there."""

    def __init__(self, robot: Lockstep) -> None:
        self._robot = robot
        self._nodes = [bus.open() for bus in robot.buses.values()]
        drives = drives_of(robot.loop.configuration).values()
        self._listeners = [make_simulated_drive(parameters, Random(1)) for parameters in drives]
        for drive in self._listeners:
            drive.reset(robot.now_s)
        self.frames = 0  # sent by the loop

    @property
    def energises(self) -> bool:
        """Return whether the frames of the loop have energised a drive."""
        return any(drive.energised for drive in self._listeners)

    def tick(self, arriving: Sequence[Frame] = (), with_drives: bool = True) -> None:
        """Run a tick in which these frames arrive."""
        robot = self._robot
        for index, frame in enumerate(arriving):
            self._nodes[index % len(self._nodes)].send(frame)
        robot.tick_number += 1
        if with_drives:
            robot.robot.advance(robot.now_s)
        for node in self._nodes:
            node.receive()
        robot.loop.tick(Tick(robot.now_s, 0.0, robot.tick_number, 0))
        for frame in (frame for node in self._nodes for frame in node.receive()):
            self.frames += 1
            for drive in self._listeners:
                drive.receive(frame, robot.now_s)
