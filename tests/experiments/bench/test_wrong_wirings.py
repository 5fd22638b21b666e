"""The right stage of the bench finds each wiring error, with a message that says what to do.

The stages are the tests of tests/bench themselves, called one after the other until one of them fails.
"""

import inspect
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import dropwhile
from typing import Any

import pytest

from control.modes import Mode
from control.records import JOINTS
from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.codec import arbitration_id
from experiments.bench.rig import SimulatedRig
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.blocks import on_blocks
from simulation.harness.drive_presets import with_drive_type
from tests.bench.staged_bench import STAGES, BenchReport, StagedBench
from tests.folders import EXAMPLE_CONFIGURATION

MODULES = [import_module(f"tests.bench.test_{number}_{name}") for number, name in enumerate(STAGES, 1)]


def claims() -> Iterator[tuple[str, Callable[[StagedBench], None]]]:
    """Yield the tests of all stages in pytest's order: the name of the stage, and what to call."""
    for name, module in zip(STAGES, MODULES, strict=True):
        for title, test in vars(module).items():
            if title.startswith("test_"):
                of_joints = [{"joint": joint} for joint in JOINTS]
                arguments = of_joints if "joint" in inspect.signature(test).parameters else [{}]
                yield from ((name, partial(test, **each)) for each in arguments)


def first_complaint(rig: SimulatedRig, begin: str) -> tuple[str, str]:
    """Return the first stage that fails, and its message; `begin` is the first stage to run."""
    bench = StagedBench(TestRig(rig, simulated_operator(rig)), BenchReport())
    for name, claim in dropwhile(lambda each: each[0] != begin, claims()):
        try:
            claim(bench)
        except (pytest.fail.Exception, BenchError) as complaint:
            return name, str(complaint)
        bench.test_rig.switch_off()
    return "", ""


def swapped_joints(configuration: Configuration) -> SimulatedRig:
    """Return a rig with two motors exchanged."""
    sweep, adduction = (configuration.drive[f"left_{kind}"] for kind in ("sweep", "adduction"))
    drive = configuration.drive | {"left_sweep": adduction, "left_adduction": sweep}
    return SimulatedRig(configuration, replace(configuration, drive=drive))


def babble(rig: SimulatedRig) -> None:
    """Send ten frames of the unknown node id 40 in each tick."""
    for _ in range(10):
        for port in rig.buses["left"].ports:
            port.queue.append(Frame(40 << 5 | 0x15, bytes(8)))


def command(rig: SimulatedRig) -> None:
    """Send a torque command as another program would."""
    for port in rig.buses["right"].ports:
        port.queue.append(Frame(arbitration_id(3, codec.SET_INPUT_TORQUE), bytes(4)))


class Repeater:
    """Repeats the last torque command and so feeds the drive's watchdog."""

    def __init__(self) -> None:
        self._last: Frame | None = None

    def __call__(self, rig: SimulatedRig) -> None:
        for frame in rig.buses["left"].ports[0].queue:
            if frame.arbitration_id == arbitration_id(0, codec.SET_INPUT_TORQUE):
                self._last = frame
        if self._last is not None:
            rig.buses["left"].ports[0].queue.appendleft(self._last)


def hold_down(rig: SimulatedRig) -> None:
    """Hold a flipper down while the robot raises its flippers at the end of a walk."""
    if not hasattr(rig, "loop"):
        return
    arm, stopping = rig.robot.plant.arms[0], rig.loop.mode is Mode.STOPPING
    if stopping:
        arm.adduction_rad, arm.adduction_velocity_rad_s = -0.4, 0.0
    inertia_kg_m2 = 1e6 if stopping else rig.loop.configuration.arm.adduction_inertia_kg_m2  # no torque moves it
    held = replace(arm.parameters.arm_mass, adduction_inertia_kg_m2=inertia_kg_m2)
    arm.parameters = replace(arm.parameters, arm_mass=held)


class DriveRestart:
    """Restarts a drive in the third stride."""

    def __init__(self) -> None:
        self.done = False

    def __call__(self, rig: SimulatedRig) -> None:
        walking = hasattr(rig, "loop") and rig.loop.mode is Mode.WALKING
        if walking and rig.loop.target.stride == 2 and not self.done:
            self.done = True
            rig.robot.restart_drive(2)


def stuck_encoder(configuration: Configuration) -> SimulatedRig:
    """Return a rig with an encoder that always reports the same angle, and no speed."""
    rig = SimulatedRig(configuration)
    rig.robot.drives[1].measure = lambda angle_rad, velocity_rad_s: None  # type: ignore[method-assign]
    return rig


def swapped_buses(configuration: Configuration) -> SimulatedRig:
    other = {"left": "right", "right": "left"}
    drive = {joint: replace(each, bus=other[each.bus]) for joint, each in configuration.drive.items()}
    return SimulatedRig(configuration, replace(configuration, drive=drive))


SILENT = {"encoder_period_s": 1e9, "current_period_s": 1e9, "heartbeat_period_s": 1e9, "slow_period_s": 1e9}
SOFT = {"sweep_stiffness_nm_rad": 0.5, "sweep_damping_nm_s_rad": 0.01}
Rigs = Callable[[Configuration], SimulatedRig]


def others(*senders: Callable[[SimulatedRig], None]) -> Rigs:
    return lambda configuration: SimulatedRig(configuration, others=senders)


def drive(joint: str, **changes: float) -> Rigs:
    def make(configuration: Configuration) -> SimulatedRig:
        drives = on_blocks(configuration).drives(configuration)
        drives[joint] = replace(drives[joint], **changes)  # type: ignore[arg-type]
        return SimulatedRig(configuration, drives=drives)

    return make


def joint(name: str, **changes: Any) -> Rigs:
    return lambda c: SimulatedRig(c, replace(c, drive=c.drive | {name: replace(c.drive[name], **changes)}))


def section(name: str, **changes: float) -> Rigs:
    return lambda c: SimulatedRig(replace(c, **{name: replace(getattr(c, name), **changes)}))


def firmware05(built: bool = True, configured: bool = True, **changes: Any) -> Rigs:
    """Make rigs with ODrives of firmware 0.5, or one that is only configured or only built so."""

    def make(_: Configuration) -> SimulatedRig:
        text = EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")
        usual, other = parse_configuration(text), parse_configuration(with_drive_type(text, "odrive05"))
        robot = other if built else usual
        drives = on_blocks(robot).drives(robot)
        drives["left_sweep"] = replace(drives["left_sweep"], **changes)
        return SimulatedRig(other if configured else usual, robot, drives)

    return make


# what is wrong, the stage that finds it, and a part of its advice; stages before `begin` pass and are slow
WRONG: tuple[tuple[str, Rigs, str, str, str], ...] = (
    ("buses", swapped_buses, "wiring", "exchange the buses' channels", "wiring"),
    ("missing drive", drive("left_adduction", **SILENT), "wiring", "check its power, wiring", "wiring"),
    ("unknown sender", others(babble), "wiring", "node 40: take it off the bus", "wiring"),
    ("second program", others(command), "wiring", "commands to node 3 from another", "wiring"),
    ("rare messages", drive("left_sweep", current_period_s=0.01), "wiring", "message period", "wiring"),
    ("watchdog off", drive("right_sweep", watchdog_s=0.0), "wiring", "enable_watchdog", "wiring"),
    ("slow watchdog", drive("right_sweep", watchdog_s=0.5), "wiring", "watchdog_timeout = 0.1", "wiring"),
    ("firmware 0.5 for 0.6", firmware05(configured=False), "wiring", "left_sweep", "wiring"),
    ("firmware 0.6 for 0.5", firmware05(built=False), "wiring", "it is 0.6.11", "wiring"),
    ("node ids", swapped_joints, "zeros", "exchange the node ids", "wiring"),
    ("adduction's sign", joint("left_adduction", sign=1), "zeros", "drive.left_adduction.sign", "wiring"),
    ("stuck encoder", stuck_encoder, "signs", "left_adduction: answer to a shake is 0 rad", "signs"),
    ("other direction", firmware05(encoder_direction=-1), "signs", "left_sweep follows other torques", "signs"),
    ("offset", drive("left_adduction", encoder_offset_rad=0.15), "zeros", "drive.left_adduction.zero_turn", "zeros"),
    ("limits", section("limits", sweep_max_deg=110.0), "zeros", "narrow [limits]", "zeros"),
    ("other counts", firmware05(encoder_counts=4000), "zeros", "counts of a turn", "zeros"),
    ("constant", joint("right_sweep", torque_constant_nm_a=0.1), "currents", "right_sweep.torque_const", "currents"),
    ("slow drive", drive("left_sweep", current_lag_s=0.006), "currents", "slow current loop", "currents"),
    ("repeater", others(Repeater()), "watchdogs", "another program that feeds it", "watchdogs"),
    ("fed", drive("right_adduction", any_frame_feeds=True), "watchdogs", "right_adduction: idle among", "watchdogs"),
    ("soft gains", section("gains", **SOFT), "strokes", "[gains]", "strokes"),
    ("held down", others(hold_down), "stops", "something holds the flippers down", "stops"),
    ("drive restarts", others(DriveRestart()), "strides", "right_sweep", "strides"),
)


@pytest.mark.parametrize(
    ("rigs", "stage", "advice", "begin"), [row[1:] for row in WRONG], ids=[row[0] for row in WRONG]
)
def test_every_wrong_wiring_is_found_by_its_stage(
    configuration: Configuration, rigs: Rigs, stage: str, advice: str, begin: str
) -> None:
    found, message = first_complaint(rigs(configuration), begin)
    assert (found, advice in message) == (stage, True), f"{found}: {message}"
