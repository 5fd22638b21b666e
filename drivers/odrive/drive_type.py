"""ODrive as a drive type: its parameters, its drives, and how to read and forge its frames without commanding one."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import cast

from control.rate import RATE_HZ
from drivers.can.bus_load import FrameRate
from drivers.can.frames import Frame
from drivers.drive import DriveParameters, FrameContent, Outlet, WatchdogEndpoints
from drivers.odrive import codec
from drivers.odrive.axis import OdriveAxis
from drivers.odrive.codec import AxisState, MalformedMessageError, arbitration_id
from drivers.odrive.gate_tables import gate_table
from drivers.odrive.parameters import OdriveParameters
from drivers.transmit_gate import FrameKind, GateTable

SIGNALS: Mapping[int, tuple[str, ...]] = {
    codec.GET_ENCODER_ESTIMATES.command: ("position",),
    codec.GET_IQ.command: ("current",),
    codec.HEARTBEAT.command: ("heartbeat", "error"),
    codec.GET_ERROR.command: ("error",),
    codec.GET_TEMPERATURE.command: ("temperature",),
    codec.GET_BUS_VOLTAGE_CURRENT.command: ("voltage",),
}
REPORT_BYTES = 8  # of every cyclic message
FAST_HZ, SLOW_HZ = 500.0, 10.0  # cyclic messages every 2 and every 100 ms, as docs/how-to/odrive.md sets them
GATE_DRIVER_FAULT = 0x20
UNUSED_NODE = 62  # the last one: ids are given from 0 on


class Odrive:
    """Describes the ODrive protocol, as DriveType requires."""

    parameters = OdriveParameters
    kind = FrameKind()
    example_error = GATE_DRIVER_FAULT
    command = FrameRate(len(codec.SET_INPUT_TORQUE.encode(0.0)), RATE_HZ)
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

    def query(self, node_id: int) -> None:
        """An ODrive reports by itself."""

    def announces(self, node_id: int) -> Frame:
        return Frame(arbitration_id(node_id, codec.HEARTBEAT), codec.HEARTBEAT.encode(0, AxisState.IDLE, 0, 0))

    def read_frame(self, frame: Frame) -> FrameContent | None:
        if frame.is_extended or frame.is_error or frame.is_fd:
            return None
        node_id, command = frame.arbitration_id >> 5, frame.arbitration_id & codec.LAST_COMMAND
        return FrameContent(node_id, command in codec.COMMANDS, SIGNALS.get(command, ()))

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Firmware 0.5 counts every frame to a drive as its controller's."""
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
