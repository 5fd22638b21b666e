"""Acts of failures in drives, buses and joints, by the names that the table of failures has for them.

They act in the simulated drive, move the joint, or send frames on the bus that come from neither drive nor loop. Every
act gets the robot and the joint, then the arguments of its row; the failure lasts as long as the context that it makes.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from functools import wraps
from math import copysign
from typing import Any

from control.modes import Mode
from control.rate import PERIOD_S
from drivers.can.frames import Frame
from drivers.drive_types import type_of
from simulation.body.plant import END_STOPS_RAD
from simulation.devices.drive import DriveError, Forgery
from simulation.devices.foreign_master import ForeignMaster
from verification.faults.failing_robot import FailingRobot

LONGEST_S = 60.0
BLOCKED_KG_M2 = 1e6  # too much inertia for any torque
PUSHED_RAD, PUSHES = 0.2, 10  # more than full torque deflects a joint, and less than a following error

Injection = AbstractContextManager[None]
ACTS: dict[str, Callable[..., Injection]] = {}


@contextmanager
def failing(robot: FailingRobot, joint: str, component: str, kind: str) -> Iterator[None]:
    name = component.replace("JOINT", joint).replace("NAME", robot.loop.configuration.drive[joint].bus)
    robot.fail(name, kind, LONGEST_S)
    yield
    robot.failures.end(name)


def during(act: Callable[..., Iterator[None]]) -> Callable[..., Injection]:
    """Register an act that lasts as long as the failure."""
    ACTS[act.__name__] = made = contextmanager(act)
    return made


def once(act: Callable[..., None]) -> Callable[..., Injection]:
    """Register an act that happens at the injection."""

    @wraps(act)
    def inject_once(robot: Any, joint: str, *arguments: Any) -> Iterator[None]:
        act(robot, joint, *arguments)
        yield

    return during(inject_once)


def in_every_step(act: Callable[..., None]) -> Callable[..., Injection]:
    """Register an act that happens in every step while the failure lasts."""

    @wraps(act)
    def inject_always(robot: FailingRobot, joint: str, *arguments: Any) -> Iterator[None]:
        with robot.every_step(lambda: act(robot, joint, *arguments)):
            yield

    return during(inject_always)


@during
def unheard(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Lose everything that the drive sends; commands reach it."""
    own = robot.loop.configuration.drive[joint]
    port = robot.loop.drives.ports[own.bus]
    receive = port.receive

    def is_lost(frame: Frame) -> bool:
        content = type_of(own).read_frame(frame)
        return content is not None and content.node_id == own.node_id and not content.is_command

    vars(port)["receive"] = lambda: [frame for frame in receive() if not is_lost(frame)]
    yield
    del vars(port)["receive"]


# in a drive


@once
def tripped(robot: FailingRobot, joint: str, error: str) -> None:
    robot.drive(joint).trip(DriveError[error])


@during
def watchdog_ran_out(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Cut off the commands until the drive's watchdog is about to trip; the injection begins there.

    The loop may see before that the drive follows an old command.
    """
    with failing(robot, joint, "JOINT.command", "off"):
        robot.run_for(robot.drive(joint).parameters.watchdog_s - 2.0 * PERIOD_S)
        yield


@once
def left_closed_loop(robot: FailingRobot, joint: str) -> None:
    robot.drive(joint).energised = False


@in_every_step
def never_in_closed_loop(robot: FailingRobot, joint: str) -> None:
    robot.drive(joint).energised = False


@once
def restart(robot: FailingRobot, joint: str) -> None:
    robot.drive(joint).restart(robot.robot.now_s)


@once
def restart_shifted(robot: FailingRobot, joint: str, shift_rad: float, boot_s: float) -> None:
    """Restart a drive, which counts from another zero afterwards."""
    robot.drive(joint).boot_s = boot_s
    robot.drive(joint).restart(robot.robot.now_s)
    robot.change_drive(joint, encoder_offset_rad=shift_rad)


@during
def supply_cut(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Cut the power of all drives, which boot afterwards."""
    robot.robot.powered = False
    yield
    robot.robot.powered = True


@during
def duplicate(robot: FailingRobot, joint: str, angle_rad: float) -> Iterator[None]:
    with robot.every_step(robot.add_duplicate(joint, angle_rad)):
        yield


# other senders on the bus


@once
def forged(robot: FailingRobot, joint: str, forgery: str) -> None:
    robot.send_foreign(joint, robot.drive(joint).forge(Forgery[forgery]))


@in_every_step
def current_reported(robot: FailingRobot, joint: str, current_a: float) -> None:
    """Report another current after each report of the drive itself."""
    robot.send_foreign(joint, robot.drive(joint).forge_current(current_a))


@in_every_step
def other_master(robot: FailingRobot, joint: str) -> None:
    """Command this drive into closed loop without torque, as another program would."""
    robot.send_foreign(joint, robot.drive(joint).forge(Forgery.CLOSE_LOOP))


@during
def commanded_by_another(robot: FailingRobot, joint: str, torque_nm: float, every: int, heard: bool) -> Iterator[None]:
    """Let another program command a torque after every nth command of the loop; `heard`: on the loop's own bus."""
    masters, master = robot.robot.foreign_masters, ForeignMaster(robot.drive(joint), torque_nm, every, heard)
    masters.append(master)
    yield
    masters.remove(master)


@during
def current_reversed(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Report a current against the commanded torque. The answer to a question follows the command that asks."""
    drive, index = robot.drive(joint), robot.index_of(joint)
    own = robot.loop.configuration.drive[joint]

    def report() -> None:
        current_a = -copysign(4.0, robot.loop.sent.torques_nm[index]) * drive.parameters.sign
        robot.send_foreign(joint, drive.forge_current(current_a))

    with robot.every_step(report, late=type_of(own).query(own.node_id) is not None):
        yield


@during
def damped_against_command(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Let an encoder jump, so that the joints are damped, and report a current against the command from there on."""
    with robot.drive_changed(joint, encoder_offset_rad=0.6):
        robot.run_until(lambda: robot.loop.mode is Mode.DAMPING, 0.1)
        with current_reversed(robot, joint):
            yield


# joints


def _axis(joint: str) -> str:
    return joint.split("_")[1]


def _move(robot: FailingRobot, joint: str, angle_rad: float, velocity_rad_s: float = 0.0) -> None:
    arm = robot.arm_of(joint)
    setattr(arm, f"{_axis(joint)}_rad", angle_rad)
    setattr(arm, f"{_axis(joint)}_velocity_rad_s", velocity_rad_s)


def _angle_rad(robot: FailingRobot, joint: str) -> float:
    angle_rad: float = getattr(robot.arm_of(joint), f"{_axis(joint)}_rad")
    return angle_rad


@in_every_step
def pushed(robot: FailingRobot, joint: str, torque_nm: float) -> None:
    """Push a joint with this torque, as a hand does."""
    arm, velocity = robot.arm_of(joint), f"{_axis(joint)}_velocity_rad_s"
    inertia_kg_m2 = getattr(arm.parameters.arm_mass, f"{_axis(joint)}_inertia_kg_m2")
    setattr(arm, velocity, getattr(arm, velocity) + PERIOD_S * torque_nm / inertia_kg_m2)


@during
def out_of_range(robot: FailingRobot, joint: str) -> Iterator[None]:
    angle_rad = 1.3 if joint.endswith("sweep") else 1.1  # 74 and 63 degrees: 60 and 45, and 10 of margin, are allowed
    before_rad = _angle_rad(robot, joint)
    _move(robot, joint, angle_rad)
    yield
    _move(robot, joint, before_rad)


@during
def slipped_to_stop(robot: FailingRobot, joint: str, rate_rad_s: float) -> Iterator[None]:
    """Put a joint at its upper stop, where an encoder that slips together with its speed has taken it unseen."""
    before_rad, stop_rad = _angle_rad(robot, joint), END_STOPS_RAD[joint.endswith("adduction")]
    _move(robot, joint, stop_rad)
    robot.drive(joint).measure(stop_rad, 0.0)
    slip = {"encoder_slip_rad_s": -rate_rad_s, "velocity_slip_rad_s": -rate_rad_s}
    with robot.drive_changed(joint, encoder_offset_rad=before_rad - stop_rad, **slip):
        yield


@during
def moved_at_speed(robot: FailingRobot, joint: str, velocity_rad_s: float) -> Iterator[None]:
    signed_rad_s = -copysign(velocity_rad_s, _angle_rad(robot, joint))

    def move() -> None:
        _move(robot, joint, _angle_rad(robot, joint), signed_rad_s)

    move()
    with robot.every_step(move):
        yield


@during
def jammed(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Block a joint where it is."""
    arm, inertia = robot.arm_of(joint), f"{_axis(joint)}_inertia_kg_m2"
    free_kg_m2 = getattr(robot.robot.plant.parameters.arm_mass, inertia)  # also where the arm is blocked twice

    def set_inertia(value_kg_m2: float) -> None:
        arm_mass = replace(arm.parameters.arm_mass, **{inertia: value_kg_m2})
        arm.parameters = replace(arm.parameters, arm_mass=arm_mass)

    set_inertia(BLOCKED_KG_M2)
    _move(robot, joint, _angle_rad(robot, joint))
    yield
    set_inertia(free_kg_m2)


@during
def blocked(robot: FailingRobot, joint: str) -> Iterator[None]:
    """Push a sweep joint off its pose until the torque is at its limit, and block it there."""
    joint = joint.replace("adduction", "sweep")
    for _ in range(PUSHES):
        _move(robot, joint, _angle_rad(robot, joint), PUSHED_RAD / PUSHES / PERIOD_S)
        robot.step()
    with jammed(robot, joint):
        robot.step()
        yield


@once
def recovery_given_up(robot: FailingRobot, joint: str) -> None:
    """Wait until the last attempt of a recovery has failed; the injection begins there."""
    robot.run_until(lambda: bool(robot.loop.controller.recovery.given_up), 5.0)
