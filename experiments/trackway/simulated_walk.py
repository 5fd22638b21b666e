"""Simulated walks at a constant depth or by a method of adaptation: over the paper's trackway, and in one endless mud.

A constant depth and the method "paper" are walked by the paper's robot, with the paper's estimator. Every other method
is walked by this project's robot with all of its features.

After section III-D of the paper the trackway of 1.83 m holds mud of 48.5, 53.1 and 45.3 % of water, here in the
simulator's clay with the disturbances of the authors' logs. A walk ends when the plates would go down past the end,
after 90 s in one mud, or with a fault.

In one mud a walk has a given number of strides. The first stride starts from a standing body on untouched ground and is
not counted. An adaptive robot learns the mud in its first two strides and is evaluated from the third on.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from math import fsum
from statistics import fmean
from typing import Any, cast, get_args

from pandas import DataFrame

from control.controller import WalkOrder
from control.modes import Mode
from control.parameters.adaptation_parameters import Method
from control.parameters.recovery_parameters import RecoveryParameters
from experiments.robot.lockstep_robot import start_walk
from experiments.trackway.walk import StrideRecord, Walk, WalkedStride, speed_m_s, tick_of, walk_of
from experiments.trials.trial import WALKING, configuration_of
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.toml_records import parse_document
from simulation.harness.lockstep import plant_of
from simulation.mud.clay import MUDS, Clay
from simulation.mud.disturbances import TRACKWAY, Disturbances
from simulation.mud.track import Track

METHODS: tuple[Method, ...] = get_args(Method)
PAPER = "paper"
STUCK_S = 90.0  # longest walking time in one mud
ENDLESS_M = 100.0
CONSTANT_STRIDES = 7
STARTING, LEARNING = 1, 2  # strides that are not counted
SHALLOWEST_M, DEEPEST_M = 0.015, 0.05  # the range of the adaptation
DEPTHS_M = tuple(round(SHALLOWEST_M + i * 0.0025, 6) for i in range(15))


def walking_world() -> dict[str, Any]:
    """Return what walks depend on besides their parameters, as it was read."""
    return {
        "configuration": parse_document(configuration_of(WALKING).text),
        "disturbances": asdict(TRACKWAY),
        "muds": [[clay.name, clay.strength_pa] for clay in MUDS.values()],
    }


def arm_m() -> float:
    """Return the length of the walking robot's flippers."""
    return configuration_of(WALKING).geometry.flipper_length_m


def robot_of(method: str) -> Configuration:
    """Return the robot of a method of adaptation, or of a constant depth where none is named.

    The paper's robot has the paper's estimator, and a gait that does not wait for a flipper stuck in the mud.
    """
    robot = configuration_of(WALKING)
    if method:
        robot = replace(robot, adaptation=replace(robot.adaptation, method=cast(Method, method)))
    if method not in ("", PAPER):
        return robot
    estimation = replace(robot.estimation, method="paper")
    return replace(robot, estimation=estimation, recovery=RecoveryParameters(attempts=0))


def walk_by(
    track: Track,
    seed: int,
    done: Callable[[Sequence[WalkedStride]], bool],
    depth_m: float = 0.0,
    method: str = "",
    disturbances: Disturbances = TRACKWAY,
    **plant: Any,
) -> Walk:
    """Walk until `done` accepts the strides so far, or a fault.

    `plant` changes parameters of the simulated robot's body. Raises RuntimeError where the robot does not start.
    """
    configuration = robot_of(method)
    order = WalkOrder(configuration.adaptation.initial_depth_m if method else depth_m, adaptive=bool(method))
    body = plant_of(configuration, disturbances, **plant)
    robot = start_walk(configuration, track, seed, order, disturbances=disturbances, plant=body)
    record = StrideRecord(lambda position_m: track.ground_at(position_m).name)
    while robot.loop.mode is Mode.WALKING and not done(record.strides):
        robot.step()
        record.update(tick_of(robot))
    fault = robot.loop.fault
    return Walk(record.strides, fault.message if fault else "")


def walk_trackway(compartment_m: float, seed: int, depth_m: float = 0.0, method: str = "") -> dict[str, Any]:
    """Return the entry of a walk over the paper's muds."""
    track = Track([(compartment_m, clay) for clay in MUDS.values()])
    return walk_by(track, seed, lambda strides: bool(end_of(strides, track.length_m)), depth_m, method).entry


def end_of(strides: Sequence[WalkedStride], length_m: float) -> str:
    """Return why a walk over a trackway ends after these strides; empty while it goes on."""
    if not strides:
        return ""
    last = strides[-1]
    if last.position_m + last.step_m >= length_m:  # the plates go down past the end next
        return "past the end"
    in_mud_s = fsum(stride.duration_s for stride in strides if stride.mud == last.mud)
    return f"stuck in {last.mud}" if in_mud_s >= STUCK_S else ""


# in one mud


def walk_in_mud(
    strength_pa: float, seed: int, depth_m: float = 0.0, method: str = "", count: int = CONSTANT_STRIDES, **plant: Any
) -> dict[str, Any]:
    """Return the entry of a walk of `count` strides."""
    track = Track([(ENDLESS_M, Clay("mud", strength_pa))])
    return walk_by(track, seed, lambda strides: len(strides) >= count, depth_m, method, **plant).entry


def speed_cm_s(walk: Walk, skipped: int = STARTING) -> float:
    """Return the speed without the first strides; 0 where a fault ended the walk within them."""
    counted = walk.strides[skipped:]
    return 100.0 * speed_m_s(counted) if counted else 0.0


def constant_rows(strengths_pa: Sequence[float], seeds: int) -> list[dict[str, Any]]:
    """Return the rows of `walk_in_mud` at each constant depth."""
    return [
        {"strength_pa": strength_pa, "depth_m": depth_m, "seed": seed}
        for strength_pa in strengths_pa
        for depth_m in DEPTHS_M
        for seed in range(1, seeds + 1)
    ]


def walks_in(measured: DataFrame) -> list[Walk]:
    """Return the walks of rows that were run."""
    return [walk_of(row) for row in measured.to_dict("records")]


def mean_speeds_cm_s(constant: DataFrame) -> dict[float, float]:
    """Return the mean speed over the seeds in one mud by depth in metres."""
    return {
        depth_m: fmean(speed_cm_s(walk) for walk in walks_in(walks)) for depth_m, walks in constant.groupby("depth_m")
    }


def best_depth(speeds: dict[float, float]) -> dict[str, float]:
    """Return the fastest constant depth, and its speed in cm/s as `mean`."""
    depth_m = max(speeds, key=lambda each: speeds[each])
    return {"depth_cm": round(100.0 * depth_m, 4), "mean": round(speeds[depth_m], 3)}
