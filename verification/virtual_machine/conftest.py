"""One virtual machine for all checks, booted once; a check that cuts its power boots it again."""

from collections.abc import Iterator

import pytest

from verification.virtual_machine.installed_robot import installed_robot
from verification.virtual_machine.machine import Machine
from verification.virtual_machine.robot import Robot


@pytest.fixture(scope="session")
def machine() -> Iterator[Machine]:
    machine = Machine(installed_robot())
    try:
        machine.boot()
        yield machine
    finally:
        machine.close()


@pytest.fixture(scope="session")
def booted(machine: Machine) -> Robot:
    """The robot after the boot, without an operator's help."""
    robot = Robot(machine)
    robot.wait_until_ready()
    return robot


@pytest.fixture
def robot(booted: Robot) -> Robot:
    """The robot at rest, without faults."""
    booted.rest()
    return booted


@pytest.fixture
def walking(booted: Robot) -> Robot:
    """The robot in a walk, possibly that of the previous check: a second of the guest costs several of the host."""
    if not booted.walks_without_faults():
        booted.rest()
        booted.walk()
    return booted
