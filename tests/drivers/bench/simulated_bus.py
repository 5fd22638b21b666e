"""Simulated drives on a bus of this process, in simulated time, for the commands of the bench."""

from collections.abc import Callable
from random import Random
from typing import Any

from drivers.bench.bench_port import BenchPort
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from simulation.devices.drive import SimulatedDriveParameters
from simulation.devices.drive_types import make_simulated_drive
from simulation.devices.simulated_drive import SimulatedDrive

STEP_S = 0.001


def simulated(type_name: str, node_id: int, serial: str = "", **changes: Any) -> SimulatedDrive:
    parameters = SimulatedDriveParameters(node_id, type=type_name, serial_number=serial, **changes)
    return make_simulated_drive(parameters, Random(node_id))


class SimulatedBus:
    """Owns simulated time, which passes only while the bench sleeps; `sent` has the frames of the bench."""

    def __init__(self, *drives: SimulatedDrive) -> None:
        self.drives = list(drives)
        bus = MockBus()
        self._far, self.port = bus.open(), bus.open()
        self.port.close = lambda: None  # type: ignore[method-assign]  # one command follows the other
        self.now_s = 0.0
        self.sent: list[Frame] = []
        self.energised = False  # whether a drive was energised at any time
        self.unplugged_after = 10**9  # frames of the bench, after which nothing passes the cable
        self.at_frame: tuple[int, Callable[[], None]] = (10**9, lambda: None)  # number of a frame, and a call after it
        self.each_step: Callable[[], None] = lambda: None

    def bench_port(self, _: object = None) -> BenchPort:
        return BenchPort(self.port, lambda: self.now_s, self.sleep)

    def sleep(self, duration_s: float) -> None:
        for _ in range(max(1, round(duration_s / STEP_S))):
            self.now_s += STEP_S
            self._step()

    def _step(self) -> None:
        self.each_step()
        for frame in self._far.receive():
            self.sent.append(frame)
            if len(self.sent) <= self.unplugged_after:
                for drive in self.drives:
                    self._answer(drive.receive(frame, self.now_s))
            if len(self.sent) == self.at_frame[0]:
                self.at_frame[1]()
        for drive in self.drives:
            drive.torque_nm(self.now_s)
            self.energised = self.energised or drive.energised
            self._answer(list(drive.cyclic_frames(self.now_s)))

    def _answer(self, frames: list[Frame]) -> None:
        for frame in frames:
            if len(self.sent) <= self.unplugged_after:
                self._far.send(frame)
