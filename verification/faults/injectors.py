"""Injectors of failures in drives, buses and joints: contexts in which something fails on a joint of the bench.

Some use the failures of `mudskipper fail`. The others act in the simulated drive, move the joint, or send frames on the
bus that come from neither drive nor loop. loop_injectors.py has those for the loop and the daemon.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from math import copysign
from typing import Any

from control.modes import Mode
from drivers.can.frames import Frame
from drivers.drive_types import type_of
from simulation.devices.drive import DriveError, Forgery
from simulation.devices.foreign_master import ForeignMaster
from verification.faults.bench import FaultBench

LONGEST_S = 60.0
BLOCKED_KG_M2 = 1e6  # too much inertia for any torque
PUSHED_RAD, PUSHES = 0.2, 10  # more than full torque deflects a joint, and less than a following error

Injector = Callable[[FaultBench, str], AbstractContextManager[None]]
Act = Callable[[FaultBench, str], None]


def once(act: Act) -> Injector:
    """Act at the injection."""

    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        act(bench, joint)
        yield

    return inject


def in_every_step(act: Act) -> Injector:
    """Act in every step while the failure lasts."""

    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        with bench.every_step(lambda: act(bench, joint)):
            yield

    return inject


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


@contextmanager
def unheard(bench: FaultBench, joint: str) -> Iterator[None]:
    """Lose everything that the drive sends; commands reach it."""
    own = bench.loop.configuration.drive[joint]
    port = bench.loop.drives.ports[own.bus]
    receive = port.receive

    def is_lost(frame: Frame) -> bool:
        content = type_of(own).read_frame(frame)
        return content is not None and content.node_id == own.node_id and not content.is_command

    vars(port)["receive"] = lambda: [frame for frame in receive() if not is_lost(frame)]
    yield
    del vars(port)["receive"]


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


@once
def watchdog_tripped(bench: FaultBench, joint: str) -> None:
    bench.drive(joint).trip(DriveError.WATCHDOG)


@once
def overcurrent(bench: FaultBench, joint: str) -> None:
    bench.drive(joint).trip(DriveError.OVERCURRENT)


@contextmanager
def watchdog_ran_out(bench: FaultBench, joint: str) -> Iterator[None]:
    """Cut off the commands until the drive's watchdog has tripped; the injection begins there."""
    with failing("JOINT.command", "off")(bench, joint):
        bench.run_until(lambda: bench.drive(joint).failed, 0.5)
        yield


def _leave_closed_loop(bench: FaultBench, joint: str) -> None:
    bench.drive(joint).energised = False


left_closed_loop, never_in_closed_loop = once(_leave_closed_loop), in_every_step(_leave_closed_loop)


@once
def restart(bench: FaultBench, joint: str) -> None:
    bench.drive(joint).restart(bench.robot.now_s)


def duplicate(angle_rad: float) -> Injector:
    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        with bench.every_step(bench.add_duplicate(joint, angle_rad)):
            yield

    return inject


# other senders on the bus


def forged(forgery: Forgery) -> Injector:
    return once(lambda bench, joint: bench.send_foreign(joint, bench.drive(joint).forge(forgery)))


def current_reported(current_a: float) -> Injector:
    """Report another current after each report of the drive itself."""
    return in_every_step(lambda bench, joint: bench.send_foreign(joint, bench.drive(joint).forge_current(current_a)))


@in_every_step
def other_master(bench: FaultBench, joint: str) -> None:
    """Command this drive into closed loop without torque, as another program would."""
    bench.send_foreign(joint, bench.drive(joint).forge(Forgery.CLOSE_LOOP))


def commanded_by_another(torque_nm: float, every: int, heard: bool) -> Injector:
    """Let another program command a torque after every nth command of the loop; `heard`: on the loop's own bus."""

    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        masters = bench.robot.foreign_masters
        masters.append(ForeignMaster(bench.drive(joint), torque_nm, every, heard))
        yield
        masters.pop()

    return inject


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
def jammed(bench: FaultBench, joint: str) -> Iterator[None]:
    """Block a joint where it is."""
    arm, kind = bench.arm_of(joint), joint.split("_")[1]
    before, inertia = arm.parameters, f"{kind}_inertia_kg_m2"
    arm.parameters = replace(before, arm_mass=replace(before.arm_mass, **{inertia: BLOCKED_KG_M2}))
    _move(bench, joint, _angle_rad(bench, joint))
    yield
    arm.parameters = before


@contextmanager
def blocked(bench: FaultBench, joint: str) -> Iterator[None]:
    """Push a sweep joint off its pose until the torque is at its limit, and block it there."""
    joint = joint.replace("adduction", "sweep")
    for _ in range(PUSHES):
        _move(bench, joint, _angle_rad(bench, joint) + PUSHED_RAD / PUSHES)
        bench.step()
    with jammed(bench, joint):
        bench.step()
        yield


@contextmanager
def stiff(bench: FaultBench, joint: str) -> Iterator[None]:
    """Multiply the stiffness, beyond what the delay of the loop permits."""
    controller = bench.loop.controller
    before = controller.gains
    controller.gains = replace(before, sweep_stiffness_nm_rad=200.0, adduction_stiffness_nm_rad=200.0)
    yield
    controller.gains = before


@contextmanager
def damped_against_command(bench: FaultBench, joint: str) -> Iterator[None]:
    """Let an encoder jump, so that the joints are damped, and report a current against the command from there on."""
    with drive_with(encoder_offset_rad=0.6)(bench, joint):
        bench.run_until(lambda: bench.loop.mode is Mode.DAMPING, 0.1)
        with current_reversed(bench, joint):
            yield


@once
def recovery_given_up(bench: FaultBench, joint: str) -> None:
    """Wait until the last attempt of a recovery has failed; the injection begins there."""
    bench.run_until(lambda: bool(bench.loop.controller.recovery.given_up), 5.0)


@contextmanager
def current_reversed(bench: FaultBench, joint: str) -> Iterator[None]:
    """Report a current against the commanded torque. The answer to a question follows the command that asks."""
    drive, index = bench.drive(joint), bench.index_of(joint)
    own = bench.loop.configuration.drive[joint]

    def report() -> None:
        current_a = -copysign(4.0, bench.loop.sent.torques_nm[index]) * drive.parameters.sign
        bench.send_foreign(joint, drive.forge_current(current_a))

    with bench.every_step(report, late=type_of(own).query(own.node_id) is not None):
        yield
