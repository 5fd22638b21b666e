"""A robot that walks in lockstep over a given kind of bus, with a log, and the durations of its ticks.

The robot computes between the ticks and outside of every figure. Hot ticks follow each other at once, so processor and
caches are warmer than on a robot; before each cold tick the processor sleeps for a period. The bare sockets give the
least that a tick over sockets can cost: they read and send as many datagrams as the tick does frames, of a CAN frame's
size and by `recv` and `send` alone.
"""

import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from statistics import median
from time import perf_counter, sleep
from typing import Any

from control.controller import WalkOrder
from control.modes import Mode
from control.rate import PERIOD_S, RATE_HZ
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from firmware_host.software_version import is_compiled
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.benchmark import Report
from verification.wiring import PortPair, open_wiring

BLOCK_TICKS = round(RATE_HZ)
COLD_FRACTION = 4  # one cold tick for so many hot ones, because they take real time
WARM_UP_S = 2.0  # to the end of the first stride
FRAME_BYTES = 16  # of a classic CAN frame, as the kernel passes it on
STAGES = {  # in their order, by the loop's method that begins each
    "read": "drives.read",  # drain the buses, decode
    "pose": "pose.read",  # simulated here
    "estimate": "learning.update",  # both flippers
    "adapt": "learning.adapt",  # an insertion that meets solid mud ends
    "mode": "_examine",  # examine, request, next mode
    "controller": "controller.step",  # gait, inverse kinematics, PD
    "limits": "_limit",
    "command": "_command",  # encode and send four torques
    "learn": "learning.step",  # after the command: one unit of the work at a stride's ends
    "record": "_record",  # row packing and the pipe
}


class CountedPort:
    """Passes everything on to the robot's port, outside of the ticks, and counts its frames."""

    def __init__(self, port: CanPort) -> None:
        self._port = port
        self.received = self.sent = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    def receive(self) -> Any:
        frames = self._port.receive()
        self.received += len(frames)
        return frames

    def send(self, frame: Frame) -> None:
        self.sent += 1
        self._port.send(frame)


class OpenedBus:
    """A bus whose two ends are open already: the robot's and the loop's."""

    def __init__(self, robot: CountedPort, loop: CanPort) -> None:
        self._ends = [loop, robot]

    def open(self) -> Any:
        return self._ends.pop()


class BareSockets:
    """Owns a pair of sockets for each bus, which carry the given mean numbers of received and sent frames a tick."""

    def __init__(self, buses: list[tuple[float, float]]) -> None:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in buses]
        self._buses = [
            (*pair, round(received), round(sent)) for pair, (received, sent) in zip(pairs, buses, strict=True)
        ]
        self._frame = bytes(FRAME_BYTES)

    def time_tick(self) -> float:
        """Return the time in which the sockets read and send the frames of one tick."""
        for far, _, received, _ in self._buses:
            for _ in range(received):
                far.send(self._frame)
        start_s = perf_counter()
        for _, near, received, sent in self._buses:
            for _ in range(received):
                near.recv(FRAME_BYTES)
            for _ in range(sent):
                near.send(self._frame)
        duration_s = perf_counter() - start_s
        for far, _, _, sent in self._buses:
            for _ in range(sent):
                far.recv(FRAME_BYTES)
        return duration_s

    def close(self) -> None:
        for far, near, *_ in self._buses:
            far.close()
            near.close()


class TimedWalk:
    """Owns the walk, the bare sockets that carry as many frames, and the measured durations in seconds."""

    def __init__(self, configuration: Configuration, wiring: dict[str, PortPair], recorder: Recorder) -> None:
        self.recorder = recorder
        robot_ports = {name: CountedPort(robot) for name, (robot, _) in wiring.items()}
        buses = {name: OpenedBus(robot_ports[name], loop) for name, (_, loop) in wiring.items()}
        self.walk = Lockstep(configuration, paper_track(), recorder=recorder, buses=buses)
        self._warm_up()
        before = [(port.received, port.sent) for port in robot_ports.values()]
        for _ in range(BLOCK_TICKS):
            self._tick()
        self.bare = BareSockets(
            [
                ((port.sent - sent) / BLOCK_TICKS, (port.received - received) / BLOCK_TICKS)
                for port, (received, sent) in zip(robot_ports.values(), before, strict=True)
            ]
        )
        self.durations_s: dict[str, list[float]] = {name: [] for name in ("whole", "longest", "cold", "bare_sockets")}
        self.stages_s: dict[str, list[float]] = {stage: [] for stage in STAGES}
        self._moments_s: list[float] = []

    def _warm_up(self) -> None:
        """Arm by force where drives cannot report their watchdogs, as an operator has to."""
        configuration = self.walk.loop.configuration
        self.walk.arm(
            forced="" if all(drive.knows_watchdog for drive in configuration.drive.values()) else "watchdog_unknown"
        )
        self.walk.walk(WalkOrder(configuration.adaptation.initial_depth_m))
        self.walk.run_for(WARM_UP_S)
        freeze_garbage()

    def run_blocks(self) -> None:
        """Run one block of each kind. `longest` gets the longest tick of each end of an insertion or a stride."""
        block = [self._tick() for _ in range(BLOCK_TICKS)]
        self.durations_s["whole"] += [duration_s for duration_s, _ in block]
        runs = [(worked, [duration_s for duration_s, _ in ticks]) for worked, ticks in groupby(block, itemgetter(1))]
        self.durations_s["longest"] += [max(durations_s) for worked, durations_s in runs[1:-1] if worked]
        self.durations_s["bare_sockets"] += [self.bare.time_tick() for _ in range(BLOCK_TICKS)]
        for _ in range(BLOCK_TICKS // COLD_FRACTION):
            sleep(PERIOD_S)
            self.durations_s["cold"].append(self._tick()[0])
        if not is_compiled():
            self._run_marked_block()
        if self.walk.loop.mode is not Mode.WALKING:
            raise RuntimeError(f"the robot does not walk any more: {self.walk.loop.fault}")

    def _tick(self) -> tuple[float, bool]:
        """Return the duration of one whole tick, and whether it had work of the end of an insertion or a stride."""
        walk = self.walk
        walk.tick_number += 1
        walk.robot.advance(walk.now_s)
        tick, work = Tick(walk.now_s, 0.0, walk.tick_number, 0), walk.loop.learning.estimator.work
        worked = not work.is_empty
        start_s = perf_counter()
        walk.loop.tick(tick)
        return perf_counter() - start_s, worked or not work.is_empty

    # the stages

    def _run_marked_block(self) -> None:
        """Run ticks that are marked at the beginning of every stage; a stage contains one mark, some 0.2 us."""
        with self._stages_marked():
            for _ in range(BLOCK_TICKS):
                self._moments_s.clear()
                self._tick()
                self._moments_s.append(perf_counter())
                for stage, (start_s, end_s) in zip(STAGES, pairwise(self._moments_s), strict=True):
                    self.stages_s[stage].append(end_s - start_s)

    @contextmanager
    def _stages_marked(self) -> Iterator[None]:
        """Wrap the loop's own methods, so the loop knows nothing of it; compiled methods cannot be wrapped."""
        loop, entries = self.walk.loop, []
        for path in STAGES.values():
            part, _, name = path.rpartition(".")
            entries.append((getattr(loop, part) if part else loop, name))
        for owner, name in entries:
            setattr(owner, name, self._marked(getattr(owner, name)))
        yield
        for owner, name in entries:
            delattr(owner, name)

    def _marked(self, method: Callable[..., Any]) -> Callable[..., Any]:
        mark = self._moments_s.append

        def marked_method(*arguments: Any) -> Any:
            mark(perf_counter())
            return method(*arguments)

        return marked_method

    def report(self) -> Report:
        figures = {f"{name}_us": median_us(each) for name, each in self.durations_s.items()}
        stages_us = {stage: median_us(each) for stage, each in self.stages_s.items() if each}
        return figures | {"stages_us": stages_us, "dropped_rows": self.recorder.dropped}


def median_us(durations_s: list[float]) -> dict[str, float]:
    return {"median": round(1e6 * median(durations_s or [0.0]), 2), "count": len(durations_s)}


@contextmanager
def open_timed_walk(configuration: Configuration, bus: str, folder: Path) -> Iterator[TimedWalk]:
    """Open the wiring, the log in this folder, and the walk; close all of them at the end."""
    with ExitStack() as stack:
        fd = any(each.data_bit_rate_kbit_s > 0 for each in configuration.bus.values())
        wiring = stack.enter_context(open_wiring(bus, configuration.bus, fd))
        recorder = Recorder(folder / f"{bus}.mcap", configuration.text, {}, rig=configuration.rig)
        stack.callback(recorder.close, timeout_s=10.0)
        walk = TimedWalk(configuration, wiring, recorder)
        stack.callback(walk.bare.close)
        yield walk
