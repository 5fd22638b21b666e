"""Simulates another program that commands one of the robot's drives: a second bus master.

It sends its torque right after every n-th torque command of the loop, so that the drive follows it until the next one.
`SimulatedRobot.foreign_masters` lists those on its buses.
"""

from dataclasses import dataclass

from drivers.can.frames import Frame
from simulation.devices.simulated_drive import SimulatedDrive


@dataclass(slots=True, eq=False)  # two programs that are alike are two
class ForeignMaster:
    drive: SimulatedDrive
    torque_nm: float  # of the joint
    every: int = 2  # commands of the loop to one of this program
    heard: bool = True  # the frames are on the loop's bus; False: on another path to the drive, such as its USB
    commands: int = 0  # of the loop, so far

    def answer(self, frame: Frame) -> Frame | None:
        """Return the command that follows a frame of the loop on the bus, or None."""
        own = self.drive.forge_torque(self.torque_nm)
        if frame.arbitration_id != own.arbitration_id or frame.is_remote:
            return None
        self.commands += 1
        return None if self.commands % self.every else own
