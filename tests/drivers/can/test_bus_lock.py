"""One program alone has a role on a bus, until it ends in any way."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.can.bus_lock import BusLock, BusRole, BusTakenError
from tests.folders import ROOT

HOLD = """
from drivers.can.bus_lock import BusLock, BusRole
lock = BusLock(BusRole.COMMANDS, "socketcan", {!r})
print("held", flush=True)
input()
"""


@pytest.fixture
def channel() -> str:
    return f"test{os.getpid()}"


def test_a_second_program_is_refused_and_reads_who_has_the_bus(channel: str) -> None:
    command = [sys.executable, "-c", HOLD.format(channel)]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None and owner.stdout.readline() == "held\n"
        for _ in range(10):  # each question stays in the owner's queue
            with pytest.raises(BusTakenError, match=f"process {owner.pid} commands its drives already"):
                BusLock(BusRole.COMMANDS, "socketcan", channel)
        owner.kill()
    BusLock(BusRole.COMMANDS, "socketcan", channel).close()  # free once its owner is dead


def test_a_simulated_robot_shares_the_bus_with_its_daemon_and_not_with_another_robot(channel: str) -> None:
    daemon, robot = (BusLock(role, "socketcan", channel) for role in BusRole)
    with pytest.raises(BusTakenError, match="simulates"):
        BusLock(BusRole.DRIVES, "socketcan", channel)
    daemon.close()
    robot.close()


def test_every_path_to_a_serial_adapter_is_one_bus(tmp_path: Path) -> None:
    device, link = tmp_path / "ttyACM0", tmp_path / "by-id"
    device.touch()
    link.symlink_to(device)
    owner = BusLock(BusRole.COMMANDS, "slcan", str(device))
    for path in (str(link), f"{link}@115200", f"{tmp_path}/./ttyACM0"):
        with pytest.raises(BusTakenError):
            BusLock(BusRole.COMMANDS, "slcan", path)
    BusLock(BusRole.COMMANDS, "slcan", str(tmp_path / "ttyACM1")).close()
    owner.close()
