"""Simulated motors whose torques and reports are numbers instead of frames.

Motor, encoder, noise and the times of the samples are those of an ODrive with firmware 0.6. What belongs to its wire is
left out: rounding to binary32, messages that are late or repeated, settings, the watchdog, and the clamp of the
velocity, which takes at most 3 % of the torque of a joint within its limits.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from random import Random

from control.parameters.joint_limits import JointLimits
from control.records import NEVER_S, UNKNOWN, DriveState, DriveStates, Joints, Torques
from drivers.drive import DriveHealth
from drivers.drives import Drives
from drivers.transmit_gate import TransmitGate
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.odrive.device import TORQUE_MODES, SimulatedOdrive
from simulation.devices.simulated_drive import TURN_RAD

WATCHDOG_S = 0.1  # reported, as there is nothing to watch


class DirectDrive(SimulatedOdrive):
    """Owns the newest sample of each signal."""

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        self._rad_per_turn = parameters.sign * TURN_RAD
        super().__init__(replace(parameters, watchdog_s=0.0), random)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self._modes = TORQUE_MODES
        self._set_limits(inf, self.parameters.current_limit_a)
        self._angle_due_s, self._current_due_s, self._state_due_s, _ = self._due_s
        self._sampled_angle = self._sampled_speed = self._sampled_a = UNKNOWN
        self._angle_stamp_s = self._current_stamp_s = self._state_stamp_s = NEVER_S
        self._reports_torque = False

    def command(self, torque_nm: float) -> None:
        """Set the joint's torque."""
        self._setpoint_nm = self.parameters.sign * torque_nm

    @property
    def changes_by_itself(self) -> bool:
        """Whether torque or encoder change from one command to the next, other than by the motion."""
        parameters = self.parameters
        return bool(parameters.current_lag_s or parameters.cogging_nm or parameters.encoder_slip_rad_s)

    def sample(self, now_s: float, angle_rad: float, velocity_rad_s: float) -> None:
        """Take the samples that are due, of a joint with this motion."""
        periods = self.parameters
        if now_s >= self._angle_due_s:
            self.measure(angle_rad, velocity_rad_s)
            self._angle_due_s += periods.encoder_period_s
            self._sampled_angle, self._sampled_speed = self._measured_angle(), self._measured_speed()
            self._angle_stamp_s = now_s
        if now_s >= self._current_due_s:
            self._current_due_s += periods.current_period_s
            self._sampled_a, self._current_stamp_s = self._current_a + self._noise(periods.current_noise_a), now_s
        if now_s >= self._state_due_s:
            self._state_due_s += periods.heartbeat_period_s
            self._reports_torque, self._state_stamp_s = self.energised, now_s

    @property
    def state(self) -> DriveState:
        parameters, stamp_s = self.parameters, self._state_stamp_s
        return DriveState(  # by position: it is built for every drive in every tick
            (self._sampled_angle - parameters.zero_turn) * self._rad_per_turn,
            self._sampled_speed * self._rad_per_turn,
            self._angle_stamp_s,
            parameters.sign * self._sampled_a,
            self._current_stamp_s,
            self._reports_torque,
            0,
            stamp_s,
            parameters.temperature_c,
            stamp_s,
            parameters.bus_voltage_v,
            stamp_s,
            self.supply_a,
        )


class DirectDrives(Drives):
    """The drives of all joints, without ports."""

    def __init__(self, drives: Sequence[DirectDrive], joints: Sequence[str], limits: JointLimits) -> None:
        super().__init__([], {}, TransmitGate(limits))
        self._drives = tuple(drives)
        self._health = Joints(
            *[DriveHealth(joint=joint, firmware_supported=True, watchdog_s=WATCHDOG_S) for joint in joints]
        )

    def read(self, now_s: float) -> DriveStates:
        return Joints(*[drive.state for drive in self._drives])

    @property
    def heard(self) -> bool:
        return all(drive.state.heard for drive in self._drives)

    @property
    def health(self) -> Joints[DriveHealth]:
        return self._health

    def send(self, torques_nm: Torques, elapsed_s: float) -> None:
        for drive, torque_nm in zip(self._drives, torques_nm, strict=True):
            drive.command(torque_nm)

    def arm(self, now_s: float, at_once: bool = False) -> None:
        for drive in self._drives:
            drive.energised = True

    def disarm(self, now_s: float, at_once: bool = False) -> None:
        for drive in self._drives:
            drive.command(0.0)
            drive.energised = False

    def request_supply(self) -> None:
        """Does nothing: it is in every state."""
