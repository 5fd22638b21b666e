"""Simulated drives of one type on one bus with the axes that command them, in simulated time."""

from collections.abc import Mapping
from random import Random
from typing import Any

from control.parameters.joint_limits import JointLimits
from control.records import JOINTS, DriveState
from drivers.can.mock_bus import MockBus
from drivers.drive_axis import DriveAxis
from drivers.drive_types import DRIVE_TYPES, make_drives
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.drive_types import make_simulated_drive

TICK_S = 0.0026
TYPES = (*DRIVE_TYPES, "mit:AK80-9", "mit:RS05")
CONSTANT_NM_A = 0.083


class DrivenDrives:
    """Owns the time, four drives and their axes. `settings` are the axes', `changes` the simulated drives' own."""

    def __init__(self, name: str, changes: Mapping[str, Any] | None = None, **settings: Any) -> None:
        kind, _, model = name.partition(":")
        if model:
            settings["model"] = model
        self.bus = MockBus()
        self.far = self.bus.open()
        record = DRIVE_TYPES[kind].parameters
        parameters = {
            joint: record(bus="a", node_id=number, type=kind, torque_constant_nm_a=CONSTANT_NM_A, **settings)
            for number, joint in enumerate(JOINTS, 1)
        }
        self.drives = make_drives(parameters, {"a": self.bus.open()}, JointLimits(torque_rate_nm_s=10000.0))
        common: dict[str, Any] = {"current_noise_a": 0.0} | settings | dict(changes or {})
        self.devices = [
            make_simulated_drive(SimulatedDriveParameters(node_id=number, type=kind, **common), Random(1))
            for number in range(1, 5)
        ]
        self.now_s = 10.0
        for device in self.devices:
            device.reset(self.now_s)

    @property
    def axis(self) -> DriveAxis:
        return self.drives.axes[0]

    @property
    def state(self) -> DriveState:
        return self.drives.axes[0].state

    def tick(self, torque_nm: float | None = None, count: int = 1) -> None:
        """Run ticks that command this torque; none: of a robot that is idle."""
        for _ in range(count):
            self.now_s += TICK_S
            self.drives.read(self.now_s)
            if torque_nm is None:
                self.drives.request_settings(self.now_s)
            self.drives.send((torque_nm or 0.0,) * 4, 0.1)  # type: ignore[arg-type]
            self.drives.request_supply()
            self.exchange()
        self.drives.read(self.now_s + TICK_S / 2.0)

    def exchange(self) -> None:
        for frame in self.far.receive():
            for device in self.devices:
                for answer in device.receive(frame, self.now_s):
                    self.far.send(answer)
        for device in self.devices:
            device.torque_nm(self.now_s)
            for report in device.cyclic_frames(self.now_s):
                self.far.send(report)

    def torque_nm(self) -> float:
        """Return the torque that the first motor exerts now."""
        return self.devices[0].torque_nm(self.now_s)

    def wait(self, seconds: float) -> None:
        """Let time pass without a command."""
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            self.exchange()

    def arm(self) -> None:
        self.tick(count=30)
        self.drives.arm(self.now_s, at_once=True)
        self.drives.arm(self.now_s + 1.0)
        self.exchange()
        self.tick(0.0, count=60)

    def disarm(self) -> None:
        self.drives.disarm(self.now_s, at_once=True)
        self.exchange()
