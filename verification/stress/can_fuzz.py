"""Malformed and unexpected CAN frames on the buses: random and mutated ones, through whole ticks of the loop.

Frames are those of four simulated drives with flipped bits, removed or added bytes, non-finite numbers, other ids,
remote, extended or error marks; random ones; and bursts of one frame, as a babbling node sends. Half of them arrive in
boot, where one drive's heartbeats or answers never come, and half in idle, among the true messages of the drives. No
exception may be raised, resident memory must not grow, and only frames that cannot move a drive may leave for one
(harmless_frames.py). `--drive` takes another type of drive, such as moteus or mit:AK80-9.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from struct import pack

from control.modes import Mode
from drivers.can.frames import DATA_MAX_BYTES, Frame
from drivers.drive import FD, DriveParameters
from drivers.drive_types import DEFAULT, type_of
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.configuration.configuration import Configuration
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.benchmark import Report, evaluated, run_benchmark
from verification.example_robot import load_example, require_drive
from verification.stress.fuzz_loop import fuzz
from verification.stress.harmless_frames import is_harmless

TRACK = Track([(1.0, MUDS["48.5"])])
FD_BYTES = 64  # of the longest CAN FD frame
RECORDED_TICKS = 400  # from the start on, in which the drives' settings are read
FRAMES_PER_TICK = 40  # three times what four drives send
BABBLE_FRAMES = 400
BABBLE_FRACTION = 0.001
BAR_KIB = 1024.0
NUMBERS = [float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1e38, -3.4e38, 1e-45, 0.5]
STAMPS_S = [0.0, 1e9, -1.0, float("nan")]


class ObservedRobot:
    """Owns a third node on each bus of a robot."""

    def __init__(self, walk: Lockstep) -> None:
        self.walk = walk
        self.nodes = [bus.open() for bus in walk.buses.values()]

    def step(self, with_drives: bool = True) -> tuple[list[Frame], list[Frame]]:
        """Step as the lockstep does; return the frames of the drives and those of the loop."""
        walk = self.walk
        walk.tick_number += 1
        if with_drives:
            walk.robot.advance(walk.now_s)
        of_drives = self.receive()
        walk.loop.tick(Tick(walk.now_s, 0.0, walk.tick_number, 0))
        return of_drives, self.receive()

    def receive(self) -> list[Frame]:
        return [frame for node in self.nodes for frame in node.receive()]


def true_frames(configuration: Configuration) -> list[list[Frame]]:
    """Return the frames of simulated drives from start to idle, each payload once, by id and length."""
    robot = ObservedRobot(Lockstep(configuration, TRACK))
    groups: dict[tuple[int, int], dict[bytes, Frame]] = {}
    for _ in range(RECORDED_TICKS):
        for frame in robot.step()[0]:
            groups.setdefault((frame.arbitration_id, len(frame.data)), {})[frame.data] = frame
    return [list(group.values()) for group in groups.values()]


def announces(frame: Frame, drive: DriveParameters) -> bool:
    """Return whether the loop may take a frame for this drive's heartbeat, or its answer."""
    content = type_of(drive).read_frame(frame)
    identifier = frame.arbitration_id | FD * frame.is_fd
    return identifier in type_of(drive).identifiers(drive) and (content is None or "heartbeat" in content.signals)


def malformed_frames(
    true: Sequence[Sequence[Frame]], random: Random, silent: DriveParameters | None
) -> Iterator[Frame]:
    """Yield malformed frames without end, none that announces the silent drive; a seed always gives the same."""
    while True:
        frame = random.choice(CHANGES)(random.choice(random.choice(true)), random)
        if silent is None or not announces(frame, silent):
            yield from [frame] * (BABBLE_FRAMES if random.random() < BABBLE_FRACTION else 1)


def flipped(frame: Frame, random: Random) -> Frame:
    data = bytearray(frame.data)
    for _ in range(random.randint(1, 4)):
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return frame._replace(data=bytes(data))


def resized(frame: Frame, random: Random) -> Frame:
    longest = FD_BYTES if frame.is_fd else DATA_MAX_BYTES
    return frame._replace(data=(frame.data + random.randbytes(longest))[: random.randint(0, longest)])


def no_number(frame: Frame, random: Random) -> Frame:
    begin, numbers = random.randrange(max(1, len(frame.data) - 7)), pack("<ff", *random.choices(NUMBERS, k=2))
    return frame._replace(data=(frame.data[:begin] + numbers + frame.data[begin + 8 :]))


def readdressed(frame: Frame, random: Random) -> Frame:
    return frame._replace(arbitration_id=random.randrange(0x10000 if frame.is_extended else 0x800))


def marked(frame: Frame, random: Random) -> Frame:
    remote, error, extended = (random.random() < 0.5 for _ in range(3))
    identifier = random.randrange(0x20000000) if extended else frame.arbitration_id
    return Frame(identifier, frame.data, remote, error, extended, random.choice(STAMPS_S))


def random_frame(frame: Frame, random: Random) -> Frame:
    if frame.is_fd:
        longest = random.choice((DATA_MAX_BYTES, FD_BYTES))
        return frame._replace(
            arbitration_id=random.randrange(0x10000), data=random.randbytes(random.randint(0, longest))
        )
    return Frame(random.randrange(0x800), random.randbytes(random.randint(0, 8)), random.random() < 0.1)


CHANGES = (flipped, resized, no_number, readdressed, marked, random_frame)


class Fuzzing:
    """Owns a robot that stays in one mode: idle, or boot without one drive's heartbeats."""

    def __init__(self, mode: Mode, seed: int, drive: str = DEFAULT) -> None:
        configuration = load_example(drive)
        self.mode, self.drive_type = mode, drive.partition(":")[0]
        walk = Lockstep(configuration, TRACK, seed)
        if mode is Mode.BOOT:
            for bus in walk.buses.values():
                bus.ports[0].close()  # the drives', which nothing would read: it would queue thousands of frames
        self.robot = ObservedRobot(walk)
        self.loop = self.robot.walk.loop
        first = configuration.drive[configuration.rig.joints[0]]
        silent = first if mode is Mode.BOOT else None
        self.source = malformed_frames(true_frames(configuration), Random(seed), silent)
        if mode is Mode.IDLE:
            self.robot.walk.run_until(lambda: self.loop.mode is Mode.IDLE, 2.0)
        self.robot.receive()
        self.sent = 0

    def step(self, number: int) -> tuple[str, list[str]]:
        """Run one tick with malformed frames; return the mode, and every frame that could move a drive."""
        nodes = self.robot.nodes
        for index in range(FRAMES_PER_TICK):
            nodes[index % len(nodes)].send(next(self.source))
        _, sent = self.robot.step(with_drives=self.mode is Mode.IDLE)
        self.sent += len(sent)
        forbidden = [frame for frame in sent if not is_harmless(frame, self.drive_type)]
        problems = [f"sent 0x{each.arbitration_id:03x} {each.data.hex(' ')}" for each in forbidden]
        if self.loop.mode is not self.mode:
            problems.append(f"left {self.mode.name.lower()}")
        return self.loop.mode.name.lower(), problems


def fuzz_in_mode(mode: Mode, frames: int, seed: int, drive: str = DEFAULT) -> Report:
    fuzzing, ticks = Fuzzing(mode, seed, drive), frames // FRAMES_PER_TICK
    found = fuzz(ticks, mode.name.lower(), fuzzing.step)
    return found.report() | {
        "frames": ticks * FRAMES_PER_TICK,
        "frames_sent": fuzzing.sent,
        "refused_by_the_gate": fuzzing.loop.drives.refused_commands,
    }


def measure(folder: Path, *, frames: int = 1_000_000, seed: int = 1, drive: str = DEFAULT) -> Report:
    require_drive(drive)
    freeze_garbage()
    parts = {mode.name.lower(): fuzz_in_mode(mode, frames // 2, seed, drive) for mode in (Mode.BOOT, Mode.IDLE)}
    reached = not any(part["bugs"] or part["growth_kib"] >= BAR_KIB for part in parts.values())
    bar = f"no exception, no torque, no closed loop, memory within {BAR_KIB:g} KiB"
    return evaluated({"drive": drive, "parts": parts}, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
