"""How long the loop takes to answer each method of the status socket, where the answer is as long as it can be.

A lockstep robot has walked, its map is full, its timing statistics are those of a slow loop, and every fault that a
joint, a bus, a flipper or the loop can have is present at once. Each figure contains the method, the encoding of its
answer, and nothing else: the socket adds some 20 us. One answer is made in a tick, after its commands were sent.
"""

import sys
import time
from pathlib import Path
from typing import Any

import msgpack

from control.controller import WalkOrder
from control.faults import Fault, FaultKind
from control.modes import Mode
from control.rate import PERIOD_S
from control.records import FLIPPERS, JOINTS
from drivers.fault_injection.failures import Failures
from estimation.mud_map import MOST_PIECES, PIECE_M
from firmware_host.fault_injection.failure_calls import with_failures
from firmware_host.loop import Loop
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_methods import Level
from firmware_host.sockets.status_socket import Methods
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.example_robot import load_example
from verification.report import evaluated, run_benchmark, show_progress, summary_us

LARGEST_FRACTION = 0.25  # of a period; the rest of a tick takes a tenth of it
STRIDES = 12
SLOW_S = 0.019  # a tick that missed several periods
CALLER = Caller(1, Peer(1, 0, frozenset({0})), Level.DRIVE)
READING = ("hello", "status", "strides", "map", "check", "failures")
SUBJECTS = {"drive": JOINTS, "watchdog": JOINTS, "joint": JOINTS, "bus": ("left", "right"), "flipper": FLIPPERS}


def every_fault() -> list[Fault]:
    return [kind.fault(subject) for kind in FaultKind for subject in SUBJECTS.get(kind.part, ("",))]


def fill(loop: Loop) -> None:
    """Bring the loop's reports to their greatest length."""
    for number in range(1000):
        loop.timing.update(number * SLOW_S, SLOW_S, 0, SLOW_S)
    walked = [closed.estimate for closed in loop.learning.strides]
    for piece in range(MOST_PIECES):
        loop.learning.estimator.map.update((piece + 0.5) * PIECE_M, walked)
    loop.faults.update(every_fault(), energised=False)


def fullest_methods() -> Methods:
    """The methods of a loop whose answers are as long as they can be."""
    configuration = load_example()
    robot = Lockstep(configuration, Track([(5.0, MUDS["48.5"])]))
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=True, strides=STRIDES))
    robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 60.0)
    fill(robot.loop)
    calls = OperatorCalls(robot.loop, ["a warning about the operating system"] * 4, lambda: robot.now_s)
    failures = Failures(configuration.bus)
    return with_failures(calls.methods, failures, lambda now_s, text: None, lambda: robot.now_s)


def answer(methods: Methods, name: str) -> bytes:
    return bytes(msgpack.packb([1, 1, None, methods[name]({}, CALLER)]))


def measure_method(methods: Methods, name: str, repeats: int) -> dict[str, Any]:
    durations_s = []
    for _ in range(repeats):
        begun_s = time.thread_time()
        length = len(answer(methods, name))
        durations_s.append(time.thread_time() - begun_s)
    return {"bytes": length, "serving_us": summary_us(durations_s)}


def measure(folder: Path, *, repeats: int = 1000) -> dict[str, Any]:
    methods, measured = fullest_methods(), {}
    for index, name in enumerate(READING):
        show_progress(index, len(READING), name)
        measured[name] = measure_method(methods, name, repeats)
    bar_us = 1e6 * LARGEST_FRACTION * PERIOD_S
    slowest_us = max(each["serving_us"]["median"] for each in measured.values())
    bar = f"median of the slowest answer at most {bar_us:.0f} us, {100 * LARGEST_FRACTION:.0f} % of a period"
    return evaluated({"methods": measured, "bar_us": bar_us}, bar, slowest_us <= bar_us)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
