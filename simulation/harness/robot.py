"""The simulated robot as a peer on the bus: plant and drives, stepped to any moment in time.

It knows frames only. In real time a process steps it to the present; in tests the daemon's own tick steps it to the
tick's moment. Deterministic for a seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

from control.records import JOINTS, Joints, Torques
from drivers.can.can_port import CanPort
from simulation.body.plant import STEP_S, Plant, PlantParameters
from simulation.devices.odrive import OdriveParameters, SimulatedOdrive
from simulation.mud.track import Track


class SimulatedRobot:
    """Owns simulated time. `ports` are the robot's ends of the buses that `bus_of_joint` names."""

    def __init__(
        self,
        plant: PlantParameters,
        track: Track,
        drives: Mapping[str, OdriveParameters],
        bus_of_joint: Mapping[str, str],
        ports: Mapping[str, CanPort],
        seed: int = 1,
        start_s: float = 0.0,
    ) -> None:
        random = Random(seed)
        self.plant = Plant(plant, track, Random(f"mud {seed}"))  # the drives' draws are none of its
        self.drives = tuple(SimulatedOdrive(drives[joint], random) for joint in JOINTS)
        self._ports = dict(ports)
        self._port_of_drive = tuple(ports[bus_of_joint[joint]] for joint in JOINTS)
        self.now_s = start_s
        self._hand_wanted = False
        for drive in self.drives:
            drive.reset(start_s)
        self._measure()

    def advance(self, until_s: float) -> None:
        """Obey the frames that have arrived, then live on until `until_s`, sending what comes due."""
        self._obey()
        if self._hand_wanted:
            self._hand_wanted = False
            for arm in self.plant.arms:
                arm.put_back()
        while self.now_s + STEP_S <= until_s:
            self.now_s += STEP_S
            a, b, c, d = self.drives
            torques: Torques = Joints(
                a.torque_nm(self.now_s), b.torque_nm(self.now_s), c.torque_nm(self.now_s), d.torque_nm(self.now_s)
            )  # fmt: skip
            self.plant.step(STEP_S, torques)
            self._measure()
            self._report()

    def lend_hand(self) -> None:
        """A person moves the flippers back, at the next moment between two steps: a signal handler may call this."""
        self._hand_wanted = True

    def restart_drive(self, place: int) -> None:
        """The drive of the joint at this place in JOINTS loses its supply for a moment."""
        self.drives[place].restart(self.now_s)

    def _obey(self) -> None:
        for port in self._ports.values():
            for frame in port.receive():
                for drive, drive_port in zip(self.drives, self._port_of_drive, strict=True):
                    if drive_port is port:
                        for answer in drive.receive(frame, self.now_s):
                            port.send(answer)

    def _measure(self) -> None:
        plant = self.plant
        for drive, angle_rad, velocity_rad_s in zip(self.drives, plant.angles_rad, plant.velocities_rad_s, strict=True):
            drive.measure(angle_rad, velocity_rad_s)

    def _report(self) -> None:
        for drive, port in zip(self.drives, self._port_of_drive, strict=True):
            for frame in drive.cyclic_frames(self.now_s):
                port.send(frame)
