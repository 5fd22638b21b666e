"""The simulated robot without buses: its drives take samples and send no frames."""

from random import Random
from typing import cast

from control.records import Joints, Torques
from simulation.body.plant import STEP_S
from simulation.devices.direct import DirectDrive
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.robot import SimulatedRobot


class DirectRobot(SimulatedRobot):
    """Steps the mechanics under torques that last from one command to the next, unless a drive changes by itself."""

    def _make_drive(self, parameters: SimulatedDriveParameters, random: Random) -> DirectDrive:
        return DirectDrive(parameters, random)

    def _simulate(self, until_s: float) -> None:
        drives = cast("Joints[DirectDrive]", self.drives)
        flippers = tuple(zip(self.plant.arms, drives[::2], drives[1::2], strict=True))
        changing = any([drive.changes_by_itself for drive in drives])
        torques = Joints[float]() if changing else self._torques()
        while self.now_s + STEP_S <= until_s:
            self.now_s = now_s = self.now_s + STEP_S
            if changing:
                self._measure()
                torques = self._torques()
            self.plant.step(STEP_S, torques)
            for observe in self.observers:
                observe(STEP_S, torques)
            for arm, sweep, lift in flippers:
                sweep_rad, sweep_rad_s, adduction_rad, adduction_rad_s = arm.motors
                sweep.sample(now_s, sweep_rad, sweep_rad_s)
                lift.sample(now_s, adduction_rad, adduction_rad_s)

    def _torques(self) -> Torques:
        return Joints(*[drive.torque_nm(self.now_s) for drive in self.drives])
