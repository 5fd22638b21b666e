"""Malformed and unexpected CAN frames on the buses: random and mutated ones, through whole ticks of the loop.

Frames are those of four drives with flipped bits, removed or added bytes, non-finite numbers, other ids, remote,
extended or error marks; random ones; and bursts of one frame, as a babbling node sends. Half of them arrive in boot,
where one drive's heartbeats never come, and half in idle, among the true messages of simulated drives. No exception may
be raised, resident memory must not grow, and the only frames that may leave for a drive are zero torque, idle, and
requests for version and settings. `--drive` takes another type of drive, whose true frames are recorded from simulated
ones; for a moteus zero torque is forbidden too, because it lets the drive follow torque.
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from random import Random
from struct import pack
from time import perf_counter
from typing import Any

from benchmarks.example_robot import load_example
from benchmarks.report import evaluated, run_benchmark, show_progress
from benchmarks.stress.resources import resident_kib
from control.modes import Mode
from drivers.can.frames import DATA_MAX_BYTES, Frame
from drivers.can.mock_bus import MockPort
from drivers.drive import DriveParameters
from drivers.drive_types import DEFAULT, DRIVE_TYPES, type_of
from drivers.moteus import registers
from drivers.moteus.codec import Mode as MoteusMode
from drivers.moteus.registers import Register
from drivers.odrive import codec
from drivers.odrive.codec import arbitration_id
from firmware_host.computer.realtime import freeze_garbage
from firmware_host.ticker import Tick
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

KNOWN = (DEFAULT, "moteus")  # types of drive for which the forbidden frames are stated here
FD_BYTES = 64  # of the longest CAN FD frame
RECORDED_S = 1.0
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


def true_frames(drives: Mapping[str, DriveParameters]) -> list[Frame]:
    """Returns what the drives send: as listed above, or as simulated ones do."""
    node_ids = [drive.node_id for drive in drives.values()]
    if any(drive.type != DEFAULT for drive in drives.values()):
        return recorded_frames(next(drive.type for drive in drives.values()))
    frames = [
        Frame(arbitration_id(node, message), message.encode(*values))
        for node in node_ids
        for message, values in REPORTED
    ]
    setting = codec.TX_SDO.encode(0, 1, 0) + codec.SDO_FLOAT.pack(0.1)
    return frames + [Frame(arbitration_id(node, codec.TX_SDO), setting) for node in node_ids]


def recorded_frames(drive: str) -> list[Frame]:
    """Returns the frames of simulated drives in a second of an idle robot, each payload once."""
    walk = Lockstep(load_example(drive), Track([(1.0, MUDS["48.5"])]))
    nodes = [open_third_node(walk, bus) for bus in walk.loop.configuration.bus]
    walk.run_for(RECORDED_S)
    sent = [frame for node in nodes for frame in node.receive() if not is_ours(frame, drive)]
    return list({(frame.arbitration_id, frame.data): frame for frame in sent}.values())


def malformed_frames(true: list[Frame], random: Random, without: int) -> Iterator[Frame]:
    """Yields malformed frames without end, none with the id `without`; the same seed gives the same frames."""
    while True:
        frame = random.choice(CHANGES)(random.choice(true), random)
        if frame.arbitration_id != without:
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


def is_forbidden(frame: Frame, drive: str = DEFAULT) -> bool:
    """Returns whether a disarmed robot's frame could move a drive: any but zero torque, idle and requests."""
    if drive == "moteus":
        return writes_to_moteus(frame)
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


def writes_to_moteus(frame: Frame) -> bool:
    """Returns whether a frame writes anything but the mode STOPPED, or anything but a question to the console."""
    for each in registers.decode_frame(frame.data):
        if each.kind == registers.CONSOLE_INPUT and not each.text.startswith(b"conf get "):
            return True
        if each.kind == registers.WRITE and (each.register, *each.values) != (Register.MODE, MoteusMode.STOPPED):
            return True
    return False


class Fuzzing:
    """Owns a loop that stays in one mode: idle next to a running robot, or boot without one drive's heartbeats."""

    def __init__(self, mode: Mode, seed: int, drive: str = DEFAULT) -> None:
        configuration = load_example(drive)
        self.mode, self.drive = mode, drive
        self.walk = Lockstep(configuration, Track([(1.0, MUDS["48.5"])]), seed)
        self.nodes = [open_third_node(self.walk, bus) for bus in configuration.bus]
        first = configuration.drive[configuration.rig.joints[0]]
        missing = type_of(first).announces(first.node_id).arbitration_id if mode is Mode.BOOT else -1
        self.source = malformed_frames(true_frames(configuration.drive), Random(seed), missing)
        if mode is Mode.IDLE:
            self.walk.run_until(lambda: self.walk.loop.mode is Mode.IDLE, 2.0)
        for node in self.nodes:
            node.receive()
        self.exceptions, self.forbidden = list[str](), list[str]()
        self.sent = self.ticks_in_another_mode = 0

    def step(self) -> None:
        for index in range(FRAMES_PER_TICK):
            self.nodes[index % len(self.nodes)].send(next(self.source))
        try:
            self._tick()
        except Exception as problem:  # noqa: BLE001  that none comes is what is measured
            self.exceptions.append(repr(problem))
        self.ticks_in_another_mode += self.walk.loop.mode is not self.mode
        sent = [frame for node in self.nodes for frame in node.receive() if is_ours(frame, self.drive)]
        self.sent += len(sent)
        forbidden = [frame for frame in sent if is_forbidden(frame, self.drive)]
        self.forbidden += [f"0x{each.arbitration_id:03x} {each.data.hex(' ')}" for each in forbidden]

    def _tick(self) -> None:
        if self.mode is Mode.IDLE:
            self.walk.step()
            return
        self.walk.tick_number += 1
        self.walk.loop.tick(Tick(self.walk.now_s, 0.0, self.walk.tick_number, 0))


def fuzz(mode: Mode, frames: int, seed: int, drive: str = DEFAULT) -> dict[str, Any]:
    fuzzing, ticks, started_s = Fuzzing(mode, seed, drive), frames // FRAMES_PER_TICK, perf_counter()
    readings_kib = []
    for number in range(ticks):
        fuzzing.step()
        if number >= WARM_UP_FRACTION * ticks and number % max(1, ticks // 10) == 0:
            readings_kib.append(resident_kib())
        show_progress(number, ticks, mode.name.lower())
    return {
        "frames": ticks * FRAMES_PER_TICK,
        "exceptions": len(fuzzing.exceptions),
        "first_exceptions": fuzzing.exceptions[:3],
        "forbidden": fuzzing.forbidden[:10],
        "frames_sent": fuzzing.sent,
        "refused_by_the_gate": fuzzing.walk.loop.drives.refused_commands,
        "ticks_in_another_mode": fuzzing.ticks_in_another_mode,
        "growth_kib": round(readings_kib[-1] - readings_kib[0], 1),
        "seconds": round(perf_counter() - started_s, 1),
    }


def open_third_node(walk: Lockstep, bus: str) -> MockPort:
    """Opens a third node on a bus of the loop."""
    port = walk.loop.drives.ports[bus]
    assert isinstance(port, MockPort)
    return port.open_peer()


def is_ours(frame: Frame, drive: str = DEFAULT) -> bool:
    """Returns whether the loop sent a frame; the simulated drives send answers and cyclic messages on the same bus."""
    if drive != DEFAULT:
        content = DRIVE_TYPES[drive].read_frame(frame)
        return content is not None and content.is_command
    reported = {message.command for message, _ in REPORTED} | {codec.TX_SDO.command}
    return frame.is_remote or frame.arbitration_id & 0x1F not in reported


def measure(folder: Path, *, frames: int = 1_000_000, seed: int = 1, drive: str = DEFAULT) -> dict[str, Any]:
    if drive not in KNOWN:
        raise SystemExit(f"--drive {drive}: must be one of {', '.join(KNOWN)}")
    freeze_garbage()
    parts = {mode.name.lower(): fuzz(mode, frames // 2, seed, drive) for mode in (Mode.BOOT, Mode.IDLE)}
    reached = all(
        not (part["exceptions"] or part["forbidden"] or part["ticks_in_another_mode"]) and part["growth_kib"] < BAR_KIB
        for part in parts.values()
    )
    bar = f"no exception, no torque, no closed loop, memory within {BAR_KIB:g} KiB"
    return evaluated({"drive": drive, "parts": parts}, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
