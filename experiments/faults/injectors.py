"""Injectors of failures in drives, buses and joints: contexts in which something fails on a joint of the bench.

Some use the failures of `mudskipper fail`. The others act in the simulated drive, move the joint, or send frames on the
bus that come from neither drive nor loop. loop_injectors.py has those for the loop and the daemon.
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
BLOCKED_KG_M2 = 1e6  # too much inertia for any torque

Injector = Callable[[FaultBench, str], AbstractContextManager[None]]


def failing(component: str, kind: str) -> Injector:
    """Inject a failure of `mudskipper fail`. JOINT and BUS in its name stand for the drawn joint and its bus."""

    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        bus = bench.loop.configuration.drive[joint].bus
        name = component.replace("JOINT", joint).replace("BUS", bus)
        bench.fail(name, kind, LONGEST_S)
        yield
        bench.failures.end(name)

    return inject


# in a drive


def drive_with(**changes: Any) -> Injector:
    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        drive = bench.drive(joint)
        before = drive.parameters
        drive.parameters = replace(before, **changes)
        yield
        drive.parameters = before

    return inject


@contextmanager
def overcurrent(bench: FaultBench, joint: str) -> Iterator[None]:
    bench.drive(joint).trip(DriveError.OVERCURRENT)
    yield


@contextmanager
def watchdog_ran_out(bench: FaultBench, joint: str) -> Iterator[None]:
    """Cut off the commands until the drive's watchdog has tripped; the injection begins there."""
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

    with bench.every_step(leave):
        yield


@contextmanager
def restart(bench: FaultBench, joint: str) -> Iterator[None]:
    bench.drive(joint).restart(bench.robot.now_s)
    yield


def duplicate(angle_rad: float) -> Injector:
    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        with bench.every_step(bench.add_duplicate(joint, angle_rad)):
            yield

    return inject


# other senders on the bus


def forged(forgery: Forgery) -> Injector:
    """Sends the frame once."""

    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        bench.send_foreign(joint, bench.drive(joint).forge(forgery))
        yield

    return inject


def current_reported(current_a: float) -> Injector:
    """Reports another current after each report of the drive itself."""

    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        with bench.every_step(lambda: bench.send_foreign(joint, bench.drive(joint).forge_current(current_a))):
            yield

    return inject


@contextmanager
def other_master(bench: FaultBench, joint: str) -> Iterator[None]:
    """Another program commands this drive into closed loop, without torque."""

    def command() -> None:
        bench.send_foreign(joint, bench.drive(joint).forge(Forgery.CLOSE_LOOP))

    with bench.every_step(command):
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


def moved_at_speed(velocity_rad_s: float) -> Injector:
    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        signed_rad_s = -copysign(velocity_rad_s, _angle_rad(bench, joint))

        def move() -> None:
            _move(bench, joint, _angle_rad(bench, joint), signed_rad_s)

        move()
        with bench.every_step(move):
            yield

    return inject


@contextmanager
def blocked(bench: FaultBench, joint: str) -> Iterator[None]:
    """Push a sweep joint beyond the range of the gait and block it; the injection begins when it stands still."""
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
def recovery_given_up(bench: FaultBench, joint: str) -> Iterator[None]:
    """Wait until the last attempt of a recovery has failed; the injection begins there."""
    bench.run_until(lambda: bool(bench.loop.controller.recovery.given_up), 5.0)
    yield


@contextmanager
def current_reversed(bench: FaultBench, joint: str) -> Iterator[None]:
    """Report a current against the commanded torque."""
    index, sign = JOINTS.index(joint), bench.drive(joint).parameters.sign

    def report() -> None:
        current_a = -copysign(4.0, bench.loop.sent.torques_nm[index]) * sign
        bench.send_foreign(joint, bench.drive(joint).forge_current(current_a))

    with bench.every_step(report):
        yield
