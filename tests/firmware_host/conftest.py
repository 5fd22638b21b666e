"""Fixtures for the tests of the daemon."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware_host.configuration.configuration import Configuration
from tests.copied_robots import copy_of
from tests.firmware_host.recorded_robot import RecordedRobot
from tests.firmware_host.sockets.served_socket import Served


@pytest.fixture
def served(short_folder: Path) -> Iterator[Served]:
    status = Served(short_folder / "s")
    yield status
    status.close()


@pytest.fixture(scope="session")
def armed_robot(configuration: Configuration) -> RecordedRobot:
    """Return a robot that holds its pose, to be copied."""
    robot = RecordedRobot(configuration)
    robot.arm()
    return robot


@pytest.fixture
def robot(armed_robot: RecordedRobot) -> RecordedRobot:
    """Return a robot that holds its pose."""
    return copy_of(armed_robot)
