"""Walks with every type of drive, and with two of them on one robot, in lockstep: the mud is the same."""

from collections.abc import Mapping
from dataclasses import replace
from statistics import median
from typing import Any

import pytest
import tomlkit

from control.controller import WalkOrder
from control.faults import FaultKind
from control.modes import Mode, Request
from control.records import JOINTS
from drivers.drive import DriveParameters
from drivers.mit.parameters import MitParameters, ProvenWatchdog
from drivers.moteus import codec
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import calibrated, with_drive_type
from simulation.harness.lockstep import Lockstep, drives_of
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.folders import EXAMPLE_CONFIGURATION

EXAMPLE = calibrated(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8"))
TRACK = Track([(3.0, MUDS["48.5"])])
STRIDES = 3


def mixed(other_type: str) -> str:
    """Return the configuration with a left flipper of ODrives and a right one of another type."""
    document: dict[str, Any] = tomlkit.parse(with_drive_type(EXAMPLE, other_type))
    own: dict[str, Any] = tomlkit.parse(EXAMPLE)
    document["bus"]["left"] = own["bus"]["left"]
    for joint in ("left_sweep", "left_adduction"):
        document["drive"][joint] = own["drive"][joint]
    return tomlkit.dumps(document)


def robot_with(text: str, **changes: float | str) -> Lockstep:
    configuration = parse_configuration(text)
    return Lockstep(configuration, TRACK, drives=drives_of(configuration, **changes))


def walked(text: str) -> Mapping[str, float]:
    """Return the mud's coefficients by drives whose currents have little noise."""
    return walked_by(robot_with(text, current_noise_a=0.02))


def walked_by(robot: Lockstep) -> Mapping[str, float]:
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    robot.run_until(lambda: robot.loop.learning.strides_closed >= 2 * STRIDES, 8.0)
    assert robot.loop.mode is Mode.WALKING and not list(robot.loop.faults.blocking())
    counts = robot.loop.drives
    assert (counts.unknown_frames, counts.malformed_frames, counts.refused_commands) == (0, 0, 0)
    strides = [each.estimate for each in robot.loop.learning.strides]
    estimates = {name: [getattr(stride, name) for stride in strides] for name in ("k_p", "k_s", "k_e")}
    return {name: median(each.value for each in values if each.valid) for name, values in estimates.items()}


@pytest.fixture(scope="module")
def mud() -> Mapping[str, float]:
    return walked(EXAMPLE)


@pytest.mark.parametrize("types", [("odrive", "moteus"), ("odrive", "odrive05"), ("mit", "mit")])
def test_the_mud_is_the_same_with_any_drives(types: tuple[str, str], mud: Mapping[str, float]) -> None:
    text = with_drive_type(EXAMPLE, "mit") if types[0] == "mit" else mixed(types[1])
    configuration = parse_configuration(text)
    assert [configuration.drive[joint].type for joint in JOINTS] == [name for name in types for _ in range(2)]
    assert walked(text) == pytest.approx(dict(mud), rel=0.02)


def test_a_calibrated_motor_whose_drive_knows_another_constant_feels_the_same_mud(mud: Mapping[str, float]) -> None:
    known = "reported_constant_nm_a = 0.075\n"
    text = with_drive_type(EXAMPLE, "mit").replace("node_id = ", f"{known}node_id = ")
    found = walked(text)
    assert [found[name] for name in ("k_p", "k_e")] == pytest.approx([mud[name] for name in ("k_p", "k_e")], rel=0.02)


@pytest.mark.parametrize("model", ["AK80-9", "RS05"])
def test_drives_whose_watchdog_is_proven_are_armed_without_force_and_walk(model: str, mud: Mapping[str, float]) -> None:
    text = with_drive_type(EXAMPLE, f"mit:{model}")
    configuration = parse_configuration(text)
    proven: dict[str, DriveParameters] = {
        joint: replace(drive, proven_watchdog=ProvenWatchdog(0.3, drive.bus, drive.node_id, model, "2026-11-24"))
        for joint, drive in configuration.drive.items()
        if isinstance(drive, MitParameters)
    }
    robot = Lockstep(replace(configuration, drive=proven), TRACK, drives=drives_of(configuration, current_noise_a=0.02))
    assert walked_by(robot) == pytest.approx(dict(mud), rel=0.03) and not robot.loop.forced


def test_a_drive_with_the_ranges_of_another_model_is_not_armed_by_force_either() -> None:
    robot = robot_with(with_drive_type(EXAMPLE, "mit"), model="DM4340")
    robot.run_for(1.0)
    assert robot.loop.request(Request.ARM, robot.now_s, forced="watchdog_unknown") is not None
    assert robot.loop.mode is Mode.IDLE
    assert {fault.kind for fault in robot.loop.faults.blocking()} == {FaultKind.DRIVE_SETTINGS}


def is_about_power(data: bytes) -> bool:
    return data == codec.POWER_QUERY or codec.decode_power(data) is not None


def test_each_tick_is_one_frame_each_way() -> None:
    """Apart from the rare questions for the supply's power."""
    robot = robot_with(with_drive_type(EXAMPLE, "moteus"))
    robot.arm()
    robot.run_for(0.2)
    ears, ticks = {name: bus.open() for name, bus in robot.buses.items()}, 100
    for _ in range(ticks):
        robot.step()
    for name, ear in ears.items():
        nodes = [drive.node_id for drive in robot.loop.configuration.drive.values() if drive.bus == name]
        frames = [frame for frame in ear.receive() if not is_about_power(frame.data)]
        ids = [frame.arbitration_id for frame in frames]
        assert sorted(ids) == sorted(
            ticks * [each for node in nodes for each in (codec.command_id(node), codec.reply_id(node))]
        )
