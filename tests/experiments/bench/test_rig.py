"""The rig of the bench uses real buses in real time and refuses other programs that command the drives."""

import signal
import socket
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from control.records import JOINTS
from experiments.bench.operator import BenchOperator
from experiments.bench.reading import BenchReading
from experiments.bench.rig import HardwareRig, on_channels
from experiments.bench.sign_check import check_nudge
from experiments.bench.test_rig import TestRig
from experiments.bench.wiring_check import check_firmware, check_ids, check_unknown_ids, check_watchdogs
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import BusParameters, Configuration, StatusParameters
from firmware_host.configuration.loading import load_configuration
from simulation.harness.local_setup import write_local_setup
from tests.folders import ROOT
from tests.waiting import LONGEST_S


@pytest.fixture
def answering(short_folder: Path) -> Iterator[Path]:
    """Yield a socket that accepts connections, like that of a running daemon."""
    path = short_folder / "mudskipper.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()
        yield path


def test_the_bench_does_not_open_while_a_daemon_runs(configuration: Configuration, answering: Path) -> None:
    with pytest.raises(BenchError, match="'systemctl stop mudskipper' first"):
        HardwareRig(replace(configuration, status=StatusParameters(str(answering))))


def test_a_bus_that_does_not_open_is_reported(configuration: Configuration, short_folder: Path) -> None:
    changed = replace(on_channels(configuration, ["nocan9"]), status=StatusParameters(str(short_folder / "s")))
    with pytest.raises(BenchError, match=r"bus.left \(socketcan nocan9\) does not open: .*\."):
        HardwareRig(changed)


@pytest.fixture
def local_robot(short_folder: Path, tmp_path: Path) -> Iterator[Configuration]:
    """Yield the configuration of a simulated robot that runs in real time, in its own process, on local buses."""
    path = write_local_setup(short_folder, tmp_path)
    command = [sys.executable, "-m", "command_line.main", "simulate", "--config", str(path), "--on-blocks"]
    robot = subprocess.Popen(command, cwd=ROOT)
    try:
        yield load_configuration(path)
    finally:
        robot.send_signal(signal.SIGTERM)
        robot.wait(LONGEST_S)


@pytest.fixture
def opened_rig(local_robot: Configuration) -> Iterator[TestRig]:
    rig = HardwareRig(local_robot)
    while not any(rig.overheard.frames.values()):
        rig.close()
        rig = HardwareRig(local_robot)
    rig.close()  # it may have received only the robot's first messages
    made = TestRig(rig := HardwareRig(local_robot), BenchOperator())
    yield made
    made.force_idle()
    rig.close()


def bad(readings: Iterable[BenchReading]) -> list[str]:
    return [reading.message for reading in readings if not reading.good]


def test_every_drive_is_heard_on_real_buses(opened_rig: TestRig) -> None:
    """A busy computer cannot disturb these checks; those of rates and delays need an idle one."""
    readings = [
        reading
        for check in (check_ids, check_unknown_ids, check_firmware, check_watchdogs)
        for reading in check(opened_rig)
    ]
    assert len(readings) > 3 * len(JOINTS)
    assert bad(readings) == []


def test_on_real_buses_a_joint_is_nudged_or_the_late_computer_is_reported(
    opened_rig: TestRig,
) -> None:
    """A late torque proves nothing, so a busy computer ends the nudge with a message."""
    problems = []
    try:
        readings = list(check_nudge(opened_rig, "left_sweep"))
        problems = bad(readings)
        assert problems or len(readings) == 4 + len(JOINTS)
    except BenchError as problem:
        problems = [str(problem)]
    assert problems == [] or opened_rig.lateness_so_far.message


def test_one_channel_for_all_makes_one_bus(configuration: Configuration) -> None:
    changed = on_channels(configuration, ["can3"])
    assert changed.bus == {"left": BusParameters("socketcan", "can3")}
    assert {drive.bus for drive in changed.drive.values()} == {"left"}


def test_channels_by_name_replace_those_of_the_configuration(configuration: Configuration) -> None:
    changed = on_channels(configuration, ["right=can7"])
    assert changed.bus["right"].channel == "can7"
    assert changed.bus["left"] == configuration.bus["left"]
    assert changed.drive == configuration.drive
    assert on_channels(configuration, []) == configuration


def test_drives_with_the_same_id_do_not_share_a_channel(configuration: Configuration) -> None:
    drive = configuration.drive | {"right_sweep": replace(configuration.drive["right_sweep"], node_id=0)}
    with pytest.raises(BenchError, match=r"right_sweep.node_id = 0: .* on can0: give each bus"):
        on_channels(replace(configuration, drive=drive), ["can0"])


@pytest.mark.parametrize("given", [["can0", "can1"], ["left=can0", "left=can1"], ["right=can1", "can0"]])
def test_a_bus_has_one_channel(configuration: Configuration, given: list[str]) -> None:
    with pytest.raises(BenchError, match=rf"--can {given[1]}: bus (left|right) is given twice"):
        on_channels(configuration, given)


@pytest.mark.parametrize("given", ["middle=can0", "left=", ""])
def test_a_channel_that_fits_no_bus_is_refused(configuration: Configuration, given: str) -> None:
    with pytest.raises(BenchError, match="--can"):
        on_channels(configuration, [given])
