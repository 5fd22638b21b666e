"""A robot that walks in lockstep over given wiring, with its ticks timed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from time import perf_counter
from typing import Any

from benchmarks.report import summary_us
from benchmarks.speed.stage_marks import STAGES, StageMarks, marking_cost_s
from benchmarks.speed.wirings import Wiring
from control.controller import WalkOrder
from control.modes import Mode
from control.rate import PERIOD_S, RATE_HZ
from control.records import JOINTS
from drivers.can.can_port import CanPort
from drivers.drive_types import make_drives
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recording
from firmware_host.loop import Loop
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep, drives_of, plant_of
from simulation.harness.robot import SimulatedRobot
from simulation.mud.track import paper_track

BLOCK_TICKS = round(RATE_HZ)
WARM_UP_S = 4.0  # part of it moves the flippers to the start of the first stride


class Traffic:
    """Counts the frames that pass the loop's ports while it is attached to them."""

    def __init__(self, ports: Iterable[CanPort]) -> None:
        self.received = self.sent = 0
        self._ports = tuple(ports)

    @contextmanager
    def attached(self) -> Iterator[None]:
        for port in self._ports:
            self._count(port)
        yield
        for port in self._ports:
            del port.receive, port.send

    def _count(self, port: CanPort) -> None:
        receive, send = port.receive, port.send

        def counted_receive() -> Sequence[Any]:
            frames = receive()
            self.received += len(frames)
            return frames

        def counted_send(frame: Any) -> None:
            self.sent += 1
            send(frame)

        vars(port).update(receive=counted_receive, send=counted_send)


class Samples:
    """Durations in seconds. Only ticks that close a stride choose a depth: their `adapt` is separate."""

    def __init__(self) -> None:
        self.whole: list[float] = []
        self.whole_closing: list[float] = []  # of those, the ones that close a stride
        self.stages: dict[str, list[float]] = {stage: [] for stage in STAGES}
        self.adapt_closing: list[float] = []


class TimedWalk:
    """Owns the walk and its measured durations."""

    def __init__(self, configuration: Configuration, wiring: Wiring, recorder: Recording) -> None:
        self.walk = Lockstep(configuration, paper_track())
        self.walk.robot = SimulatedRobot(
            plant_of(configuration),
            paper_track(),
            drives_of(configuration),
            {joint: configuration.drive[joint].bus for joint in JOINTS},
            wiring.robot,
        )
        drives = make_drives(configuration.drive, wiring.loop, configuration.limits, configuration.watchdog_endpoints)
        pose, clock = self.walk.loop.pose, lambda: self.walk.now_s
        self.walk.loop = Loop(configuration, drives, pose, recorder, clock)
        self.recorder = recorder
        self.marks = StageMarks(self.walk.loop)
        self.traffic = Traffic(wiring.loop.values())
        self.samples = Samples()

    def warm_up(self) -> None:
        """Walks for a while; the second half of it counts the frames."""
        self.walk.arm()
        self.walk.walk(WalkOrder(self.walk.loop.configuration.adaptation.initial_depth_m))
        self.walk.run_for(WARM_UP_S / 2.0)
        with self.traffic.attached():
            self.walk.run_for(WARM_UP_S / 2.0)
        self.marking_s = marking_cost_s(self.marks)
        freeze_garbage()

    def run_blocks(self) -> None:
        """Runs one block of each kind."""
        for _ in range(BLOCK_TICKS):
            duration_s, closing = self._tick()
            self.samples.whole.append(duration_s)
            if closing:
                self.samples.whole_closing.append(duration_s)
        with self.marks.attached():
            for _ in range(BLOCK_TICKS):
                self._add_stages(*self._marked_tick())
        if self.walk.loop.mode is not Mode.WALKING:
            raise RuntimeError(f"the robot does not walk any more: {self.walk.loop.fault}")

    def _tick(self) -> tuple[float, bool]:
        """Returns the duration of one whole tick, and whether it closed a stride."""
        walk = self.walk
        walk.tick_number += 1
        walk.robot.advance(walk.now_s)
        tick, closed_before = Tick(walk.now_s, 0.0, walk.tick_number, 0), walk.loop.learning.strides_closed
        start_s = perf_counter()
        walk.loop.tick(tick)
        return perf_counter() - start_s, walk.loop.learning.strides_closed > closed_before

    def _marked_tick(self) -> tuple[dict[str, float], bool]:
        moments_s = self.marks.moments_s
        moments_s.clear()
        _, closing = self._tick()
        moments_s.append(perf_counter())
        durations_s = (max(0.0, end_s - start_s - self.marking_s) for start_s, end_s in pairwise(moments_s))
        return dict(zip(STAGES, durations_s, strict=True)), closing

    def _add_stages(self, stages: dict[str, float], closing: bool) -> None:
        for stage, duration_s in stages.items():
            if closing and stage == "adapt":
                self.samples.adapt_closing.append(duration_s)
            else:
                self.samples.stages[stage].append(duration_s)

    def report(self) -> dict[str, Any]:
        samples, ticks = self.samples, WARM_UP_S / 2.0 / PERIOD_S
        return {
            "whole_us": summary_us(samples.whole) | {"ticks": len(samples.whole)},
            "whole_closing_us": summary_us(samples.whole_closing) | {"ticks": len(samples.whole_closing)},
            "stages_us": {stage: summary_us(durations_s) for stage, durations_s in samples.stages.items()},
            "adapt_closing_us": summary_us(samples.adapt_closing) | {"ticks": len(samples.adapt_closing)},
            "marking_us": round(1e6 * self.marking_s, 3),
            "frames_received": round(self.traffic.received / ticks, 2),
            "frames_sent": round(self.traffic.sent / ticks, 2),
            "dropped_rows": self.recorder.dropped,
        }
