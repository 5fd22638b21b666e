"""The plug is pulled in the middle of a walk: the next boot finds a sound disk, a readable journal and a whole log."""

from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from verification.virtual_machine.robot import LOGS, Robot

MISSING_S = 2.0  # at the end of the log, as docs/how-to/install.md says
TICKS = "/tick"


def uptime_s(robot: Robot) -> float:
    return float(robot.shell("cat /proc/uptime").split()[0])


@pytest.fixture(scope="module")
def cut_s(booted: Robot) -> float:
    """When the power went, on the clock of that boot."""
    booted.rest()
    booted.walk()
    booted.shell("sleep 3")
    when_s = uptime_s(booted)
    booted.machine.cut_power()
    booted.machine.boot()
    booted.wait_until_ready()
    booted.wait_for("! mudskipper status --json | grep -E '\"repairing\": [1-9]'")
    return when_s


@pytest.fixture(scope="module")
def log(booted: Robot, cut_s: float, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The last one before the cut, as it is found afterwards."""
    names = booted.shell(f"ls {LOGS}/done").split()
    path = tmp_path_factory.mktemp("logs") / names[-1]
    path.write_bytes(booted.machine.read(f"{LOGS}/done/{names[-1]}"))
    return path


def test_the_robot_boots_again_and_is_disarmed(booted: Robot, cut_s: float) -> None:
    assert booted.status()["mode"] == "idle"
    assert booted.torque_is_off()


def test_the_journal_of_the_time_before_can_be_read(booted: Robot, cut_s: float) -> None:
    assert "Started mudskipper.service" in booted.shell("journalctl --boot=-1 --unit=mudskipper --output=cat")


def test_rosbags_reads_the_walk_up_to_the_last_seconds(log: Path, cut_s: float) -> None:
    with AnyReader([log]) as reader:
        connections = [connection for connection in reader.connections if connection.topic == TICKS]
        rows: list[Any] = [reader.deserialize(raw, source.msgtype) for source, _, raw in reader.messages(connections)]
    assert rows[-1].stamp_s > cut_s - MISSING_S
