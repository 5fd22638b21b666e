"""ODrive with firmware 0.5.6 as a drive type: how its messages differ from those of 0.6."""

from collections.abc import Mapping
from contextlib import suppress

from drivers.can.frames import Frame, MalformedMessageError
from drivers.odrive.codec import LAST_COMMAND, AxisState, arbitration_id
from drivers.odrive.drive_type import FAST, SLOW, UNUSED_NODE, CanSimple
from drivers.odrive05 import codec
from drivers.odrive05.axis import Odrive05Axis
from drivers.odrive05.bench import Odrive05Bench
from drivers.odrive05.gate_table import gate_table
from drivers.odrive05.parameters import Odrive05Parameters


class Odrive05(CanSimple):
    """Describes the protocol of ODrive's firmware 0.5.6."""

    parameters = Odrive05Parameters
    axis = Odrive05Axis
    gate_table = staticmethod(gate_table)
    bench = Odrive05Bench()
    commands = codec.COMMANDS
    signals = {
        **CanSimple.signals,
        codec.GET_ENCODER_COUNT.command: ("position",),
        codec.GET_MOTOR_ERROR.command: ("error",),
        codec.GET_ENCODER_ERROR.command: ("error",),
        codec.GET_CONTROLLER_ERROR.command: ("error",),
    }
    example_error = codec.ERROR_MOTOR
    reports = (FAST, FAST, *5 * (SLOW,))  # encoder, current; heartbeat, errors of three parts, voltage

    def announces(self, node_id: int) -> Frame:
        """Return the counts of an encoder, which firmware 0.6 does not report."""
        return Frame(arbitration_id(node_id, codec.GET_ENCODER_COUNT), codec.GET_ENCODER_COUNT.encode(0, 0))

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Every frame to the drive feeds its watchdog, requests as well: only those to others are harmless."""
        return {"reports of another drive": self.announces(UNUSED_NODE)}

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        """Change heartbeats; the errors of motor, encoder and controller are details of them."""
        if frame.arbitration_id & LAST_COMMAND != codec.HEARTBEAT.command:
            return frame.data
        with suppress(MalformedMessageError):
            errors, state, *parts = codec.HEARTBEAT.decode(frame.data)
            return codec.HEARTBEAT.encode(errors | flags, AxisState.IDLE if idle else state, *parts)
        return frame.data
