"""A step of the wall clock does not interrupt a walk, although the kernel stamps frames with this clock."""

from collections.abc import Callable, Iterable

import pytest

from control.controller import WalkOrder
from control.faults import Reaction
from control.modes import Mode
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockPort
from drivers.can.stamp_clock import StampClock
from drivers.drives import Drives
from firmware_host.configuration.configuration import Configuration
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.copied_robots import copy_of

STEPS_S = (-2.0, -0.3, -0.012, -0.005, 0.005, 0.012, 0.1, 2.0)


class WallClock:
    """The robot's wall clock, with a step at a time of the monotonic clock."""

    def __init__(self, robot: Lockstep) -> None:
        self.robot = robot
        self.at_s, self.step_s = robot.now_s, 0.0

    def at(self, time_s: float) -> float:
        return 1e6 + time_s + (self.step_s if time_s >= self.at_s else 0.0)

    def monotonic_s(self) -> float:
        return self.robot.now_s

    def __call__(self) -> float:
        return self.at(self.robot.now_s)


class KernelStampedPort:
    """A port whose frames are stamped with the wall clock, as they are on SocketCAN."""

    def __init__(self, port: CanPort, wall: WallClock) -> None:
        self._port, self._wall = port, wall
        self._clock = StampClock(wall.monotonic_s, wall)

    def receive(self) -> list[Frame]:
        offset_s = self._clock.offset_s()
        return [frame._replace(stamp_s=self._wall.at(frame.stamp_s) + offset_s) for frame in self._port.receive()]


def stamped(frames: Callable[[float], Iterable[Frame]]) -> Callable[[float], Iterable[Frame]]:
    return lambda now_s: [frame._replace(stamp_s=now_s) for frame in frames(now_s)]


@pytest.fixture(scope="module")
def walking(configuration: Configuration) -> Lockstep:
    robot = Lockstep(configuration, Track([(5.0, MUDS["48.5"])]))
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    robot.run_for(1.0)
    return robot


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_walk_goes_on_while_the_wall_clock_is_stepped(walking: Lockstep, step_s: float) -> None:
    robot = copy_of(walking)
    drives, wall = robot.loop.drives, WallClock(robot)
    assert isinstance(drives, Drives)
    for index, (port, receivers) in enumerate(drives._receivers):
        assert isinstance(port, MockPort)
        drives._receivers[index] = (KernelStampedPort(port, wall), receivers)  # type: ignore[assignment]
    for drive in robot.robot.drives:
        vars(drive)["cyclic_frames"] = stamped(drive.cyclic_frames)
    robot.run_for(0.1)
    wall.at_s, wall.step_s = robot.now_s + 0.999 * robot.period_s, step_s  # after the frames of the next read
    worst = Reaction.NONE
    for _ in range(300):
        robot.step()
        worst = max(worst, robot.loop.faults.reaction)
    assert worst <= Reaction.NONE
    assert robot.loop.mode is Mode.WALKING
