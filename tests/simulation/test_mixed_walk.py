"""Walks with every type of drive, and with two of them on one robot, in lockstep: the mud is the same."""

from collections.abc import Mapping
from statistics import median
from typing import Any

import pytest

from control.controller import WalkOrder
from control.faults import FaultKind
from control.modes import Mode, Request
from control.records import JOINTS
from drivers.drive_types import DRIVE_TYPES
from drivers.moteus import codec
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import with_drive_type
from simulation.harness.lockstep import Lockstep, drives_of
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.folders import ROOT

EXAMPLE = (ROOT / "systemd" / "mudskipper.toml").read_text(encoding="utf-8")
STRIDES = 12


def mixed(text: str, other_type: str) -> str:
    """Return the configuration with a left flipper of ODrives and a right one of another type."""
    left, right = text.split("[bus.right]")
    other = with_drive_type(text, other_type).split("[bus.right]")[1]
    for joint in ("left_sweep", "left_adduction"):
        section = f"[drive.{joint}]"
        own = right[right.index(section) : right.index("\n\n", right.index(section))]
        replaced = other[other.index(section) : other.index("\n\n", other.index(section))]
        other = other.replace(replaced, own)
    return left + "[bus.right]" + other


ROBOTS = {name: with_drive_type(EXAMPLE, name) for name in DRIVE_TYPES}
ROBOTS |= {"mixed": mixed(EXAMPLE, "moteus"), "both firmwares": mixed(EXAMPLE, "odrive05")}


def robot_with(drives: str) -> Lockstep:
    return Lockstep(parse_configuration(ROBOTS[drives]), Track([(3.0, MUDS["48.5"])]))


def walked(drives: str) -> Mapping[str, float]:
    robot = robot_with(drives)
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    robot.run_until(lambda: robot.loop.learning.strides_closed >= 2 * STRIDES, 60.0)
    assert robot.loop.mode is Mode.WALKING and not list(robot.loop.faults.blocking())
    counts = robot.loop.drives
    assert (counts.unknown_frames, counts.malformed_frames, counts.refused_commands) == (0, 0, 0)
    strides = [each.estimate for each in robot.loop.learning.strides[-2 * STRIDES :]]
    estimates = {name: [getattr(stride, name) for stride in strides] for name in ("k_p", "k_s", "k_e")}
    return {name: median(each.value for each in values if each.valid) for name, values in estimates.items()}


@pytest.fixture(scope="module")
def mud() -> Mapping[str, float]:
    return walked("odrive")


@pytest.mark.parametrize("drives", ["odrive05", "moteus", "mit", "mixed", "both firmwares"])
def test_the_mud_is_the_same_with_any_drives(drives: str, mud: Mapping[str, float]) -> None:
    assert walked(drives) == pytest.approx(dict(mud), rel=0.02)


def test_drives_whose_watchdog_cannot_be_read_are_armed_by_force_only() -> None:
    cubemars = ROBOTS["mit"].replace('type = "mit"', 'type = "mit"\nmodel = "AK80-9"')
    robot = Lockstep(parse_configuration(cubemars), Track([(3.0, MUDS["48.5"])]))
    robot.run_for(1.0)
    assert {fault.kind for fault in robot.loop.faults.blocking()} == {FaultKind.WATCHDOG_UNKNOWN}
    assert "watchdog is unknown" in str(robot.loop.request(Request.ARM, robot.now_s))
    assert robot.loop.request(Request.ARM, robot.now_s, forced=True) is None
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 3.0) and robot.loop.forced
    robot.run_for(1.0)
    assert robot.loop.mode is Mode.HOLD and robot.loop.drives.refused_commands == 0


def test_a_drive_with_the_ranges_of_another_model_is_not_armed_by_force_either() -> None:
    configuration = parse_configuration(ROBOTS["mit"])
    robot = Lockstep(configuration, Track([(3.0, MUDS["48.5"])]), drives=drives_of(configuration, model="DM4340"))
    robot.run_for(1.0)
    refused = str(robot.loop.request(Request.ARM, robot.now_s, forced=True))
    assert "do not fit" in refused
    assert robot.loop.mode is Mode.IDLE


def test_a_robot_may_have_two_protocols() -> None:
    configuration = parse_configuration(ROBOTS["mixed"])
    assert [configuration.drive[joint].type for joint in JOINTS] == ["odrive", "odrive", "moteus", "moteus"]


def test_each_tick_is_one_frame_each_way() -> None:
    robot = robot_with("moteus")
    robot.arm()
    robot.run_for(0.2)
    ears = {name: bus.open() for name, bus in robot.buses.items()}
    ticks = 100
    for _ in range(ticks):
        robot.step()
    for name, ear in ears.items():
        nodes = [drive.node_id for drive in robot.loop.configuration.drive.values() if drive.bus == name]
        ids = [frame.arbitration_id for frame in ear.receive()]
        expected: dict[int, Any] = {codec.command_id(node): ticks for node in nodes}
        expected |= {codec.reply_id(node): ticks for node in nodes}
        assert {each: ids.count(each) for each in ids} == expected
