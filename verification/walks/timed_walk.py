"""A robot that walks in lockstep over given wiring, with its ticks timed."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import groupby, pairwise
from operator import itemgetter
from time import perf_counter, sleep
from typing import Any

from control.controller import WalkOrder
from control.modes import Mode
from control.rate import PERIOD_S, RATE_HZ
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recording
from firmware_host.loop import Loop
from firmware_host.software_version import is_compiled
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.report import summary_us
from verification.walks.wired_walk import wire
from verification.walks.wirings import Wiring

BLOCK_TICKS = round(RATE_HZ)
COLD_FRACTION = 4  # one cold tick for so many hot ones, because they take real time
WARM_UP_S = 2.0  # to the end of the first stride
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


class StageMarks:
    """Owns the times at which the current tick entered its stages; a stage lasts until the next begins.

    The loop's own methods are wrapped while the marks are attached, so the loop knows nothing of it. Methods that are
    compiled cannot be wrapped, so a compiled tick has no stages.
    """

    def __init__(self, loop: Loop) -> None:
        self.moments_s: list[float] = []
        paths = [path.rpartition(".") for path in STAGES.values()]
        self._entries = [(getattr(loop, part) if part else loop, name) for part, _, name in paths]

    @contextmanager
    def attached(self) -> Iterator[None]:
        for owner, name in self._entries:
            setattr(owner, name, self._marked(getattr(owner, name)))
        yield
        for owner, name in self._entries:
            delattr(owner, name)

    def _marked(self, method: Callable[..., Any]) -> Callable[..., Any]:
        mark = self.moments_s.append

        def marked_method(*arguments: Any) -> Any:
            mark(perf_counter())
            return method(*arguments)

        return marked_method


class Samples:
    """Durations in seconds."""

    def __init__(self) -> None:
        self.whole: list[float] = []
        self.longest: list[float] = []  # tick of each end of an insertion or of a stride
        self.cold: list[float] = []  # after the processor has slept for a period
        self.stages: dict[str, list[float]] = {stage: [] for stage in STAGES}


class TimedWalk:
    """Owns the walk and its measured durations."""

    def __init__(self, configuration: Configuration, wiring: Wiring, recorder: Recording) -> None:
        self.walk = Lockstep(configuration, paper_track())
        wire(self.walk, configuration, wiring, recorder)
        self.recorder = recorder
        self.marks = StageMarks(self.walk.loop)
        self.samples = Samples()

    def warm_up(self) -> None:
        """Arms by force where drives cannot report their watchdogs, as an operator has to."""
        configuration = self.walk.loop.configuration
        self.walk.arm(forced=not all(drive.reports_settings for drive in configuration.drive.values()))
        self.walk.walk(WalkOrder(configuration.adaptation.initial_depth_m))
        self.walk.run_for(WARM_UP_S)
        freeze_garbage()

    def run_blocks(self) -> None:
        """Runs one block of each kind."""
        block = [self.tick() for _ in range(BLOCK_TICKS)]
        self.samples.whole += [duration_s for duration_s, _ in block]
        runs = [(worked, [duration_s for duration_s, _ in ticks]) for worked, ticks in groupby(block, itemgetter(1))]
        self.samples.longest += [max(durations_s) for worked, durations_s in runs[1:-1] if worked]  # whole ones
        for _ in range(BLOCK_TICKS // COLD_FRACTION):
            sleep(PERIOD_S)
            self.samples.cold.append(self.tick()[0])
        if not is_compiled():
            self._run_marked_block()
        if self.walk.loop.mode is not Mode.WALKING:
            raise RuntimeError(f"the robot does not walk any more: {self.walk.loop.fault}")

    def _run_marked_block(self) -> None:
        with self.marks.attached():
            for _ in range(BLOCK_TICKS):
                self._add_stages(self._marked_tick())

    def tick(self) -> tuple[float, bool]:
        """Returns the duration of one whole tick, and whether it had work of the end of an insertion or a stride."""
        walk = self.walk
        walk.tick_number += 1
        walk.robot.advance(walk.now_s)
        tick, work = Tick(walk.now_s, 0.0, walk.tick_number, 0), walk.loop.learning.estimator.work
        worked = not work.is_empty
        start_s = perf_counter()
        walk.loop.tick(tick)
        duration_s = perf_counter() - start_s
        return duration_s, worked or not work.is_empty

    def _marked_tick(self) -> dict[str, float]:
        moments_s = self.marks.moments_s
        moments_s.clear()
        self.tick()
        moments_s.append(perf_counter())
        durations_s = (end_s - start_s for start_s, end_s in pairwise(moments_s))
        return dict(zip(STAGES, durations_s, strict=True))

    def _add_stages(self, stages: dict[str, float]) -> None:
        for stage, duration_s in stages.items():
            self.samples.stages[stage].append(duration_s)

    def report(self) -> dict[str, Any]:
        samples, ends = self.samples, len(self.samples.longest)
        return {
            "whole_us": summary_us(samples.whole) | {"ticks": len(samples.whole)},
            "longest_us": summary_us(samples.longest) | {"ends": ends},
            "cold_us": summary_us(samples.cold) | {"ticks": len(samples.cold)},
            "stages_us": {stage: summary_us(each) for stage, each in samples.stages.items() if each},
            "dropped_rows": self.recorder.dropped,
        }
