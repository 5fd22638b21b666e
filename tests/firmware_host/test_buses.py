"""Buses that do not open, vanish, or appear later are reported, and the robot stays disarmed."""

import errno
import gc
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import can
import pytest

from control.modes import Mode, Request
from drivers.can.bus_lock import BusRole
from drivers.can.mock_bus import MockBus, MockPort
from drivers.can.port_health import BusState
from drivers.can.reopening_port import RETRY_S, NotOpenError, ReopeningPort
from firmware_host import buses
from firmware_host.buses import BusError, lock_buses, open_bus, open_ports, reopening_ports
from firmware_host.configuration.configuration import BusParameters, Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.daemon import reopen_buses
from operator_client.status_client import NoDaemonError, StatusClient
from simulation.harness.local_setup import write_local_setup
from tests.firmware_host.recorded_robot import RecordedRobot
from tests.waiting import LONGEST_S

CAN0 = BusParameters("socketcan", "can0")


def refuse_with(problem: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no port open."""

    def refuse(*arguments: object, **options: object) -> None:
        raise problem

    monkeypatch.setattr(buses, "open_port", refuse)


IN_A_LIBRARY = can.CanInitializationError("could not create serial device")
IN_A_LIBRARY.__cause__ = FileNotFoundError(errno.ENOENT, "No such file or directory")


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (IN_A_LIBRARY, "there is no such device"),
        (OSError(errno.ENODEV, "No such device"), "there is no such interface"),
        (OSError(errno.ENOENT, "could not open port /dev/ttyACM0"), "there is no such device"),
        (PermissionError(errno.EACCES, "could not open port"), "this user may not use it"),
        (OSError(errno.EAFNOSUPPORT, "Address family not supported"), "this kernel has no CAN"),
        (can.CanOperationError("Error receiving: Network is down", errno.ENETDOWN), "the interface is down"),
        (ValueError("bitrate is needed"), "bitrate is needed"),
    ],
)
def test_the_error_of_a_bus_that_does_not_open_names_bus_and_cause(
    problem: Exception, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_with(problem, monkeypatch)
    with pytest.raises(BusError) as caught:
        open_bus("left", CAN0)
    assert str(caught.value).startswith(f"bus.left (socketcan can0) does not open: {words}")
    assert "\n" not in str(caught.value)


def test_when_one_bus_does_not_open_the_others_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    first = MockBus()

    def open_left_alone(interface: str, channel: str, options: object, fd: bool) -> MockPort:
        if channel == "can1":
            raise OSError(errno.ENODEV, "No such device")
        return first.open()

    monkeypatch.setattr(buses, "open_port", open_left_alone)
    with pytest.raises(BusError, match="bus.right"):
        open_ports({"left": CAN0, "right": BusParameters("socketcan", "can1")})
    assert first.ports == []


def test_a_missing_bus_that_is_waited_for_is_off_and_reports_its_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_with(OSError(errno.ENODEV, "No such device"), monkeypatch)
    ports = reopening_ports({"left": CAN0}, wait=True)
    assert ports["left"].state is BusState.OFF
    assert "no such interface" in ports["left"].last_error
    with pytest.raises(BusError):
        reopening_ports({"left": CAN0}, wait=False)


class Plug:
    """A bus of a robot in lockstep, from which the loop's adapter can be unplugged."""

    def __init__(self) -> None:
        self._bus, self._inside = MockBus(), True
        self.adapter = ReopeningPort(self._plug_in, wait=True)
        self._ends = iter((self._bus.open(), self.adapter))  # the robot opens the first one

    def open(self) -> MockPort | ReopeningPort:
        return next(self._ends)

    def _plug_in(self) -> MockPort:
        if not self._inside:
            raise NotOpenError("bus.left (socketcan can0) does not open: there is no such interface")
        self._wire = self._bus.open()
        return self._wire

    def pull(self) -> None:
        self._inside = False
        self._wire.state, self._wire.last_error, self._wire.full = BusState.OFF, "No such device", True
        self._wire.close()

    def put_back(self) -> None:
        self._inside = True


def mode_of(robot: RecordedRobot) -> Mode:
    return robot.loop.mode


def test_an_unplugged_bus_is_a_fault_and_the_robot_stays_disarmed_after_it_returns(
    configuration: Configuration,
) -> None:
    plug = Plug()
    robot = RecordedRobot(configuration, buses={"left": plug, "right": MockBus()})
    robot.late_acts.append(lambda: reopen_buses(robot.loop, {"left": plug.adapter}, robot.now_s))
    robot.arm()
    plug.pull()
    robot.run_for(2.5)
    assert mode_of(robot) is Mode.FAULT
    names = {fault.name: fault.message for fault in robot.loop.faults.present}
    assert "there is no such interface" in names["bus_off"]
    plug.put_back()
    robot.run_for(2.0 * RETRY_S)
    assert plug.adapter.state is BusState.ACTIVE
    assert mode_of(robot) is Mode.FAULT  # until an operator clears it
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    robot.run_for(2.0)
    assert mode_of(robot) is Mode.IDLE
    assert not any(state.closed_loop for state in robot.loop.states)


def test_a_daemon_without_its_bus_waits_if_configured(short_folder: Path, tmp_path: Path) -> None:
    path = write_local_setup(short_folder, tmp_path / "logs")
    text = path.read_text(encoding="utf-8").replace('interface = "mudskipper_local"', 'interface = "socketcan"')
    path.write_text(text.replace("[loop]", "[loop]\nwait_for_bus = true"), encoding="utf-8")
    command = [sys.executable, "-m", "firmware_host.daemon", "--config", str(path)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as daemon:
        report = wait_for_status(short_folder / "mudskipper.sock", daemon)
        daemon.send_signal(signal.SIGTERM)
        _, said = daemon.communicate(timeout=LONGEST_S)
    assert "Traceback" not in said and daemon.returncode == 0
    assert (report["mode"], report["fault"]["name"]) == ("boot", "bus_off")


def test_a_second_program_on_a_bus_is_refused_before_it_sends_a_frame(short_folder: Path, tmp_path: Path) -> None:
    path = write_local_setup(short_folder, tmp_path / "logs")
    buses = load_configuration(path).bus
    ears = open_ports(buses)
    with lock_buses({"right": buses["right"]}, BusRole.COMMANDS):
        command = [sys.executable, "-m", "firmware_host.daemon", "--config", str(path)]
        second = subprocess.run(command, stderr=subprocess.PIPE, text=True, timeout=LONGEST_S, check=False)
    assert second.returncode == 1
    assert f"bus.right (mudskipper_local {short_folder}/right) does not open: process {os.getpid()}" in second.stderr
    assert not any(port.receive() for port in ears.values())
    for port in ears.values():
        port.close()


def test_an_absent_bus_costs_no_memory_in_ten_hours() -> None:
    """As in the daemon, garbage collection is off. Objects of earlier tests do not count."""
    ports = reopening_ports({"left": BusParameters("socketcan", "nocan9")}, wait=True)

    def live(begin_s: int, end_s: int) -> int:
        for now_s in range(begin_s, end_s):
            assert not ports["left"].reopen(float(now_s))
        return len(gc.get_objects())

    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        before = live(0, 100)
        after = live(100, 10 * 3600)
        garbage = gc.collect()
    finally:
        gc.enable()
        gc.unfreeze()
    assert after - before < 100
    assert garbage < 100


def wait_for_status(path: Path, daemon: subprocess.Popen[str]) -> dict[str, Any]:
    while daemon.poll() is None:
        try:
            client = StatusClient(path)
        except NoDaemonError:
            continue
        report: dict[str, Any] = client.call("status")
        client.close()
        if report["fault"]:
            return report
    raise AssertionError("the daemon ended")
