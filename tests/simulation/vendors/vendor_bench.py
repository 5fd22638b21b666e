"""A simulated drive on a bus of python-can in real time, for the makers' own programs, and our driver on the same bus.

A thread is the hardware: it answers frames and turns a flywheel on the motor.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import can

from control.parameters.joint_limits import JointLimits
from drivers.can.can_port import PythonCanPort, frame_from, message_from
from drivers.can.frames import MalformedMessageError
from drivers.drive import DriveParameters
from drivers.drive_axis import DriveAxis
from drivers.drive_types import DRIVE_TYPES
from drivers.transmit_gate import TransmitGate
from simulation.devices.simulated_drive import SimulatedDrive
from tests.drivers.bench.simulated_bus import simulated

STEP_S = 0.001
FLYWHEEL_KG_M2 = 0.2
PATIENCE_S = 5.0


class VendorBench:
    """Owns a drive and the thread that steps it; `open_bus` gives a program its end of the bus."""

    def __init__(self, channel: str, drive: SimulatedDrive, fd: bool) -> None:
        self.channel, self.drive, self._fd = channel, drive, fd
        self.angle_rad = self.velocity_rad_s = self.torque_nm = 0.0
        self._bus = self.open_bus()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def open_bus(self) -> can.BusABC:
        protocol = can.CanProtocol.CAN_FD if self._fd else can.CanProtocol.CAN_20
        return can.Bus(self.channel, "virtual", protocol=protocol, ignore_config=True)

    def _run(self) -> None:
        before_s = time.monotonic()
        while not self._ended.is_set():
            message = self._bus.recv(STEP_S)
            now_s = time.monotonic()
            self.drive.torque_nm(now_s)  # a watchdog that expired before the message, also where this thread is late
            answers = self.drive.receive(frame_from(message), now_s) if message else []
            self.torque_nm = self.drive.torque_nm(now_s)
            self.velocity_rad_s += self.torque_nm / FLYWHEEL_KG_M2 * (now_s - before_s)
            self.angle_rad += self.velocity_rad_s * (now_s - before_s)
            self.drive.measure(self.angle_rad, self.velocity_rad_s)
            for frame in (*answers, *self.drive.cyclic_frames(now_s)):
                self._bus.send(message_from(frame))
            before_s = now_s

    def start(self) -> None:
        self.drive.reset(time.monotonic())
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()
        self._bus.shutdown()

    @contextmanager
    def driver(self, parameters: DriveParameters) -> Iterator[DriveReader]:
        """Yield our own driver of one drive, on the same bus."""
        port = PythonCanPort(self.open_bus())
        try:
            yield DriveReader(port, parameters)
        finally:
            port.close()


class DriveReader:
    """Our driver as an idle daemon runs it: it reads, asks for settings and never opens the gate."""

    def __init__(self, port: PythonCanPort, parameters: DriveParameters) -> None:
        kind = DRIVE_TYPES[parameters.type]
        outlet = TransmitGate(JointLimits()).outlet(port, [kind.gate_table(parameters)])
        self.axis: DriveAxis = kind.make_axis("left_sweep", parameters, outlet, [])
        self._port = port

    def read_until(self, condition: Callable[[DriveAxis], bool]) -> DriveAxis:
        """Return the axis once the condition is met; fail after PATIENCE_S."""
        receivers, begun_s = self.axis.receivers, time.monotonic()
        while not condition(self.axis):
            assert time.monotonic() - begun_s < PATIENCE_S, self.axis.health
            self.axis.begin_read(time.monotonic())
            for frame in self._port.receive():
                receive = receivers.get(frame.arbitration_id | frame.is_fd << 29)
                if receive is not None and not frame.is_remote:
                    with suppress(MalformedMessageError):  # a daemon counts them
                        receive(frame.data, frame.stamp_s)
            self.axis.poll()
            self.axis.request_settings(time.monotonic())
            time.sleep(0.003)
        return self.axis


@contextmanager
def vendor_bench(type_name: str, fd: bool = False, **changes: Any) -> Iterator[VendorBench]:
    """Yield a bench with a drive of id 1 on a bus of its own."""
    drive = simulated(type_name, 1, **{"current_noise_a": 0.0} | changes)
    bench = VendorBench(f"{type_name} {time.monotonic_ns()}", drive, fd)
    bench.start()
    try:
        yield bench
    finally:
        bench.end()


def wait_until(condition: Callable[[], bool], what: str) -> None:
    begun_s = time.monotonic()
    while not condition():
        assert time.monotonic() - begun_s < PATIENCE_S, what
        time.sleep(0.005)
