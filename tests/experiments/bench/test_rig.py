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


def test_the_bench_does_not_open_while_a_daemon_runs(configuration: Configuration, short_folder: Path) -> None:
    path = str(short_folder / "mudskipper.sock")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
        daemon.bind(path)
        daemon.listen()
        with pytest.raises(BenchError, match="'systemctl stop mudskipper' first"):
            HardwareRig(replace(configuration, status=StatusParameters(path)))


def test_a_bus_that_does_not_open_is_reported(configuration: Configuration, short_folder: Path) -> None:
    changed = replace(on_channels(configuration, ["nocan9"]), status=StatusParameters(str(short_folder / "s")))
    with pytest.raises(BenchError, match=r"bus.left \(socketcan nocan9\) does not open: .*\."):
        HardwareRig(changed)


@pytest.fixture
def opened_rig(short_folder: Path, tmp_path: Path) -> Iterator[TestRig]:
    """Yield a test rig on the local buses of a simulated robot that runs in real time, in its own process."""
    path = write_local_setup(short_folder, tmp_path)
    command = [sys.executable, "-m", "command_line.main", "simulate", "--config", str(path), "--on-blocks"]
    robot = subprocess.Popen(command, cwd=ROOT)
    try:
        configuration, is_heard = load_configuration(path), False
        while not is_heard:
            rig = HardwareRig(configuration)
            is_heard = any(rig.overheard.frames.values())
            rig.close()
        with TestRig(HardwareRig(configuration), BenchOperator()) as made:  # the first may have missed some messages
            yield made
    finally:
        robot.send_signal(signal.SIGTERM)
        robot.wait(LONGEST_S)


def bad(readings: Iterable[BenchReading]) -> list[str]:
    return [reading.message for reading in readings if not reading.good]


def test_on_real_buses_every_drive_is_heard_and_a_joint_is_nudged_or_the_late_computer_reported(
    opened_rig: TestRig,
) -> None:
    """A busy computer cannot disturb the first checks; it ends the nudge with a message, as a late torque proves
    nothing.
    """
    checks = (check_ids, check_unknown_ids, check_firmware, check_watchdogs)
    readings = [reading for check in checks for reading in check(opened_rig)]
    assert len(readings) > 3 * len(JOINTS)
    assert bad(readings) == []
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


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (["can0", "can1"], "can1: bus left is given twice"),
        (["left=can0", "left=can1"], "left=can1: bus left is given twice"),
        (["right=can1", "can0"], "can0: bus right is given twice"),
        (["middle=can0"], "no bus 'middle'"),
        (["left="], "a channel is missing"),
        ([""], "a channel is missing"),
    ],
)
def test_a_channel_that_fits_no_bus_or_a_second_one_of_it_is_refused(
    configuration: Configuration, given: list[str], why: str
) -> None:
    with pytest.raises(BenchError, match=f"--can .*{why}"):
        on_channels(configuration, given)
