"""The simulated robot runs in real time, also on a busy computer."""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock, call

import pytest

from control.monitors.encoder_monitor import LONGEST_GAP_S
from control.records import JOINTS
from drivers.drive import DriveParameters
from drivers.odrive.axis import OdriveAxis
from drivers.odrive.parameters import OdriveParameters
from firmware_host.buses import open_ports
from firmware_host.configuration.loading import load_configuration
from simulation.harness.local_setup import write_local_setup
from simulation.harness.peer import LONGEST_CATCH_UP_S, WATCHDOG_S, Ground, Peer, simulate, take_precedence, track_of
from simulation.harness.world import World

HELD_UP_S = 4.0 * WATCHDOG_S


def odrive(parameters: DriveParameters) -> OdriveParameters:
    assert isinstance(parameters, OdriveParameters)
    return parameters


class Bench:
    """Owns a robot that the test steps, and the other end of its buses."""

    def __init__(self, folder: Path) -> None:
        configuration = load_configuration(write_local_setup(folder, folder / "logs"))
        self.peer = Peer(configuration, World(track_of(["48.5"])), seed=1)
        self.ports = open_ports(configuration.bus)
        drives = configuration.drive
        self.axes = [OdriveAxis(joint, odrive(drives[joint]), self.ports[drives[joint].bus]) for joint in JOINTS]
        self.now_s = self.peer.robot.now_s
        for axis in self.axes:
            axis.prepare()
            axis.close_loop()
        self.step(0.002)

    def step(self, duration_s: float) -> None:
        self.now_s += duration_s
        self.peer.step(self.now_s)

    @property
    def energised(self) -> set[bool]:
        return {drive.energised for drive in self.peer.robot.drives}

    def close(self) -> None:
        self.peer.close()
        for port in self.ports.values():
            port.close()


@pytest.fixture
def bench(short_folder: Path) -> Iterator[Bench]:
    made = Bench(short_folder)
    yield made
    made.close()


def test_commands_that_waited_while_the_robot_was_held_up_feed_its_watchdogs(bench: Bench) -> None:
    assert bench.energised == {True}
    for axis in bench.axes:
        axis.send_torque(0.0)
    bench.step(HELD_UP_S)
    bench.step(0.002)
    assert bench.energised == {True}


@pytest.mark.parametrize(
    ("lost_s", "counted_s"), [(0.01, 0.01), (0.5, LONGEST_GAP_S)], ids=["short", "longer than monitors look back"]
)
def test_in_time_that_the_robot_has_lost_its_joints_come_to_rest(bench: Bench, lost_s: float, counted_s: float) -> None:
    robot, plant = bench.peer.robot, bench.peer.robot.plant
    left, right = plant.arms
    plant.put_back()
    left.sweep_velocity_rad_s, right.adduction_velocity_rad_s, plant.body.forward_m_s = 2.0, 1.0, 0.1
    before_rad, robot.now_s = right.adduction_rad, bench.now_s
    bench.step(lost_s)
    assert left.sweep_rad == pytest.approx(1.0 * counted_s) and plant.body_m == pytest.approx(0.1 * counted_s)
    assert right.adduction_rad - before_rad == pytest.approx(0.5 * counted_s)
    assert plant.velocities_rad_s == (0.0,) * 4 and plant.body_m_s == 0.1
    assert robot.now_s == bench.now_s


def test_what_the_robot_can_catch_up_with_is_simulated(bench: Bench) -> None:
    for axis in bench.axes:
        axis.send_torque(0.5)
    before = bench.peer.robot.plant.angles_rad
    bench.step(0.9 * LONGEST_CATCH_UP_S)
    assert bench.peer.robot.plant.angles_rad != before


def test_a_robot_obeys_signals_as_soon_as_it_is_announced(short_folder: Path) -> None:
    configuration = load_configuration(write_local_setup(short_folder, short_folder / "logs"))

    def announce() -> None:
        for number in (signal.SIGUSR1, signal.SIGTERM):
            os.kill(os.getpid(), number)

    process = multiprocessing.get_context("fork").Process(target=simulate, args=(configuration, Ground(), 1, announce))
    process.start()
    process.join(30.0)
    assert process.exitcode == 0


def test_a_host_that_halts_one_of_two_processors_halts_both_the_robot_and_its_daemon(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cpu_of(processors: set[int]) -> int:
        monkeypatch.setattr("os.sched_getaffinity", lambda _: processors)
        return load_configuration(write_local_setup(short_folder, short_folder / "logs")).loop.cpu

    assert cpu_of({0, 1, 2, 3}) == -1
    cpu = cpu_of({0, 1})
    assert cpu >= 0
    monkeypatch.setattr("os.sched_setscheduler", lambda *_: None)
    pin = Mock(side_effect=[None, OSError("it is that of another computer")])
    monkeypatch.setattr("os.sched_setaffinity", pin)
    for each in (cpu, cpu, -1):
        take_precedence(each)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1, 2, 3})
    take_precedence(cpu)  # of a robot's own configuration
    assert pin.mock_calls == [call(0, {cpu})] * 2


@pytest.mark.parametrize(("processors", "expected"), [({0}, ["nice"]), ({0, 1}, ["real time"])], ids=["one", "two"])
def test_a_lone_processor_is_not_taken_in_real_time(
    monkeypatch: pytest.MonkeyPatch, processors: set[int], expected: list[str]
) -> None:
    taken: list[str] = []
    monkeypatch.setattr("os.sched_getaffinity", lambda _: processors)
    monkeypatch.setattr("os.sched_setscheduler", lambda *_: taken.append("real time"))
    monkeypatch.setattr("os.nice", lambda _: taken.append("nice"))
    take_precedence(-1)
    assert taken == expected
