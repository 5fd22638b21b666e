"""The ways in which something is made to fail, as contexts: a cause begins at one tick and is gone after its context.

Some are made by the failures that a robot's owner can ask for, the others in the simulated drives, with a hand on a
joint, by strangers on the bus, and in the loop itself. Each is told the joint that it is about.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from math import copysign
from typing import Any

from control.records import JOINTS
from experiments.faults.bench import FaultBench
from simulation.devices.drive import DriveError, Forgery

LONGEST_S = 60.0
BLOCKED_KG_M2 = 1e6  # nothing moves this

Cause = Callable[[FaultBench, str], AbstractContextManager[None]]


def failing(component: str, kind: str) -> Cause:
    """By `mudskipper fail`; JOINT and BUS stand for one that is drawn."""

    @contextmanager
    def cause(bench: FaultBench, joint: str) -> Iterator[None]:
        bus = bench.loop.configuration.drive[joint].bus
        name = component.replace("JOINT", joint).replace("BUS", bus)
        bench.fail(name, kind, LONGEST_S)
        yield
        bench.failures.end(name)

    return cause


# in a drive


def drive_with(**changes: Any) -> Cause:
    @contextmanager
    def cause(bench: FaultBench, joint: str) -> Iterator[None]:
        drive = bench.drive(joint)
        before = drive.parameters
        drive.parameters = replace(before, **changes)
        yield
        drive.parameters = before

    return cause


@contextmanager
def overcurrent(bench: FaultBench, joint: str) -> Iterator[None]:
    bench.drive(joint).trip(DriveError.OVERCURRENT)
    yield


@contextmanager
def watchdog_ran_out(bench: FaultBench, joint: str) -> Iterator[None]:
    """Commands do not reach the drive; the cause is that it has given up waiting."""
    with failing("JOINT.command", "off")(bench, joint):
        bench.run_until(lambda: bench.drive(joint).failed, 0.5)
        yield


@contextmanager
def left_closed_loop(bench: FaultBench, joint: str) -> Iterator[None]:
    bench.drive(joint).energised = False
    yield


@contextmanager
def never_in_closed_loop(bench: FaultBench, joint: str) -> Iterator[None]:
    def leave() -> None:
        bench.drive(joint).energised = False

    with bench.acting(leave):
        yield


@contextmanager
def restart(bench: FaultBench, joint: str) -> Iterator[None]:
    bench.drive(joint).restart(bench.robot.now_s)
    yield


def duplicate(angle_rad: float) -> Cause:
    @contextmanager
    def cause(bench: FaultBench, joint: str) -> Iterator[None]:
        with bench.acting(bench.add_duplicate(joint, angle_rad)):
            yield

    return cause


# strangers on the bus


def forged(forgery: Forgery) -> Cause:
    """Sends the frame once."""

    @contextmanager
    def cause(bench: FaultBench, joint: str) -> Iterator[None]:
        bench.say(joint, bench.drive(joint).forge(forgery))
        yield

    return cause


def current_reported(current_a: float) -> Cause:
    """Reports another current after each report of the drive itself."""

    @contextmanager
    def cause(bench: FaultBench, joint: str) -> Iterator[None]:
        with bench.acting(lambda: bench.say(joint, bench.drive(joint).forge_current(current_a))):
            yield

    return cause


@contextmanager
def other_master(bench: FaultBench, joint: str) -> Iterator[None]:
    """Another program wants this drive in closed loop, without torque."""

    def command() -> None:
        bench.say(joint, bench.drive(joint).forge(Forgery.CLOSE_LOOP))

    with bench.acting(command):
        yield


# joints


def _move(bench: FaultBench, joint: str, angle_rad: float, velocity_rad_s: float = 0.0) -> None:
    arm, name = bench.arm_of(joint), joint.split("_")[1]
    setattr(arm, f"{name}_rad", angle_rad)
    setattr(arm, f"{name}_velocity_rad_s", velocity_rad_s)


def _angle_rad(bench: FaultBench, joint: str) -> float:
    angle_rad: float = getattr(bench.arm_of(joint), f"{joint.split('_')[1]}_rad")
    return angle_rad


@contextmanager
def out_of_range(bench: FaultBench, joint: str) -> Iterator[None]:
    angle_rad = 1.3 if joint.endswith("sweep") else 1.1  # 74 and 63 degrees: 60 and 45, and 10 of margin, are allowed
    before_rad = _angle_rad(bench, joint)
    _move(bench, joint, angle_rad)
    yield
    _move(bench, joint, before_rad)


def whirled(velocity_rad_s: float) -> Cause:
    @contextmanager
    def cause(bench: FaultBench, joint: str) -> Iterator[None]:
        way = -copysign(velocity_rad_s, _angle_rad(bench, joint))

        def whirl() -> None:
            _move(bench, joint, _angle_rad(bench, joint), way)

        whirl()
        with bench.acting(whirl):
            yield

    return cause


@contextmanager
def blocked(bench: FaultBench, joint: str) -> Iterator[None]:
    """Pushed aside, farther than the gait goes, and held there: the cause begins when it stands."""
    joint = joint.replace("adduction", "sweep")
    arm, start_rad = bench.arm_of(joint), _angle_rad(bench, joint)
    there_rad = copysign(0.78, start_rad)
    while abs(there_rad - _angle_rad(bench, joint)) > 0.02:
        _move(bench, joint, _angle_rad(bench, joint) + copysign(0.02, there_rad - start_rad))
        bench.step()
    before = arm.parameters
    arm.parameters = replace(before, arm_mass=replace(before.arm_mass, sweep_inertia_kg_m2=BLOCKED_KG_M2))
    _move(bench, joint, there_rad)
    bench.step()
    yield
    arm.parameters = before


@contextmanager
def given_up(bench: FaultBench, joint: str) -> Iterator[None]:
    """The mud holds the flippers: the cause is that the last attempt is over."""
    bench.run_until(lambda: bool(bench.loop.controller.recovery.given_up), 5.0)
    yield


@contextmanager
def wrong_way(bench: FaultBench, joint: str) -> Iterator[None]:
    """The current that a drive tells is against the torque that it was told."""
    place, sign = JOINTS.index(joint), bench.drive(joint).parameters.sign

    def report() -> None:
        current_a = -copysign(4.0, bench.loop.sent.torques_nm[place]) * sign
        bench.say(joint, bench.drive(joint).forge_current(current_a))

    with bench.acting(report):
        yield
