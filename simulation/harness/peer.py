"""The simulated robot of `mudskipper simulate`: in real time, on the buses that a configuration names.

It takes from the configuration what a real robot's bench fixes: buses, node ids, signs, geometry, a fixed base. It
sends the body's position to the configured pose source, at motion capture's rate. SIGUSR1 stands for the operator who
moves the flippers back by hand from their mechanical stops, beyond the limits: no torque returns from there.
`mudskipper simulate --reset` sends it, and with `--emergency-stop` SIGUSR2, which cuts the drives' power.
"""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from control.monitors.encoder_monitor import LONGEST_GAP_S
from drivers.can.bus_lock import BusRole, BusTakenError
from firmware_host.buses import BusError, lock_buses, open_ports
from firmware_host.computer.realtime import pin
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.ticker import Ticker
from simulation.devices.pose_broadcast import PoseBroadcast
from simulation.harness.blocks import on_blocks
from simulation.harness.local_setup import FEW_PROCESSORS
from simulation.harness.robot import SimulatedRobot
from simulation.harness.world import World, load_world
from simulation.mud.clay import MUDS
from simulation.mud.track import COMPARTMENT_M, Track

STEP_S = 0.002  # the period of the drives' fastest messages
WATCHDOG_S = 0.25  # of the simulated drives, on processors that all processes share
LONGEST_CATCH_UP_S = 0.005  # in longer delays a loop without new samples pushes ever harder
PRIORITY = 1  # of real time
NICENESS = -10


class Peer:
    def __init__(self, configuration: Configuration, world: World, seed: int) -> None:
        self.ticker = Ticker(STEP_S)
        self._locks = lock_buses(configuration.bus, BusRole.DRIVES)
        self._ports = open_ports(configuration.bus)
        self.robot = SimulatedRobot(
            world.plant(configuration),
            world.track,
            world.drives(configuration, watchdog_s=WATCHDOG_S),
            configuration.bus_of,
            self._ports,
            seed,
            start_s=self.ticker.wait().now_s,
        )
        self._pose = PoseBroadcast(configuration.pose, seed + 1)
        self.ended = False

    def end(self, number: int, frame: object) -> None:
        """A signal handler."""
        self.ended = True

    def run(self) -> None:
        while not self.ended:
            self.step(self.ticker.wait().now_s)
        self.close()

    def step(self, now_s: float) -> None:
        """Simulate until now.

        In time that the simulation has lost the joints come to rest. That agrees with the mean of two speeds, by which
        monitors judge an angle, and no joint gains energy against its torque; none looks back beyond LONGEST_GAP_S.
        """
        elapsed_s = now_s - self.robot.now_s
        if elapsed_s > LONGEST_CATCH_UP_S:
            self.robot.plant.come_to_rest(min(elapsed_s, LONGEST_GAP_S))
            self.robot.now_s = now_s
        self.robot.advance(now_s)
        self._pose.step(now_s, self.robot.plant)

    def close(self) -> None:
        self._pose.close()
        for port in self._ports.values():
            port.close()
        self._locks.close()


def track_of(waters: Sequence[str]) -> Track:
    """Return compartments of the named water contents, one after the other."""
    return Track([(COMPARTMENT_M, MUDS[water]) for water in waters])


class Ground(NamedTuple):
    """Where the robot is: on muds of these water contents, in the world of a file, or on blocks in the air."""

    waters: Sequence[str] | None = None
    world: Path | None = None
    on_blocks: bool = False

    def make_world(self, configuration: Configuration) -> World:
        """Raise ConfigurationError."""
        if self.on_blocks:
            return on_blocks(configuration)
        return load_world(self.world) if self.world else World(track_of(self.waters or list(MUDS)))


def take_precedence(cpu: int) -> None:
    """Raise this process's priority where it is permitted, and of few processors take the one that the daemon has.

    A real robot does not wait for its computer. On a single processor it stays out of real time: a simulation that
    cannot keep up would block all other processes.
    """
    processors = len(os.sched_getaffinity(0))
    with suppress(PermissionError):
        if processors > 1:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        else:
            os.nice(NICENESS)
    if cpu >= 0 and processors <= FEW_PROCESSORS:
        pin(cpu)  # refused where it is a processor of another computer


def simulate(configuration: Configuration, ground: Ground, seed: int, announce: Callable[[], object] = bool) -> int:
    """Simulate the robot until a signal ends the process; return the exit status.

    `announce` is called once the robot has its buses: another one that is simulated on them is left alone.
    """
    try:
        peer = Peer(configuration, ground.make_world(configuration), seed)
        _obey_signals(peer)
        announce()
    except ConfigurationError as problem:
        return _refuse(*problem.problems, status=EXIT_CONFIGURATION)
    except BusError as problem:
        taken = isinstance(problem.__cause__, BusTakenError)
        remedy = "--bus NAME' makes another robot" if taken else "--config FILE --local' needs none of its interfaces"
        return _refuse(f"{problem}. 'mudskipper simulate {remedy}")
    except OSError as problem:
        return _refuse(f"the pose source cannot be provided on this computer: {problem.strerror or problem}")
    take_precedence(configuration.loop.cpu)
    peer.run()
    return 0


def _obey_signals(peer: Peer) -> None:
    signal.signal(signal.SIGUSR1, lambda number, frame: peer.robot.request_put_back())
    signal.signal(signal.SIGUSR2, lambda number, frame: peer.robot.turn_emergency_stop())
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, peer.end)


def _refuse(*messages: str, status: int = 1) -> int:
    print("\n".join(messages), file=sys.stderr)
    return status
