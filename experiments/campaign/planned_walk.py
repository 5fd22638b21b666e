"""One walk of a campaign, made of four tables: [walk], [robot], [world] and [configuration].

[world] has the keys of a world file, and [configuration] those of a robot's configuration, on top of the simulated
robot's. [robot] chooses what such keys cannot: the rig and the type of the drives.
"""

import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar

from control.bounds import Bounds
from control.controller import WalkOrder
from control.records import FLIPPERS, Rig
from drivers.drive_types import DEFAULT
from experiments.campaign.points import Tables
from experiments.robot.lockstep_robot import simulated_configuration
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import read_configuration
from firmware_host.configuration.toml_records import RecordReader, parse_document, shown
from simulation.harness.drive_presets import DRIVES
from simulation.harness.world import World, read_world

SECTIONS = ("walk", "robot", "world", "configuration")
LENGTH_M = 100.0  # of the mud where the world names no segment: longer than any walk
Result = TypeVar("Result")
RIGS = (FLIPPERS, *((flipper,) for flipper in FLIPPERS))


@dataclass(frozen=True)
class WalkLimits:
    """The walk ends after so many strides, after `longest_s`, or with a fault."""

    strides: Annotated[int, Bounds(1, 10_000)] = 12
    longest_s: Annotated[float, Bounds(1.0, 3600.0)] = 120.0
    adaptive: bool = True
    depth_m: Annotated[float, Bounds(0.0, 0.2)] = 0.0  # of the first stride, or of all; 0: the configuration's


@dataclass(frozen=True)
class RobotChoice:
    flippers: tuple[str, ...] = FLIPPERS
    drive: str = DEFAULT  # its type, and a model of its motor: "mit:AK80-9"


_WALK, _ROBOT = RecordReader(WalkLimits), RecordReader(RobotChoice)


class PlannedWalk(NamedTuple):
    limits: WalkLimits
    configuration: Configuration
    world: World

    @property
    def order(self) -> WalkOrder:
        depth_m = self.limits.depth_m or self.configuration.adaptation.initial_depth_m
        return WalkOrder(depth_m, adaptive=self.limits.adaptive)


def plan_walk(tables: Tables) -> PlannedWalk:
    """Raises ConfigurationError; its messages have the section before the key."""
    limits = WalkLimits(**_in_section("walk", _WALK.read, tables["walk"]))
    robot = _in_section("robot", _read_robot, tables["robot"])
    document = _merged(_simulated_robot(robot), tables["configuration"])
    text = json.dumps(document, default=str)  # whose digest is in the results
    configuration = _in_section("configuration", read_configuration, deepcopy(document), text)
    world = _in_section("world", read_world, deepcopy(tables["world"]))
    _in_section("world", world.plant, configuration)
    return PlannedWalk(limits, configuration, world)


def _in_section(section: str, read: Callable[..., Result], *arguments: Any) -> Result:
    try:
        return read(*arguments)
    except ConfigurationError as problem:
        raise ConfigurationError([f"{section}.{each}" for each in problem.problems]) from None


def _read_robot(table: Tables) -> RobotChoice:
    robot = RobotChoice(**_ROBOT.read(table))
    if robot.flippers not in RIGS:
        known = ", ".join(str(list(rig)) for rig in RIGS)
        raise ConfigurationError([f"flippers = {shown(list(robot.flippers))}: must be one of {known}"])
    if robot.drive not in DRIVES:
        raise ConfigurationError([f"drive = {shown(robot.drive)}: must be one of {', '.join(DRIVES)}"])
    return robot


@cache
def _simulated_robot(robot: RobotChoice) -> Tables:
    """Return the tables of its configuration, which must not be changed."""
    return parse_document(simulated_configuration(drive_type=robot.drive, rig=Rig(robot.flippers)).text)


def _merged(tables: Tables, changes: Tables) -> Tables:
    """Return tables with the values of `changes`, table by table."""
    merged = dict(tables)
    for name, value in changes.items():
        present = tables.get(name)
        merged[name] = _merged(present, value) if isinstance(present, dict) and isinstance(value, dict) else value
    return merged


def one_mud(world: Tables) -> Tables:
    """Return the world's tables with one mud without an end, where they have no segments."""
    return {"segment": [{"start_m": 0.0, "end_m": LENGTH_M}]} | world
