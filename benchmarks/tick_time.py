"""How long one whole tick takes while the robot walks, and where that time goes.

The simulated robot walks the paper's track adaptively, in step with the daemon's own loop, with four drives on two
buses. The robot computes between the ticks and outside of every figure; no tick waits for a deadline, so processor
and caches are warmer than on a robot (benchmarks.loop_jitter shows ticks that begin asleep). Three buses carry the
frames: python-can's in-process `virtual` interface, our mock bus without python-can, and the local bus's sockets.

Blocks of 1 s alternate between whole ticks, ticks marked at the beginning of every stage, and marked ticks without
a recorder. What marking costs is measured and taken off each stage; whole ticks carry one reading of the clock.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, new_parser, print_report, summary_us, verdict
from command_line.screen import table
from control.controller import WalkOrder
from control.modes import Mode
from control.records import JOINTS
from drivers.can_port import CanPort, open_port
from drivers.mock_bus import MockBus
from drivers.odrive_drives import OdriveDrives
from firmware_host.configuration import Configuration
from firmware_host.loop import Loop
from firmware_host.realtime import freeze_garbage
from firmware_host.recorder import NullRecorder, Recorder, Recording
from firmware_host.ticker import PERIOD_S, RATE_HZ, Beat
from simulation.lockstep import Lockstep, drives_of, plant_of
from simulation.robot import SimulatedRobot
from simulation.track import paper_track

BAR_US = 200.0
BLOCK_TICKS = round(RATE_HZ)
WARM_UP_S = 4.0  # the flippers are on their way to the start of the first stride for some of it
CALIBRATION_CALLS = 20000
STAGES = ("read", "pose", "estimate", "adapt", "mode", "controller", "limits", "command", "record")
MEANINGS = {
    "read": "drain the buses, decode",
    "pose": "simulated here",
    "estimate": "both flippers",
    "adapt": "no stride closes",
    "mode": "examine, request, next mode",
    "controller": "gait, inverse kinematics, PD",
    "limits": "",
    "command": "encode and send four torques",
    "record": "row packing and the pipe",
}


class Wiring(NamedTuple):
    """The two ends of every bus, by its name."""

    robot: dict[str, CanPort]
    loop: dict[str, CanPort]


def python_can_wiring(interface: str, buses: Iterable[str], folder: Path) -> Wiring:
    robot: dict[str, CanPort] = {}
    loop: dict[str, CanPort] = {}
    for name in buses:
        robot[name] = open_port(interface, str(folder / name), {})
        loop[name] = open_port(interface, str(folder / name), {})
    return Wiring(robot, loop)


def virtual_wiring(buses: Iterable[str], folder: Path) -> Wiring:
    return python_can_wiring("virtual", buses, folder)


def mock_wiring(buses: Iterable[str], folder: Path) -> Wiring:
    mocks = {name: MockBus() for name in buses}
    robot = {name: mock.open() for name, mock in mocks.items()}
    return Wiring(dict(robot), {name: mock.open() for name, mock in mocks.items()})


def local_wiring(buses: Iterable[str], folder: Path) -> Wiring:
    return python_can_wiring("mudskipper_local", buses, folder)


VARIANTS: dict[str, Callable[[Iterable[str], Path], Wiring]] = {
    "virtual": virtual_wiring,
    "mock": mock_wiring,
    "local": local_wiring,
}


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


class StageMarks:
    """Reads the clock whenever a tick enters a stage; a stage lasts until the next one begins."""

    def __init__(self, loop: Loop) -> None:
        self.moments_s: list[float] = []
        self._entries: tuple[tuple[Any, str], ...] = (
            (loop.drives, "read"),
            (loop.pose, "read"),
            (loop.learning, "update"),
            (loop, "_adapt"),
            (loop, "_examine"),
            (loop.controller, "step"),
            (loop, "_limit"),
            (loop, "_command"),
            (loop, "_record"),
        )

    @contextmanager
    def attached(self) -> Iterator[None]:
        for owner, name in self._entries:
            setattr(owner, name, self.marked(getattr(owner, name)))
        yield
        for owner, name in self._entries:
            delattr(owner, name)

    def marked(self, method: Callable[..., Any]) -> Callable[..., Any]:
        mark = self.moments_s.append

        def marked_method(*arguments: Any) -> Any:
            mark(perf_counter())
            return method(*arguments)

        return marked_method


def marking_cost_s(marks: StageMarks) -> float:
    """What one mark adds to the stage that it begins and to the one that it ends."""

    def nothing(argument: object) -> None:
        return None

    plain_s, marked_s = _call_s(nothing), _call_s(marks.marked(nothing))
    marks.moments_s.clear()
    return max(0.0, marked_s - plain_s)


def _call_s(method: Callable[[object], None]) -> float:
    rounds = []
    for _ in range(5):
        start_s = perf_counter()
        for _ in range(CALIBRATION_CALLS // 5):
            method(None)
        rounds.append((perf_counter() - start_s) * 5 / CALIBRATION_CALLS)
    return median(rounds)


class Samples:
    """Durations in seconds. Only ticks that close a stride choose a depth: their `adapt` is kept apart."""

    def __init__(self) -> None:
        self.whole: list[float] = []
        self.whole_closing: list[float] = []  # of those, the ones that close a stride
        self.stages: dict[str, list[float]] = {stage: [] for stage in STAGES}
        self.adapt_closing: list[float] = []
        self.record_unrecorded: list[float] = []


class TimedWalk:
    """A robot that walks in lockstep over the given wiring, and the clock beside its ticks."""

    def __init__(self, configuration: Configuration, wiring: Wiring, recorder: Recording) -> None:
        self.walk = Lockstep(configuration, paper_track())
        self.walk.robot = SimulatedRobot(
            plant_of(configuration),
            paper_track(),
            drives_of(configuration),
            {joint: configuration.drive[joint].bus for joint in JOINTS},
            wiring.robot,
        )
        drives = OdriveDrives(configuration.drive, wiring.loop, configuration.limits, configuration.watchdog_endpoints)
        pose, clock = self.walk.loop.pose, lambda: self.walk.now_s
        self.walk.loop = Loop(configuration, drives, pose, recorder, clock)
        self.recorder = recorder
        self.marks = StageMarks(self.walk.loop)
        self.traffic = Traffic(wiring.loop.values())
        self.samples = Samples()

    def warm_up(self) -> None:
        """Walk for a while; the second half of it counts the frames."""
        self.walk.arm()
        self.walk.walk(WalkOrder(self.walk.loop.configuration.adaptation.initial_depth_m))
        self.walk.run_for(WARM_UP_S / 2.0)
        with self.traffic.attached():
            self.walk.run_for(WARM_UP_S / 2.0)
        self.marking_s = marking_cost_s(self.marks)
        freeze_garbage()

    def run_blocks(self) -> None:
        """One block of each kind."""
        for _ in range(BLOCK_TICKS):
            duration_s, closing = self._tick()
            self.samples.whole.append(duration_s)
            if closing:
                self.samples.whole_closing.append(duration_s)
        with self.marks.attached():
            for _ in range(BLOCK_TICKS):
                self._keep_stages(*self._marked_tick())
            self.walk.loop.recorder = NullRecorder()
            for _ in range(BLOCK_TICKS):
                stages, _ = self._marked_tick()
                self.samples.record_unrecorded.append(stages["record"])
        self.walk.loop.recorder = self.recorder
        if self.walk.loop.mode is not Mode.WALKING:
            raise RuntimeError(f"the robot does not walk any more: {self.walk.loop.fault}")

    def _tick(self) -> tuple[float, bool]:
        """Duration of one whole tick, and whether it closed a stride."""
        walk = self.walk
        walk.tick_number += 1
        walk.robot.advance(walk.now_s)
        beat, closed_before = Beat(walk.now_s, 0.0, walk.tick_number, 0), walk.loop.learning.strides_closed
        start_s = perf_counter()
        walk.loop.tick(beat)
        return perf_counter() - start_s, walk.loop.learning.strides_closed > closed_before

    def _marked_tick(self) -> tuple[dict[str, float], bool]:
        moments_s = self.marks.moments_s
        moments_s.clear()
        _, closing = self._tick()
        moments_s.append(perf_counter())
        durations_s = (max(0.0, end_s - start_s - self.marking_s) for start_s, end_s in pairwise(moments_s))
        return dict(zip(STAGES, durations_s, strict=True)), closing

    def _keep_stages(self, stages: dict[str, float], closing: bool) -> None:
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
            "record_unrecorded_us": summary_us(samples.record_unrecorded),
            "marking_us": round(1e6 * self.marking_s, 3),
            "frames_received": round(self.traffic.received / ticks, 2),
            "frames_sent": round(self.traffic.sent / ticks, 2),
            "dropped_rows": self.recorder.dropped,
        }


def measure(variant: str, seconds: int, progress: Progress, done: int) -> dict[str, Any]:
    configuration = load_example()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-")))
        wiring = VARIANTS[variant](configuration.bus, folder)
        for port in (*wiring.robot.values(), *wiring.loop.values()):
            stack.callback(port.close)
        recorder = Recorder(folder / "walk.mcap", configuration.text, {})
        stack.callback(recorder.close, timeout_s=10.0)
        walk = TimedWalk(configuration, wiring, recorder)
        progress.show(done, f"{variant} bus, warming up")
        walk.warm_up()
        for second in range(seconds):
            progress.show(done + second, f"{variant} bus")
            walk.run_blocks()
        return walk.report()


def text_of(report: dict[str, Any]) -> str:
    lines = []
    for variant, figures in report["variants"].items():
        frames = f"{figures['frames_received']:.1f} frames in and {figures['frames_sent']:.1f} out per tick"
        marking = f"marking a stage costs {figures['marking_us']:.2f} us, taken off"
        lines += [f"{variant} bus: {frames}; {marking}", table(_rows(figures)), ""]
    return "\n".join([*lines, report["verdict"]])


def _rows(figures: dict[str, Any]) -> list[list[str]]:
    whole, closing, adapting = figures["whole_us"], figures["whole_closing_us"], figures["adapt_closing_us"]
    rows = [["us", "median", "p99", "max", ""], _row("whole tick", whole, f"all {whole['ticks']} ticks")]
    rows.append(_row("whole tick, closing", closing, f"{closing['ticks']} ticks that close a stride"))
    rows += [_row(f"  {stage}", figures["stages_us"][stage], meaning) for stage, meaning in MEANINGS.items()]
    rows.append(_row("  adapt, closing", adapting, f"{adapting['ticks']} ticks that choose a depth"))
    rows.append(_row("  record, no recorder", figures["record_unrecorded_us"], "row packing alone"))
    return rows


def _row(name: str, figures: dict[str, float], meaning: str) -> list[str]:
    return [name, *(f"{figures[key]:7.1f}" for key in ("median", "p99", "max")), meaning]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("tick_time", __doc__)
    parser.add_argument("--seconds", type=int, default=20, help="of simulated walking behind each figure")
    parser.add_argument("--bus", action="append", choices=VARIANTS, help="measure only this one; repeatable")
    options = parser.parse_args(arguments)
    variants = options.bus or list(VARIANTS)
    progress = Progress(len(variants) * options.seconds)
    measured = {
        variant: measure(variant, options.seconds, progress, place * options.seconds)
        for place, variant in enumerate(variants)
    }
    progress.clear()
    report: dict[str, Any] = {"benchmark": "tick_time", "seconds": options.seconds, "variants": measured}
    judged = "virtual" if "virtual" in measured else variants[0]
    reached = measured[judged]["whole_us"]["median"] <= BAR_US
    bar = f"median whole tick over the {judged} bus at most {BAR_US:.0f} us"
    report |= {"bar_us": BAR_US, "reached": reached, "verdict": verdict(bar, reached)}
    print_report(report, text_of(report), options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
