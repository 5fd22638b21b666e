"""ODrive with firmware 0.6 as a drive type, and what firmware 0.5 has in common with it.

Firmware 0.6 and 0.5 are two types, because several of their messages have the same id and another meaning.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, ClassVar

from control.rate import RATE_HZ
from drivers.can.bus_load import FrameRate
from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import DriveParameters, Outlet, WatchdogEndpoints
from drivers.drive_type import DriveType, FrameContent
from drivers.odrive import codec
from drivers.odrive.axis import OdriveAxis
from drivers.odrive.bench import OdriveBench
from drivers.odrive.codec import AxisState, arbitration_id
from drivers.odrive.gate_table import gate_table
from drivers.odrive.parameters import OdriveParameters

FAST, SLOW = FrameRate(8, 500.0), FrameRate(8, 10.0)  # every 2 and every 100 ms, as docs/how-to/odrive.md sets them
GATE_DRIVER_FAULT = 0x20
UNUSED_NODE = 62  # the last one: ids are given from 0 on


class CanSimple(DriveType):
    """Describes what both firmwares have in common."""

    command = FrameRate(len(codec.SET_INPUT_TORQUE.encode(0.0)), RATE_HZ)
    commands: ClassVar[frozenset[int]]  # that a drive obeys
    signals: ClassVar[Mapping[int, tuple[str, ...]]] = {  # of what a drive sends, by the number of the message
        codec.GET_ENCODER_ESTIMATES.command: ("position",),
        codec.GET_IQ.command: ("current",),
        codec.HEARTBEAT.command: ("heartbeat", "error"),
        codec.GET_BUS_VOLTAGE_CURRENT.command: ("voltage",),
    }

    def identifiers(self, parameters: DriveParameters) -> frozenset[int]:
        first = parameters.node_id << 5
        return frozenset(range(first, first + 32))

    def read_frame(self, frame: Frame) -> FrameContent | None:
        if frame.is_extended or frame.is_error or frame.is_fd:
            return None
        node_id, command = frame.arbitration_id >> 5, frame.arbitration_id & codec.LAST_COMMAND
        return FrameContent(node_id, command in self.commands, self.signals.get(command, ()))


class Odrive(CanSimple):
    """Describes the protocol of ODrive's firmware 0.6."""

    parameters = OdriveParameters
    axis = OdriveAxis
    gate_table = staticmethod(gate_table)
    bench = OdriveBench()
    commands = codec.COMMANDS
    signals = {
        **CanSimple.signals,
        codec.GET_ERROR.command: ("error",),
        codec.GET_TEMPERATURE.command: ("temperature",),
    }
    example_error = GATE_DRIVER_FAULT
    reports = (FAST, FAST, *4 * (SLOW,))  # encoder, current; heartbeat, errors, temperature, voltage

    def make_axis(
        self, joint: str, parameters: Any, outlet: Outlet, endpoints: Sequence[WatchdogEndpoints]
    ) -> OdriveAxis:
        return OdriveAxis(joint, parameters, outlet, endpoints)

    def announces(self, node_id: int) -> Frame:
        return Frame(arbitration_id(node_id, codec.HEARTBEAT), codec.HEARTBEAT.encode(0, AxisState.IDLE, 0, 0))

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Firmware 0.5 counts every frame to a drive as its controller's; 0.6 should not."""
        return {
            "requests of the position": Frame(arbitration_id(node_id, codec.GET_ENCODER_ESTIMATES), is_remote=True),
            "requests of the version": Frame(arbitration_id(node_id, codec.GET_VERSION), is_remote=True),
            "heartbeats of another drive": self.announces(UNUSED_NODE),
        }

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        with suppress(MalformedMessageError):
            if frame.arbitration_id & codec.LAST_COMMAND == codec.GET_ERROR.command:
                errors, reason = codec.GET_ERROR.decode(frame.data)
                return codec.GET_ERROR.encode(errors | flags, reason | flags)
            errors, state, result, done = codec.HEARTBEAT.decode(frame.data)
            return codec.HEARTBEAT.encode(errors | flags, AxisState.IDLE if idle else state, result, done)
        return frame.data
