"""Physical harm to a joint, its drive, the bus or the loop, which no component reports by itself.

Several harms of one joint add up, and each leaves the others as they are when it ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from control.records import JOINTS, Torques
from simulation.devices.drive import DriveError, Forgery
from simulation.devices.foreign_master import ForeignMaster
from simulation.harness.lockstep import Lockstep
from tests.dst.scenario import Harm

PUSH_NM = 0.3  # of a hand: half of a motor's limit
FOREIGN_NM = 0.6
LATE_TICKS = 4

DRIVE_HARMS: Mapping[str, Mapping[str, Any]] = {  # changes of the drive's parameters while it lasts
    "inverted motor": {"commutation_error_deg": 180.0},
    "weak motor": {"commutation_error_deg": 75.0},
    "strong motor": {"torque_constant_error": 0.4},
    "frozen encoder": {"encoder_frozen": True},
    "shifted encoder": {"encoder_offset_rad": 0.6},
    "noisy encoder": {"encoder_noise_rad": 0.005, "velocity_noise_rad_s": 1.0},
    "slow current": {"current_lag_s": 0.02},
    "repeated messages": {"repeated_fraction": 0.7},
    "late messages": {"message_delay_s": 0.01},
    "warm motor": {"temperature_c": 82.0},
    "hot motor": {"temperature_c": 95.0},
    "low supply": {"bus_voltage_v": 19.0},
    "lower supply": {"bus_voltage_v": 17.0},
}
MASTERS = {  # another program's commands: after how many of ours, and whether our bus carries them
    "foreign torque": (2, True),
    "seldom foreign torque": (10, True),
    "unheard foreign torque": (2, False),
}


class Active(NamedTuple):
    harm: Harm
    until_s: float


class Harms:
    """Owns the harms that last, and applies them to a robot in lockstep."""

    def __init__(self, robot: Lockstep) -> None:
        self.active: list[Active] = []
        self._robot = robot
        self._sound = [drive.parameters for drive in robot.robot.drives]
        self._foreign_ports = {name: bus.open() for name, bus in robot.buses.items()}
        robot.robot.observers.append(self._push)

    def begin(self, harm: Harm) -> None:
        self.active.append(Active(harm, self._robot.now_s + harm.for_s))
        if harm.name in ONCE:
            ONCE[harm.name](self._robot, JOINTS.index(harm.joint))
        if harm.name in FORGED:
            frame = self._robot.robot.drives[JOINTS.index(harm.joint)].forge(FORGED[harm.name])
            self._foreign_ports[self._robot.loop.configuration.drive[harm.joint].bus].send(frame)
        self._apply()

    def update(self) -> None:
        """Ends the harms whose time is over; call it before every tick."""
        over = [each for each in self.active if each.until_s <= self._robot.now_s]
        if over:
            self.active = [each for each in self.active if each not in over]
            self._apply()

    def end_all(self) -> None:
        self.active.clear()
        self._apply()

    def _apply(self) -> None:
        self._robot.wall_offset_s = 0.5 if any(each.harm.name == "wall clock step" for each in self.active) else 0.0
        self._robot.robot.foreign_masters[:] = [
            ForeignMaster(self._robot.robot.drives[JOINTS.index(each.harm.joint)], FOREIGN_NM, *MASTERS[each.harm.name])
            for each in self.active
            if each.harm.name in MASTERS
        ]
        for joint, sound, drive in zip(JOINTS, self._sound, self._robot.robot.drives, strict=True):
            changes: dict[str, Any] = {}
            for active in self.active:
                if active.harm.joint == joint:
                    changes |= DRIVE_HARMS.get(active.harm.name, {})
            if drive.parameters != (changed := replace(sound, **changes)):
                drive.parameters = changed

    def _push(self, dt_s: float, torques_nm: Torques) -> None:
        """Pushes or holds joints in every step of the mechanics."""
        for active in self.active:
            joint = active.harm.joint
            arm, axis = self._robot.robot.plant.arms[JOINTS.index(joint) // 2], joint.split("_")[1]
            velocity = f"{axis}_velocity_rad_s"
            if active.harm.name == "push":
                inertia_kg_m2 = getattr(arm.parameters.arm_mass, f"{axis}_inertia_kg_m2")
                setattr(arm, velocity, getattr(arm, velocity) + dt_s * PUSH_NM / inertia_kg_m2)
            elif active.harm.name == "blocked":
                setattr(arm, velocity, 0.0)


def _miss_ticks(robot: Lockstep, joint: int) -> None:
    robot.late_ticks += LATE_TICKS


def _leave_closed_loop(robot: Lockstep, joint: int) -> None:
    robot.robot.drives[joint].energised = False


ONCE: Mapping[str, Callable[[Lockstep, int], None]] = {
    "restart": lambda robot, joint: robot.robot.restart_drive(joint),
    "overcurrent": lambda robot, joint: robot.robot.drives[joint].trip(DriveError.OVERCURRENT),
    "left closed loop": _leave_closed_loop,
    "late tick": _miss_ticks,
}
FORGED = {"foreign stop": Forgery.EMERGENCY_STOP, "foreign arming": Forgery.CLOSE_LOOP}
NAMES = (*DRIVE_HARMS, *ONCE, *FORGED, *MASTERS, "push", "blocked", "wall clock step")
FOREIGN = (*MASTERS, "foreign arming")  # while they last, the drive's torque is not ours
