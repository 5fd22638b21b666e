"""Walks in lockstep with each model of drive and prints the hashes of all frames and log rows, as JSON.

Some of these drives cannot follow the walk: their faults belong to the log too.
"""

import json
from hashlib import sha256
from itertools import chain

from control.controller import WalkOrder
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import NullRecorder
from firmware_host.software_version import is_compiled
from simulation.harness.drive_presets import DRIVES
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.stones import Stone
from simulation.mud.track import Track, paper_track
from verification.example_robot import load_example, load_one_flipper

STRIDES = 4
WALK_S = 8.0  # which ends with a rest


class HashingRecorder(NullRecorder):
    def __init__(self) -> None:
        self.rows = 0
        self.digest = sha256()

    def put(self, number: int, row: bytes) -> bool:
        self.rows += 1
        self.digest.update(bytes([number]) + row)
        return True


def walk_hashes(configuration: Configuration, track: Track | None = None) -> dict[str, object]:
    recorder = HashingRecorder()
    robot = Lockstep(configuration, track or paper_track(), recorder=recorder)
    listeners, digest, frames = [bus.open() for bus in robot.buses.values()], sha256(), 0
    robot.arm(forced="watchdog_unknown")  # a MIT drive cannot report its watchdog
    robot.walk(WalkOrder(0.03, adaptive=True, strides=STRIDES))
    for _ in range(round(WALK_S / robot.period_s)):
        robot.step()
        for frame in chain.from_iterable(listener.receive() for listener in listeners):
            frames += 1
            digest.update(repr(frame[:3]).encode())
    return {
        "rows": (recorder.rows, recorder.digest.hexdigest()),
        "frames": (frames, digest.hexdigest()),
    }


if __name__ == "__main__":
    walks = {drive: walk_hashes(load_example(drive)) for drive in DRIVES}
    walks["one flipper"] = walk_hashes(load_one_flipper())
    walks["over a stone"] = walk_hashes(load_example(), Track([(5.0, MUDS["48.5"])], [Stone(0.05, 0.25, 0.02)]))
    print(json.dumps({"compiled": is_compiled(), "walks": walks}))
