"""The transmit gate between a port and a mock bus, for the frames of a protocol byte by byte."""

from __future__ import annotations

from collections.abc import Iterable
from struct import pack, unpack

from control.parameters.joint_limits import JointLimits
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.transmit_gate import GateTable, TransmitGate

LIMITS = JointLimits(torque_nm=0.75, torque_rate_nm_s=100.0)
STEP_S = 0.002  # so that a step is 0.2 N·m


class GateBench:
    """`port` passes the gate, `far` receives what leaves it. The gate is closed."""

    def __init__(self, tables: Iterable[GateTable], limits: JointLimits = LIMITS) -> None:
        bus = MockBus()
        self.far = bus.open()
        self.gate = TransmitGate(limits)
        self.port = self.gate.outlet(bus.open(), tables)
        self.gate.allow_step(STEP_S)

    def passed(self, frame: Frame) -> list[Frame]:
        """Send a frame and return what leaves."""
        self.port.send(frame)
        return self.far.receive()


class OdriveGateBench(GateBench):
    def send(self, frame: Frame) -> list[Frame]:
        return self.passed(frame)

    def torque(self, torque_nm: float, identifier: int) -> float:
        """Send a torque and return the torque that leaves."""
        (frame,) = self.send(Frame(identifier, pack("<f", torque_nm)))
        assert frame.arbitration_id == identifier
        sent_nm: float = unpack("<f", frame.data)[0]
        return sent_nm
