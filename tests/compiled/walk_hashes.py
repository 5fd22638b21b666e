"""Walks four strides in lockstep with each type of drive and prints the hashes of all frames and log rows, as JSON."""

import json
from hashlib import sha256

from benchmarks.example_robot import load_example, load_one_flipper
from control.controller import WalkOrder
from control.modes import Mode
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import NullRecorder
from firmware_host.software_version import is_compiled
from simulation.harness.drive_presets import DRIVES
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track

STRIDES = 4
LONGEST_S = 20.0


class HashingRecorder(NullRecorder):
    def __init__(self) -> None:
        self.rows = 0
        self.digest = sha256()

    def put(self, number: int, row: bytes) -> bool:
        self.rows += 1
        self.digest.update(bytes([number]) + row)
        return True


def walk_hashes(configuration: Configuration) -> dict[str, object]:
    recorder = HashingRecorder()
    robot = Lockstep(configuration, paper_track(), recorder=recorder)
    listeners, digest, frames = [bus.open() for bus in robot.buses.values()], sha256(), 0
    robot.arm(forced=True)  # a MIT drive cannot report its watchdog
    robot.walk(WalkOrder(0.03, adaptive=True, strides=STRIDES))

    def is_over() -> bool:
        nonlocal frames
        for listener in listeners:
            for frame in listener.receive():
                frames += 1
                digest.update(repr(frame[:3]).encode())
        return robot.loop.mode is Mode.HOLD

    assert robot.run_until(is_over, LONGEST_S)
    return {
        "rows": (recorder.rows, recorder.digest.hexdigest()),
        "frames": (frames, digest.hexdigest()),
    }


if __name__ == "__main__":
    walks = {drive: walk_hashes(load_example(drive)) for drive in DRIVES}
    print(json.dumps({"compiled": is_compiled(), "walks": walks | {"one flipper": walk_hashes(load_one_flipper())}}))
