"""Robots that tests of the screen share."""

import pytest

from firmware_host.configuration.configuration import Configuration
from simulation.harness.lockstep import Lockstep
from tests.command_line.watch.served_robot import ServedRobot, resting_robot, walking_robot
from tests.copied_robots import copy_of


@pytest.fixture(scope="session")
def walking(configuration: Configuration) -> Lockstep:
    return walking_robot(configuration)


@pytest.fixture
def walked(walking: Lockstep) -> ServedRobot:
    """Return a robot in the middle of its walk."""
    return ServedRobot(copy_of(walking))


@pytest.fixture
def resting(configuration: Configuration) -> ServedRobot:
    return ServedRobot(resting_robot(configuration))
