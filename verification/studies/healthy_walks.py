"""Hours of simulated walking in which nothing fails: a fault that stops the robot is a false alarm.

Each walk has its own mud, drawn between soft and firm with random strength along the track, the disturbances of the
authors' logs or none, direct motors or belts with play, a body that is free or on rails, and adaptive or fixed depths.
The robot walks, holds, moves joints and walks on, in lockstep. A flipper that the mud holds is no false alarm: those
faults are counted apart, as is a free body that sinks until the mud blocks the swing of its flippers, where the plant's
true load on the flipper says so. A free body in mud of more than 3 kPa may walk for a minute and stay where it is: full
torque, 11.5 N of thrust, does not drag its belly.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from math import inf
from random import Random
from typing import Annotated, Any

from pandas import DataFrame

from control.controller import WalkOrder
from control.faults import Reaction
from control.modes import Mode, Request
from control.parameters.joint_gains import JointGains
from drivers.drive_types import DEFAULT
from experiments.study.option import Option
from experiments.study.result import Result, Table
from experiments.study.session import Ending
from experiments.study.trials import Trials
from simulation.harness.drive_presets import DRIVES
from simulation.harness.lockstep import drives_of, plant_of
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB, NONE, drive_changes
from simulation.mud.track import Track
from simulation.mud.unevenness import RandomStrength
from verification.faults.failing_robot import FailingRobot
from verification.faults.phases import real_configuration

WALK_S = 60.0
STRENGTHS_PA = (400.0, 4000.0)  # softer mud supports no robot, firmer mud holds a flipper that is deep in it
DEPTHS_M = (0.02, 0.025, 0.03, 0.035)
PLAY_DEG = 1.0  # of belts between motors and joints
GAINS_WITH_PLAY = JointGains(4.0, 0.033, 4.0, 0.033)  # 8 degrees of phase margin for a rotor alone, or more
MOVE_RAD = 0.2
HELD_FRACTION = 0.5  # of the torque limit, of the mud's torque on a joint: 0.9 in the walks that were held so far
BY_THE_MUD, BY_SINKING = ("flipper_stuck", "joint_not_following"), "following_error"


def study(
    trials: Trials,
    *,
    walks: Annotated[int, Option("of a minute each; 600 are ten hours", low=1, high=100_000)] = 60,
    first: Annotated[int, Option("seed of the first walk", low=0, high=1_000_000)] = 0,
    drive: Annotated[str, Option("type of the robot's drives", metavar="TYPE", choices=tuple(DRIVES))] = DEFAULT,
) -> Result:
    """Hours of walking without a failure, in which no fault may stop the robot."""
    walked = trials.run(walk, [{"seed": seed, "drive": drive} for seed in range(first, first + walks)])
    alarms = {int(row.seed): row.alarms for row in walked.itertuples() if row.alarms}
    faults = Counter(text.split(": ")[1] for texts in (*walked["alarms"], *walked["held"]) for text in texts)
    summary = {
        "hours": round(float(walked["duration_s"].sum()) / 3600.0, 3),
        "strides": int(walked["strides"].sum()),
        "distance_m": round(float(walked["distance_m"].sum()), 1),
        "faults": dict(faults),
        "walks_held_by_the_mud": sum(bool(held) for held in walked["held"]),
        "false_alarms": alarms,
    }
    row = {name: summary[name] for name in ("hours", "strides", "distance_m", "walks_held_by_the_mud")}
    table = Table(
        "walks", "Walks in which nothing fails", {}, DataFrame([row | {"walks_with_false_alarms": len(alarms)}])
    )
    notes = [f"seed {seed}: {', '.join(texts)}" for seed, texts in alarms.items()]
    return Result([table], summary=summary, notes=notes, ending=Ending.UNHEALTHY if alarms else Ending.DONE)


def walk(seed: int, drive: str = DEFAULT) -> dict[str, Any]:
    """Walk for a minute over a random track; return distances, and the faults that stopped the robot."""
    chance, configuration = Random(f"healthy {seed}"), real_configuration(drive)
    strength = RandomStrength(chance.choice((0.0, 0.1, 0.25)), chance.uniform(0.05, 0.5), seed)
    track = Track([(100.0, Clay("drawn", chance.uniform(*STRENGTHS_PA)))], random_strength=strength)
    disturbances = replace(chance.choice((NONE, LAB)), play_deg=chance.choice((0.0, PLAY_DEG)))
    is_free = chance.random() < 0.5
    if disturbances.play_deg:
        configuration = replace(configuration, gains=GAINS_WITH_PLAY)
    plant = plant_of(configuration, disturbances, free_body=is_free)
    drives = drives_of(configuration, **drive_changes(disturbances))
    robot = FailingRobot(configuration, track, seed, plant=plant, drives=drives)
    order = WalkOrder(chance.choice(DEPTHS_M), chance.random() < 0.7)
    robot.arm()
    of_mud = (*BY_THE_MUD, BY_SINKING) if is_free else BY_THE_MUD
    faults, strides, stride = [], 0, -1
    while robot.now_s < WALK_S and robot.loop.mode in (Mode.HOLD, Mode.WALKING, Mode.STOPPING):
        _operate(robot, chance, order)
        robot.step()
        faults += [
            (robot.now_s, fault.name, fault.name in of_mud and is_held(robot, fault.subject))
            for fault in robot.loop.faults.begun
            if fault.kind.reaction > Reaction.WARN
        ]
        before, stride = stride, robot.loop.controller.target.stride  # each walk counts from 0
        strides += stride > before
    held, alarms = counted_apart(faults)
    return {
        "duration_s": robot.now_s,
        "play_deg": disturbances.play_deg,
        "strides": strides,
        "distance_m": robot.robot.plant.body_m,
        "alarms": alarms,
        "held": held,
    }


def counted_apart(faults: Sequence[tuple[float, str, bool]]) -> tuple[list[str], list[str]]:
    """Return the faults of the mud, and the false alarms. What comes with a fault of the mud or later may follow it."""
    held_s = min((now_s for now_s, _, of_mud in faults if of_mud), default=inf)
    held = [f"{now_s:.2f} s: {name}" for now_s, name, of_mud in faults if of_mud]
    return held, [f"{now_s:.2f} s: {name}" for now_s, name, _ in faults if now_s < held_s]


def is_held(robot: FailingRobot, subject: str) -> bool:
    """Return whether the mud holds the flipper that is, or whose joint is, the subject of a fault."""
    configuration = robot.loop.configuration
    force = robot.robot.plant.arms[configuration.rig.flippers.index(subject.partition("_")[0])].force
    return max(abs(force.sweep_nm), abs(force.adduction_nm)) >= HELD_FRACTION * configuration.limits.torque_nm


def _operate(robot: FailingRobot, chance: Random, order: WalkOrder) -> None:
    """Walk most of the time, and now and then stop and move a joint."""
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
