"""A walk lasts for as long as a client calls, under the daemon's lease, and nothing but a new call begins another."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from command_line.ros2 import leased_walk
from command_line.ros2.leased_walk import LeasedWalk
from control.modes import Mode
from firmware_host.configuration.configuration import Configuration
from operator_client.status_client import CallRefusedError, StatusClient
from tests.command_line.watch.served_robot import ServedRobot, resting_robot
from tests.waiting import wait_until

LEASE_S = 0.4  # of the robot's time


class Called:
    """A robot that holds its pose, and a client that calls it, whose clock a test advances."""

    def __init__(self, robot: ServedRobot, socket: Path) -> None:
        self.robot, self.socket, self.now_s = robot, socket, 100.0
        self.walk = LeasedWalk(socket, lambda: self.now_s)

    def call(self, after_s: float = 0.1) -> str:
        self.now_s += after_s
        return self.walk.walk()

    def operate(self, method: str, **params: Any) -> None:
        with StatusClient(self.socket) as operator:
            operator.call(method, **params)

    def wait_for(self, *modes: Mode) -> None:
        wait_until(lambda: self.robot.mode in modes)


@pytest.fixture
def called(configuration: Configuration, short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Called]:
    monkeypatch.setattr(leased_walk, "LEASE_S", LEASE_S)
    robot = ServedRobot(resting_robot(configuration))
    robot.robot.arm()
    with robot.served(short_folder / "s"):
        yield Called(robot, short_folder / "s")


def test_each_call_renews_the_walk_and_silence_stops_the_robot(called: Called) -> None:
    called.call()
    begun_s = called.robot.robot.now_s
    while called.robot.robot.now_s < begun_s + 3.0 * LEASE_S:
        called.call(after_s=0.0)
    assert called.robot.mode == Mode.WALKING
    called.wait_for(Mode.IDLE)


def test_an_operator_who_takes_the_robot_over_keeps_it(called: Called) -> None:
    called.call()
    called.wait_for(Mode.WALKING)
    with StatusClient(called.socket) as operator:
        operator.call("depth", depth_m=0.03, take_over=True, lease_s=10.0)
        for _ in range(3):
            with pytest.raises(CallRefusedError, match="taken over"):
                called.call()
        operator.call("stop")
        called.wait_for(Mode.HOLD)
        operator.call("release")
    with pytest.raises(CallRefusedError, match="taken over"):
        called.call()
    assert called.robot.mode == Mode.HOLD
    called.call(after_s=2.0 * LEASE_S)
    called.wait_for(Mode.WALKING)


@pytest.mark.parametrize("by_ros", [False, True])
def test_a_stop_is_final_until_the_client_has_paused(called: Called, by_ros: bool) -> None:
    called.call()
    called.wait_for(Mode.WALKING)
    if by_ros:
        assert "every drive has confirmed" in called.walk.end("stop")
    else:
        called.operate("stop")
        called.wait_for(Mode.STOPPING, Mode.HOLD)
    for _ in range(3):
        with pytest.raises(CallRefusedError, match="pause"):
            called.call()
    called.wait_for(Mode.HOLD)  # with torque: the lease was given back, not lost
    called.call(after_s=2.0 * LEASE_S)
    called.wait_for(Mode.WALKING)


def test_disarming_ends_the_walk_at_once(called: Called) -> None:
    called.call()
    called.wait_for(Mode.WALKING)
    called.walk.end("disarm")
    assert called.robot.mode == Mode.IDLE
    with pytest.raises(CallRefusedError, match="disarm"):
        called.call()


def test_a_refused_order_takes_no_lease(called: Called) -> None:
    with pytest.raises(CallRefusedError, match="clear"):
        called.walk.clear()
    called.operate("disarm")
    called.wait_for(Mode.IDLE)
    with pytest.raises(CallRefusedError, match="arm"):
        called.call()
    with StatusClient(called.socket) as operator:
        operator.call("lease", for_s=10.0)
        assert called.walk.clear() == "accepted"  # no lease is needed, and the answer says so
        operator.call("release")
    called.operate("arm", force="uncalibrated")
    called.wait_for(Mode.HOLD)
