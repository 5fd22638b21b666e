"""ODrive as a drive type: its parameters, its drives, and how to read and forge its frames without commanding one.

Firmware 0.6 and 0.5 are two types, because several of their messages have the same id and another meaning.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import ClassVar, cast

from control.rate import RATE_HZ
from drivers.can.bus_load import FrameRate
from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import DriveParameters, FrameContent, Outlet, WatchdogEndpoints
from drivers.odrive import codec, codec05
from drivers.odrive.axis import OdriveAxis
from drivers.odrive.axis05 import Odrive05Axis
from drivers.odrive.codec import AxisState, arbitration_id
from drivers.odrive.gate_tables import gate_table, gate_table_05
from drivers.odrive.parameters import Odrive05Parameters, OdriveParameters
from drivers.transmit_gate import FrameKind, GateTable

COMMON_SIGNALS: Mapping[int, tuple[str, ...]] = {  # by the number of the message
    codec.GET_ENCODER_ESTIMATES.command: ("position",),
    codec.GET_IQ.command: ("current",),
    codec.HEARTBEAT.command: ("heartbeat", "error"),
    codec.GET_BUS_VOLTAGE_CURRENT.command: ("voltage",),
}
SIGNALS = {**COMMON_SIGNALS, codec.GET_ERROR.command: ("error",), codec.GET_TEMPERATURE.command: ("temperature",)}
SIGNALS_05 = {
    **COMMON_SIGNALS,
    codec05.GET_ENCODER_COUNT.command: ("position",),
    codec05.GET_MOTOR_ERROR.command: ("error",),
    codec05.GET_ENCODER_ERROR.command: ("error",),
    codec05.GET_CONTROLLER_ERROR.command: ("error",),
}
REPORT_BYTES = 8  # of every cyclic message
FAST_HZ, SLOW_HZ = 500.0, 10.0  # cyclic messages every 2 and every 100 ms, as docs/how-to/odrive.md sets them
GATE_DRIVER_FAULT = 0x20
UNUSED_NODE = 62  # the last one: ids are given from 0 on


class CanSimple:
    """Describes what both firmwares have in common."""

    kind = FrameKind()
    command = FrameRate(len(codec.SET_INPUT_TORQUE.encode(0.0)), RATE_HZ)
    commands: ClassVar[frozenset[int]]  # that a drive obeys
    signals: ClassVar[Mapping[int, tuple[str, ...]]]  # of what a drive sends, by command

    def identifiers(self, parameters: DriveParameters) -> frozenset[int]:
        first = parameters.node_id << 5
        return frozenset(range(first, first + 32))

    def query(self, node_id: int) -> None:
        """An ODrive reports by itself."""

    def read_frame(self, frame: Frame) -> FrameContent | None:
        if frame.is_extended or frame.is_error or frame.is_fd:
            return None
        node_id, command = frame.arbitration_id >> 5, frame.arbitration_id & codec.LAST_COMMAND
        return FrameContent(node_id, command in self.commands, self.signals.get(command, ()))


class Odrive(CanSimple):
    """Describes the protocol of ODrive's firmware 0.6, as DriveType requires."""

    parameters = OdriveParameters
    commands, signals = codec.COMMANDS, SIGNALS
    example_error = GATE_DRIVER_FAULT
    reports = (
        FrameRate(REPORT_BYTES, FAST_HZ),  # encoder
        FrameRate(REPORT_BYTES, FAST_HZ),  # current
        *(FrameRate(REPORT_BYTES, SLOW_HZ),) * 4,  # heartbeat, errors, temperature, voltage
    )

    def gate_table(self, parameters: DriveParameters) -> GateTable:
        return gate_table(cast(OdriveParameters, parameters))

    def make_axis(
        self, joint: str, parameters: DriveParameters, outlet: Outlet, endpoints: Sequence[WatchdogEndpoints]
    ) -> OdriveAxis:
        return OdriveAxis(joint, cast(OdriveParameters, parameters), outlet, endpoints)

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


class Odrive05(CanSimple):
    """Describes the protocol of ODrive's firmware 0.5.6, as DriveType requires."""

    parameters = Odrive05Parameters
    commands, signals = codec05.COMMANDS, SIGNALS_05
    example_error = codec05.ERROR_MOTOR
    reports = (
        FrameRate(REPORT_BYTES, FAST_HZ),  # encoder
        FrameRate(REPORT_BYTES, FAST_HZ),  # current
        *(FrameRate(REPORT_BYTES, SLOW_HZ),) * 5,  # heartbeat, errors of motor, encoder and controller, voltage
    )

    def gate_table(self, parameters: DriveParameters) -> GateTable:
        return gate_table_05(cast(Odrive05Parameters, parameters))

    def make_axis(
        self, joint: str, parameters: DriveParameters, outlet: Outlet, endpoints: Sequence[WatchdogEndpoints]
    ) -> Odrive05Axis:
        return Odrive05Axis(joint, cast(Odrive05Parameters, parameters), outlet)

    def announces(self, node_id: int) -> Frame:
        """Returns the counts of an encoder, which firmware 0.6 does not report."""
        return Frame(arbitration_id(node_id, codec05.GET_ENCODER_COUNT), codec05.GET_ENCODER_COUNT.encode(0, 0))

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Every frame to the drive feeds its watchdog, requests as well: only those to others are harmless."""
        return {"reports of another drive": self.announces(UNUSED_NODE)}

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        """Changes heartbeats; the errors of motor, encoder and controller are details of them."""
        if frame.arbitration_id & codec.LAST_COMMAND != codec05.HEARTBEAT.command:
            return frame.data
        with suppress(MalformedMessageError):
            errors, state, *parts = codec05.HEARTBEAT.decode(frame.data)
            return codec05.HEARTBEAT.encode(errors | flags, AxisState.IDLE if idle else state, *parts)
        return frame.data
