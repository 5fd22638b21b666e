"""Malformed and unexpected CAN frames on the buses: random and mutated ones, through drives and whole ticks.

Frames are those of four drives with flipped bits, removed or added bytes, non-finite numbers, other ids, remote,
extended or error marks; random ones; and bursts of one frame, as a babbling node sends. Half of them pass through
`OdriveDrives.read`, half through `Loop.tick`: half of these in boot, where one drive's heartbeats never come, and half
in idle, among the true messages of simulated drives. No exception may be raised, resident memory must not grow, and the
only frames that may leave for a drive are zero torque, idle, and requests for version and settings.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from struct import pack
from time import perf_counter
from typing import Any

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from benchmarks.stress.resources import resident_kib
from control.modes import Mode
from control.rate import PERIOD_S
from control.records import JOINTS, Joints
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus, MockPort
from drivers.drive_types import make_drives
from drivers.odrive import codec
from drivers.odrive.codec import arbitration_id
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.configuration import Configuration
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

FRAMES_PER_TICK = 40  # three times what four drives send
BABBLE_FRAMES = 400
BABBLE_FRACTION = 0.001
BAR_KIB = 1024.0
WARM_UP_FRACTION = 0.1  # of the frames, before the first reading of memory
NUMBERS = [float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1e38, -3.4e38, 1e-45, 0.5]
STAMPS_S = [0.0, 1e9, -1.0, float("nan")]
REPORTED = [
    (codec.GET_ENCODER_ESTIMATES, (0.1, 0.0)),
    (codec.GET_IQ, (0.0, 0.5)),
    (codec.HEARTBEAT, (0, 1, 0, 0)),
    (codec.GET_ERROR, (0, 0)),
    (codec.GET_TEMPERATURE, (30.0, 30.0)),
    (codec.GET_BUS_VOLTAGE_CURRENT, (24.0, 0.0)),
    (codec.GET_VERSION, (2, 0, 0, 0, 0, 6, 11, 0)),
]
ZERO_TORQUES = {bytes(4), bytes.fromhex("00000080")}


def true_frames(node_ids: list[int]) -> list[Frame]:
    frames = [
        Frame(arbitration_id(node, message), message.encode(*values))
        for node in node_ids
        for message, values in REPORTED
    ]
    setting = codec.TX_SDO.encode(0, 1, 0) + codec.SDO_FLOAT.pack(0.1)
    return frames + [Frame(arbitration_id(node, codec.TX_SDO), setting) for node in node_ids]


class FrameSource:
    """Endless malformed frames; the same seed gives the same frames."""

    def __init__(self, node_ids: list[int], seed: int, without: int = -1) -> None:
        self._random = Random(seed)
        self._without = without  # an id
        self._true = true_frames(node_ids)

    def __iter__(self) -> Iterator[Frame]:
        random = self._random
        makers = (self._flipped, self._resized, self._no_number, self._readdressed, self._marked, self._random_frame)
        while True:
            frame = random.choice(makers)(random.choice(self._true))
            if frame.arbitration_id == self._without:
                continue
            copies = BABBLE_FRAMES if random.random() < BABBLE_FRACTION else 1
            for _ in range(copies):
                yield frame

    def _flipped(self, frame: Frame) -> Frame:
        data = bytearray(frame.data)
        for _ in range(self._random.randint(1, 4)):
            data[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return frame._replace(data=bytes(data))

    def _resized(self, frame: Frame) -> Frame:
        return frame._replace(data=(frame.data + self._random.randbytes(8))[: self._random.randint(0, 8)])

    def _no_number(self, frame: Frame) -> Frame:
        return frame._replace(data=pack("<ff", self._random.choice(NUMBERS), self._random.choice(NUMBERS)))

    def _readdressed(self, frame: Frame) -> Frame:
        return frame._replace(arbitration_id=self._random.randrange(0x800))

    def _marked(self, frame: Frame) -> Frame:
        remote, error, extended = (self._random.random() < 0.5 for _ in range(3))
        identifier = self._random.randrange(0x20000000) if extended else frame.arbitration_id
        return Frame(identifier, frame.data, remote, error, extended, self._random.choice(STAMPS_S))

    def _random_frame(self, frame: Frame) -> Frame:
        data = self._random.randbytes(self._random.randint(0, 8))
        return Frame(self._random.randrange(0x800), data, self._random.random() < 0.1)


@dataclass
class Fuzzing:
    """The results of one part."""

    frames: int = 0
    exceptions: list[str] = field(default_factory=list)
    forbidden: list[str] = field(default_factory=list)  # frames that left
    left: int = 0  # frames that left at all
    refused: int = 0
    readings_kib: list[float] = field(default_factory=list)
    left_mode: int = 0  # ticks in another mode than the one asked for

    def on_sent(self, frames: list[Frame]) -> None:
        self.left += len(frames)
        for frame in frames:
            if is_forbidden(frame) and len(self.forbidden) < 10:
                self.forbidden.append(f"0x{frame.arbitration_id:03x} {frame.data.hex(' ')}")


def is_forbidden(frame: Frame) -> bool:
    """Returns whether a disarmed robot's frame could move a drive: any but zero torque, idle and requests."""
    command = frame.arbitration_id & 0x1F
    if frame.is_extended or frame.is_error:
        return True
    if frame.is_remote:
        return command != codec.GET_VERSION.command
    if command == codec.SET_INPUT_TORQUE.command:
        return frame.data not in ZERO_TORQUES
    if command == codec.SET_AXIS_STATE.command:
        return frame.data != codec.SET_AXIS_STATE.encode(codec.AxisState.IDLE)
    return command != codec.RX_SDO.command or frame.data[:1] != b"\0"


def fuzz_drives(configuration: Configuration, frames: int, fuzzing: Fuzzing, progress: Progress, seed: int) -> None:
    """Feeds the drives alone."""
    buses = {name: MockBus() for name in configuration.bus}
    far = {name: bus.open() for name, bus in buses.items()}
    wires = {name: bus.open() for name, bus in buses.items()}
    drives = make_drives(configuration.drive, wires, configuration.limits, configuration.watchdog_endpoints)
    source = iter(FrameSource(node_ids(configuration), seed))
    for number in range(frames // FRAMES_PER_TICK):
        feed(source, far, fuzzing)
        now_s = number * PERIOD_S
        try:
            drives.read(now_s)
            drives.request_settings(now_s)
            drives.disarm(now_s)
            drives.send(Joints(0.0, 0.0, 0.0, 0.0), PERIOD_S)
        except Exception as problem:  # noqa: BLE001  that none comes is what is measured
            fuzzing.exceptions.append(repr(problem))
        inspect(fuzzing, far, number, frames // FRAMES_PER_TICK)
        progress.show(fuzzing.frames, "drives")
    fuzzing.refused += drives.refused_commands


def fuzz_loop(
    configuration: Configuration, frames: int, mode: Mode, fuzzing: Fuzzing, progress: Progress, seed: int
) -> None:
    """Feeds whole ticks: in idle next to a running simulated robot, in boot with one drive's heartbeats missing."""
    walk = Lockstep(configuration, Track([(1.0, MUDS["48.5"])]), seed)
    far = {name: open_third_node(walk, name) for name in configuration.bus}
    missing = arbitration_id(node_ids(configuration)[0], codec.HEARTBEAT) if mode is Mode.BOOT else -1
    source = iter(FrameSource(node_ids(configuration), seed, missing))
    ticks = frames // FRAMES_PER_TICK
    if mode is Mode.IDLE:
        walk.run_until(lambda: walk.loop.mode is Mode.IDLE, 2.0)
    for port in far.values():
        port.receive()
    for number in range(ticks):
        feed(source, far, fuzzing)
        try:
            step(walk, mode)
        except Exception as problem:  # noqa: BLE001
            fuzzing.exceptions.append(repr(problem))
        fuzzing.left_mode += walk.loop.mode is not mode
        inspect(fuzzing, far, number, ticks)
        progress.show(fuzzing.frames, mode.name.lower())
    fuzzing.refused += walk.loop.drives.refused_commands


def step(walk: Lockstep, mode: Mode) -> None:
    if mode is Mode.IDLE:
        walk.step()
        return
    walk.tick_number += 1
    walk.loop.tick(Tick(walk.now_s, 0.0, walk.tick_number, 0))


def node_ids(configuration: Configuration) -> list[int]:
    return [configuration.drive[joint].node_id for joint in JOINTS]


def open_third_node(walk: Lockstep, bus: str) -> MockPort:
    """Opens a third node on a bus of the loop."""
    port = walk.loop.drives.ports[bus]
    assert isinstance(port, MockPort)
    return port.open_peer()


def feed(source: Iterator[Frame], far: dict[str, MockPort], fuzzing: Fuzzing) -> None:
    ports = list(far.values())
    for index in range(FRAMES_PER_TICK):
        ports[index % len(ports)].send(next(source))
    fuzzing.frames += FRAMES_PER_TICK


def inspect(fuzzing: Fuzzing, far: dict[str, MockPort], number: int, ticks: int) -> None:
    """Inspects the frames that left, and ten times the memory."""
    for port in far.values():
        fuzzing.on_sent([frame for frame in port.receive() if is_ours(frame)])
    if number >= WARM_UP_FRACTION * ticks and number % max(1, ticks // 10) == 0:
        fuzzing.readings_kib.append(resident_kib())


def is_ours(frame: Frame) -> bool:
    """Returns whether the loop sent a frame; the simulated drives send answers and cyclic messages on the same bus."""
    reported = {message.command for message, _ in REPORTED} | {codec.TX_SDO.command}
    return frame.is_remote or frame.arbitration_id & 0x1F not in reported


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    frames, seed, progress = options.frames, options.seed, Progress(options.frames)
    configuration = load_example()
    freeze_garbage()
    parts: dict[str, dict[str, Any]] = {}
    for index, (name, fraction, mode) in enumerate(
        (("drives", 0.5, None), ("boot", 0.25, Mode.BOOT), ("idle", 0.25, Mode.IDLE))
    ):
        fuzzing, started_s, number = Fuzzing(), perf_counter(), round(fraction * frames)
        if mode is None:
            fuzz_drives(configuration, number, fuzzing, progress, seed + index)
        else:
            fuzz_loop(configuration, number, mode, fuzzing, progress, seed + index)
        readings = fuzzing.readings_kib or [0.0]
        parts[name] = {
            "frames": fuzzing.frames,
            "exceptions": len(fuzzing.exceptions),
            "first_exceptions": fuzzing.exceptions[:3],
            "forbidden": fuzzing.forbidden,
            "frames_sent": fuzzing.left,
            "refused_by_the_gate": fuzzing.refused,
            "ticks_in_another_mode": fuzzing.left_mode,
            "growth_kib": round(readings[-1] - readings[0], 1),
            "seconds": round(perf_counter() - started_s, 1),
        }
    clean = not any(part["exceptions"] or part["forbidden"] or part["ticks_in_another_mode"] for part in parts.values())
    flat = all(part["growth_kib"] < BAR_KIB for part in parts.values())
    bar = f"no exception, no torque, no closed loop, memory within {BAR_KIB:g} KiB"
    return evaluated({"parts": parts}, bar, clean and flat)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.stress.can_fuzz", __doc__)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    return run_benchmark(parser, arguments, measure, finds_defects=True)


if __name__ == "__main__":
    sys.exit(main())
