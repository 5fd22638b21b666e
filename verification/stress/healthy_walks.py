"""Hours of simulated walking in which nothing fails: a fault that stops the robot is a false alarm.

Each walk has its own mud, drawn between soft and firm with random strength along the track, the disturbances of the
authors' logs or none, a body that is free or on rails, and adaptive or fixed depths. The robot walks, holds, moves
joints and walks on, in lockstep. A flipper that the mud holds is no false alarm: those faults are counted apart, as is
a free body that sinks until the mud blocks the swing of its flippers.
"""

import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from control.controller import WalkOrder
from control.faults import Reaction
from control.modes import Mode, Request
from simulation.harness.lockstep import Lockstep, drives_of, plant_of
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB, NONE, drive_changes
from simulation.mud.track import Track
from simulation.mud.unevenness import RandomStrength
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import load_example

WALK_S = 60.0
STRENGTHS_PA = (400.0, 4000.0)  # softer mud supports no robot, firmer mud holds a flipper that is deep in it
DEPTHS_M = (0.02, 0.025, 0.03, 0.035)
MOVE_RAD = 0.2
BY_THE_MUD, BY_SINKING = ("flipper_stuck", "joint_not_following"), "following_error"


class Walk(NamedTuple):
    """The result of one walk."""

    seed: int
    duration_s: float
    strides: int
    distance_m: float
    alarms: list[str]  # faults with a reaction, and when
    held: list[str]  # faults of flippers that the mud holds


def walk(seed: int) -> Walk:
    """Walks for a minute over a random track."""
    chance, configuration = Random(f"healthy {seed}"), load_example()
    strength = RandomStrength(chance.choice((0.0, 0.1, 0.25)), chance.uniform(0.05, 0.5), seed)
    track = Track([(100.0, Clay("drawn", chance.uniform(*STRENGTHS_PA)))], random_strength=strength)
    disturbances = chance.choice((NONE, LAB))
    is_free = chance.random() < 0.5
    plant = plant_of(configuration, disturbances, free_body=is_free)
    drives = drives_of(configuration, **drive_changes(disturbances))
    robot = Lockstep(configuration, track, seed, plant=plant, drives=drives)
    order = WalkOrder(chance.choice(DEPTHS_M), chance.random() < 0.7)
    robot.arm()
    faults, strides = [], 0
    while robot.now_s < WALK_S and robot.loop.mode in (Mode.HOLD, Mode.WALKING, Mode.STOPPING):
        _operate(robot, chance, order)
        robot.step()
        faults += [(robot.now_s, fault) for fault in robot.loop.faults.begun if fault.kind.reaction > Reaction.WARN]
        strides = max(strides, robot.loop.controller.target.stride + 1)
    of_mud = (*BY_THE_MUD, BY_SINKING) if is_free else BY_THE_MUD
    named = [(f"{now_s:.2f} s: {fault.name}", fault.kind.value in of_mud) for now_s, fault in faults]
    held, alarms = [text for text, by_mud in named if by_mud], [text for text, by_mud in named if not by_mud]
    return Walk(seed, robot.now_s, strides, robot.robot.plant.body_m, [] if held else alarms, held)


def _operate(robot: Lockstep, chance: Random, order: WalkOrder) -> None:
    """Walks most of the time, and now and then stops and moves a joint."""
    loop = robot.loop
    if loop.mode is Mode.HOLD and not loop.controller.moving and chance.random() < 0.01:
        if chance.random() < 0.3:
            held_rad = [state.angle_rad for state in loop.states]
            moved = chance.randrange(0, len(held_rad), 2)  # a sweep
            held_rad[moved] = chance.uniform(-MOVE_RAD, MOVE_RAD)
            loop.controller.move(held_rad)
        else:
            loop.request(Request.WALK, robot.now_s, order)
    elif loop.mode is Mode.WALKING and chance.random() < 0.0003:
        loop.request(Request.STOP, robot.now_s)


def measure(folder: Path, *, walks: int = 600, first: int = 0, workers: int = os.cpu_count() or 1) -> dict[str, Any]:
    """`walks` of one minute each: 600 are ten hours."""
    kinds: Counter[str] = Counter()
    results: list[Walk] = []
    with ProcessPoolExecutor(workers) as pool:
        for result in pool.map(walk, range(first, first + walks)):
            results.append(result)
            kinds.update(text.split(": ")[1].split()[0] for text in [*result.alarms, *result.held])
            show_progress(len(results), walks, f"{len(results)} of {walks} walks, {dict(kinds)}")
    alarms = {result.seed: result.alarms for result in results if result.alarms}
    report = {
        "hours": round(sum(result.duration_s for result in results) / 3600.0, 3),
        "strides": sum(result.strides for result in results),
        "distance_m": round(sum(result.distance_m for result in results), 1),
        "faults": dict(kinds),
        "walks_held_by_the_mud": sum(bool(result.held) for result in results),
        "false_alarms": alarms,
    }
    return evaluated(report, "no false alarm", not alarms)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
