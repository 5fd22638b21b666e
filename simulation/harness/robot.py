"""The simulated robot as a peer on the bus: plant and drives, stepped to any time.

It exchanges frames only. In real time a process steps it to the present; in tests the daemon's own tick steps it to
the tick's time. The same seed gives the same result.
"""

from collections.abc import Callable, Mapping
from random import Random

from control.records import Joints, Torques
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from simulation.body.plant import STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.drive_types import connect_drives, make_simulated_drive
from simulation.devices.foreign_master import ForeignMaster
from simulation.devices.simulated_drive import SimulatedDrive
from simulation.mud.track import Track


class SimulatedRobot:
    """Owns simulated time. `ports` are the robot's ends of the buses that `bus_of_joint` names."""

    def __init__(
        self,
        plant: PlantParameters,
        track: Track,
        drives: Mapping[str, SimulatedDriveParameters],
        bus_of_joint: Mapping[str, str],
        ports: Mapping[str, CanPort],
        seed: int = 1,
        start_s: float = 0.0,
    ) -> None:
        random = Random(seed)
        self.plant = Plant(plant, track, Random(f"mud {seed}"))  # independent of the drives' draws
        joints = plant.rig.joints
        self.drives: Joints[SimulatedDrive] = Joints(*(self._make_drive(drives[joint], random) for joint in joints))
        self._port_of_drive = tuple(ports[bus_of_joint[joint]] for joint in joints)
        self._drives_on = [
            (port, [drive for drive, own in zip(self.drives, self._port_of_drive, strict=True) if own is port])
            for port in ports.values()
        ]
        for _, drives_on_bus in self._drives_on:
            connect_drives(drives_on_bus)
        self.now_s = start_s
        self.observers: list[Callable[[float, Torques], None]] = []  # of each step's length and the motors' torques
        self.foreign_masters: list[ForeignMaster] = []  # other programs that command the drives
        self._put_back_requested = False
        self.powered = True  # False: the emergency stop is pressed
        for drive in self.drives:
            drive.reset(start_s)
        self._measure()

    def _make_drive(self, parameters: SimulatedDriveParameters, random: Random) -> SimulatedDrive:
        return make_simulated_drive(parameters, random)

    def advance(self, until_s: float) -> None:
        """Execute the frames that have arrived, then simulate until `until_s`."""
        self._execute_frames()
        if self._put_back_requested:
            self._put_back_requested = False
            self.plant.put_back()
        for drive in () if self.powered else self.drives:
            drive.restart(self.now_s)  # it boots once the power is back
        self._simulate(until_s)

    def _simulate(self, until_s: float) -> None:
        """Step mechanics and drives until `until_s`, and send messages as they come due."""
        wires = tuple(zip(self.drives, self._port_of_drive, strict=True))
        while self.now_s + STEP_S <= until_s:
            self.now_s = now_s = self.now_s + STEP_S
            torques: Torques = Joints(*[drive.torque_nm(now_s) for drive in self.drives])
            self.plant.step(STEP_S, torques)
            self._measure()
            for observe in self.observers:
                observe(STEP_S, torques)
            for drive, port in wires:
                for frame in drive.cyclic_frames(now_s):
                    port.send(frame)

    def request_put_back(self) -> None:
        """Set the robot down as an operator does by hand, before the next step: safe in a signal handler."""
        self._put_back_requested = True

    def turn_emergency_stop(self) -> None:
        """Press the emergency stop, which cuts the power of all drives, or release it: safe in a signal handler."""
        self.powered = not self.powered

    def restart_drive(self, joint: int) -> None:
        """Interrupt the supply of one drive for a moment. `joint`: its index in the rig's joints."""
        self.drives[joint].restart(self.now_s)

    def _execute_frames(self) -> None:
        for port, drives in self._drives_on:
            for frame in port.receive():
                for drive in drives:
                    for answer in drive.receive(frame, self.now_s):
                        port.send(answer)
                for master in self.foreign_masters:
                    if master.drive in drives:
                        self._command(master, frame, port)

    def _command(self, master: ForeignMaster, frame: Frame, port: CanPort) -> None:
        """Let another program command its drive after a frame of the loop."""
        foreign = master.answer(frame)
        if foreign is not None:
            master.drive.receive(foreign, self.now_s)
            if master.heard:
                port.send(foreign)

    def _measure(self) -> None:
        """Give each drive its motor's true motion; without records in between, as this runs in every step."""
        drives, joint = self.drives, 0
        for arm in self.plant.arms:
            sweep_rad, sweep_rad_s, adduction_rad, adduction_rad_s = arm.motors
            drives[joint].measure(sweep_rad, sweep_rad_s)
            drives[joint + 1].measure(adduction_rad, adduction_rad_s)
            joint += 2
