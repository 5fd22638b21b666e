"""The buses of a robot and the daemon's own loop on them, in this process, for a real or a simulated robot.

The two rigs differ in how the next tick comes: on hardware the ticker sleeps until it, in simulation time is stepped.
Before the loop opens the drives, both record all frames on the buses for a second, because SocketCAN filters frames of
other ids as soon as the drives' ports have set their filters.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from control.rate import PERIOD_S
from drivers.can.bus_lock import BusRole
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.drive import DriveCalibration, DriveParameters
from drivers.drive_types import make_drives, type_of
from drivers.pose.pose_port import NoPose
from experiments.robot.bench_errors import BenchError
from firmware_host.buses import BusError, lock_buses, open_ports
from firmware_host.computer.realtime import prepare_loop
from firmware_host.configuration.configuration import BusParameters, Configuration
from firmware_host.configuration.consistency import contradictions
from firmware_host.loop import Loop
from firmware_host.ticker import Tick, Ticker
from operator_client.status_client import NoDaemonError, NotPermittedError, StatusClient
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.blocks import on_blocks
from simulation.harness.robot import SimulatedRobot

LISTENING_S = 1.0  # ten heartbeats
READ_INTERVAL_S = 0.001


class Overheard(NamedTuple):
    duration_s: float
    frames: Mapping[str, Sequence[Frame]]  # by bus


class HardwareRig:
    """Real buses and real time. Raises BenchError where a daemon runs or a bus does not open.

    The process has the daemon's priority while the rig is open. Memory is not locked, because it cannot be unlocked.
    """

    def __init__(self, configuration: Configuration) -> None:
        refuse_beside_daemon(Path(configuration.status.socket))
        self.configuration = configuration = on_bench(configuration)
        with ExitStack() as stack:
            try:
                stack.enter_context(lock_buses(configuration.bus, BusRole.COMMANDS))
                ports = open_ports(configuration.bus)
            except BusError as problem:
                raise BenchError(f"{problem}.") from problem
            self._locks = stack.pop_all()
        self.overheard = listen(ports, configuration.drive, time.monotonic(), _wait_briefly)
        drives = make_drives(configuration.drive, ports, configuration.limits, configuration.watchdog_endpoints)
        self.loop = Loop(configuration, drives, NoPose(), None)
        self._processors = os.sched_getaffinity(0)
        options = configuration.loop
        # about the operating system, for the operator
        self.warnings: Sequence[str] = prepare_loop(options.priority, options.cpu, lock_memory=False)
        self._ticker = Ticker()
        self.now_s = time.monotonic()

    def wait(self) -> Tick:
        """Wait for the next tick."""
        tick = self._ticker.wait()
        self.now_s = tick.now_s
        return tick

    def close(self) -> None:
        self.loop.drives.close()
        self._locks.close()
        os.sched_setaffinity(0, self._processors)
        gc.unfreeze()
        gc.enable()
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def on_bench(configuration: Configuration) -> Configuration:
    """Return a configuration that arms before it is calibrated, since the bench is where that happens."""
    drives = {
        joint: replace(drive, calibrated=DriveCalibration(date="bench", drive=drive.identity))
        for joint, drive in configuration.drive.items()
    }
    return replace(configuration, drive=drives)


def refuse_beside_daemon(socket: Path) -> None:
    """Raises BenchError where a daemon runs: two programs must not command the same drives."""
    why = f"The daemon runs (it answers on {socket}) and commands the drives: 'systemctl stop mudskipper' first."
    try:
        StatusClient(socket).close()
    except NoDaemonError:
        return
    except NotPermittedError as problem:  # it is unknown whether one runs
        raise BenchError(f"{problem}; run this as its owner.") from problem
    raise BenchError(why)


def listen(
    ports: Mapping[str, CanPort], drives: Mapping[str, DriveParameters], now_s: float, wait: Callable[[], float]
) -> Overheard:
    """Record all frames for LISTENING_S. `wait` lets a moment pass and returns the time.

    Drives that report only when asked are asked in every moment; this commands nothing.
    """
    queries = [(ports[drive.bus], type_of(drive).query(drive.node_id)) for drive in drives.values()]
    frames: dict[str, list[Frame]] = {name: [] for name in ports}
    begun_s = now_s
    for port in ports.values():
        port.receive()  # discard older frames
    while now_s - begun_s < LISTENING_S:
        for port, query in queries:
            if query is not None:
                port.send(query)
        now_s = wait()
        for name, port in ports.items():
            frames[name] += port.receive()
    return Overheard(now_s - begun_s, frames)


def _wait_briefly() -> float:
    time.sleep(READ_INTERVAL_S)
    return time.monotonic()


class SimulatedRig:
    """A robot on blocks that is built by `built`, and a loop with `configuration`, which may differ.

    `drives` replace the drives of `built`. `others` are called before each step, for other senders on the buses and
    hands on the flippers.
    """

    def __init__(
        self,
        configuration: Configuration,
        built: Configuration | None = None,
        drives: Mapping[str, SimulatedDriveParameters] | None = None,
        seed: int = 1,
        others: Sequence[Callable[[SimulatedRig], None]] = (),
    ) -> None:
        built = built or configuration
        self.configuration = configuration = on_bench(configuration)
        self.buses = {name: MockBus() for name in configuration.bus}
        world = on_blocks(built)
        self.robot = SimulatedRobot(
            world.plant(built),
            world.track,
            drives or world.drives(built),
            built.bus_of,
            {name: bus.open() for name, bus in self.buses.items()},
            seed,
        )
        self.others = list(others)
        self._tick_number = 0
        ears = {name: bus.open() for name, bus in self.buses.items()}
        self.overheard = listen(ears, configuration.drive, 0.0, lambda: self.wait().now_s)
        for ear in ears.values():
            ear.close()
        wires = {name: bus.open() for name, bus in self.buses.items()}
        robot_drives = make_drives(configuration.drive, wires, configuration.limits, configuration.watchdog_endpoints)
        self.loop = Loop(configuration, robot_drives, NoPose(), None, lambda: self.now_s, lambda: self.now_s)
        self.warnings: Sequence[str] = ()

    @property
    def now_s(self) -> float:
        return self._tick_number * PERIOD_S

    def wait(self) -> Tick:
        self._tick_number += 1
        for other in self.others:
            other(self)
        self.robot.advance(self.now_s)
        return Tick(self.now_s, 0.0, self._tick_number, 0)

    def close(self) -> None:
        self.loop.drives.close()


Rig = HardwareRig | SimulatedRig


def on_channels(configuration: Configuration, given: Sequence[str]) -> Configuration:
    """Replace the configured channels: `can0` for all buses, or `left=can0` for one. Raises BenchError.

    Buses that share a channel are one bus: its drives then need different node ids.
    """
    channels: dict[str, str] = {}
    for argument in given:
        name, equals, channel = argument.rpartition("=")
        if not channel:
            raise BenchError(f"--can {argument}: a channel is missing, as in --can left=can0.")
        if equals and name not in configuration.bus:
            raise BenchError(f"--can {argument}: no bus {name!r} is configured, only {', '.join(configuration.bus)}.")
        added = {name: channel} if equals else dict.fromkeys(configuration.bus, channel)
        if twice := channels.keys() & added.keys():
            raise BenchError(f"--can {argument}: bus {min(twice)} is given twice; give it once.")
        channels |= added
    first_on = {channel: name for name, channel in reversed(channels.items())}
    moved = {name: first_on[channel] for name, channel in channels.items() if first_on[channel] != name}
    buses = {name: bus for name, bus in configuration.bus.items() if name not in moved}
    for name in buses.keys() & channels.keys():
        bit_rate_kbit_s = buses[name].bit_rate_kbit_s
        buses[name] = BusParameters("socketcan", channels[name], bit_rate_kbit_s=bit_rate_kbit_s)
    drives = {
        joint: replace(drive, bus=moved[drive.bus], calibrated=DriveCalibration()) if drive.bus in moved else drive
        for joint, drive in configuration.drive.items()
    }
    changed = replace(configuration, bus=buses, drive=drives)
    for problem in contradictions(changed):
        raise BenchError(f"{problem} on {' and '.join(first_on)}: give each bus its own --can NAME=channel.")
    return changed
