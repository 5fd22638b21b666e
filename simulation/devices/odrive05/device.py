"""Simulates an ODrive with firmware 0.5.6: what differs from 0.6, byte for byte.

It reports a position and velocity of zero until it has been in closed loop once, and counts of its encoder when asked.
Any frame to it feeds its watchdog, which runs in an idle drive too. An idle drive repeats the current that was measured
last, and the set-point of the newest command. Currents have the sign of the motor's phases. It answers neither a
request for its version nor one for a parameter, and no frame to all drives. The two axes of one board are cleared and
restarted together. Sources: can_simple.cpp, axis.cpp, controller.cpp, motor.cpp, foc.cpp and main.cpp of
odriverobotics/ODrive, tag fw-v0.5.6.
"""

from collections.abc import Callable, Mapping, Sequence
from random import Random

from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message
from drivers.odrive05 import codec as codec05
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters
from simulation.devices.odrive.device import COMMON_FORGERIES, Forgeries, SimulatedOdrive
from simulation.devices.simulated_drive import SimulatedDrive

OVERSPEED = 0x1  # of the controller
MOTOR_ERRORS = {  # what the motor reports with the axis error ERROR_MOTOR
    DriveError.OVERCURRENT: 0x400000,  # current of the bus out of range
    DriveError.OVERVOLTAGE: 0x1000000,  # of the system: the voltage is an error of the board, which CAN does not report
    DriveError.UNDERVOLTAGE: 0x1000000,
    DriveError.BRAKE_RESISTOR: 0x800000,
}


class SimulatedOdrive05(SimulatedOdrive):
    error_flags: Mapping[DriveError, int] = dict.fromkeys(MOTOR_ERRORS, codec05.ERROR_MOTOR) | {
        DriveError.WATCHDOG: codec05.ERROR_WATCHDOG,
        DriveError.OVERSPEED: codec05.ERROR_CONTROLLER,
    }
    trip_voltages_v = (8.0, 59.92)  # as delivered, of a board for 56 V
    broadcast_node = -1
    estop_flag = codec05.ERROR_ESTOP
    heartbeat = codec05.HEARTBEAT
    slow_messages: tuple[Message, ...] = (
        codec05.GET_MOTOR_ERROR,
        codec05.GET_ENCODER_ERROR,
        codec05.GET_CONTROLLER_ERROR,
        codec.GET_BUS_VOLTAGE_CURRENT,
    )
    forgeries: Forgeries = {  # firmware 0.5 reports no settings and no serial number
        **COMMON_FORGERIES,
        Forgery.OLD_FIRMWARE: (codec.GET_VERSION, (2, 4, 4, 58, 0, 6, 11, 0), b""),
        Forgery.STARTING: (codec05.HEARTBEAT, (0, AxisState.UNDEFINED, 0, 0, 0), b""),
    }

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        self.board: tuple[SimulatedOdrive05, ...] = (self,)  # the axes of its board
        super().__init__(parameters, random)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self._motor_errors = 0
        self._connected = False  # the estimates to the messages
        self._last_a = 0.0  # the newest current that was measured

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        if frame.arbitration_id >> 5 == self.parameters.node_id and not frame.is_extended:
            self._fed_s = max(self._fed_s, now_s)  # a drive that starts is fed at its end
        return super().receive(frame, now_s)

    def _execute(self, command: int, data: bytes, now_s: float) -> None:
        """Execute a command; those of any payload for all axes of the board."""
        if command == codec.REBOOT.command:
            for axis in self.board:
                axis.restart(now_s)
        elif command == codec.CLEAR_ERRORS.command:
            for axis in self.board:
                axis.errors = axis._motor_errors = 0
        else:
            super()._execute(command, data, now_s)

    def trip(self, error: DriveError) -> None:
        super().trip(error)
        self._motor_errors |= MOTOR_ERRORS.get(error, 0)

    def _read_parameter(self, data: bytes) -> list[Frame]:
        """Answer nothing: a data frame with this id means nothing here."""
        return []

    def _trip_if_due(self, now_s: float) -> None:
        self._connected = self._connected or self.energised
        expired = 0.0 < self.parameters.watchdog_s < now_s - self._fed_s
        if expired and not self.errors & codec05.ERROR_WATCHDOG:
            self.trip(DriveError.WATCHDOG)
        super()._trip_if_due(now_s)

    def forge_current(self, current_a: float) -> Frame:
        direction = self.parameters.encoder_direction
        return self._named(codec.GET_IQ, direction * self._setpoint_a, direction * current_a)

    def _encoder(self) -> bytes:
        return super()._encoder() if self._connected else codec.GET_ENCODER_ESTIMATES.encode(0.0, 0.0)

    def _counts(self) -> bytes:
        counts = self.parameters.encoder_counts
        count = round(self._measured_angle() * counts)
        return codec05.GET_ENCODER_COUNT.encode(count, count % counts)

    def _iq(self) -> bytes:
        parameters = self.parameters
        setpoint_a = self._setpoint_nm / parameters.torque_constant_nm_a
        if self.energised:
            setpoint_a, self._last_a = self._setpoint_a, self._measured_a()
        direction = parameters.encoder_direction
        return codec.GET_IQ.encode(direction * setpoint_a, direction * self._last_a)

    def _heartbeat(self) -> bytes:
        parts = (codec05.ERROR_MOTOR, codec05.ERROR_ENCODER, codec05.ERROR_CONTROLLER)
        motor, encoder, controller = (bool(self.errors & flag) for flag in parts)
        return codec05.HEARTBEAT.encode(self.errors, self.axis_state, motor, encoder, controller)

    def _motor_error(self) -> bytes:
        return codec05.GET_MOTOR_ERROR.encode(self._motor_errors)

    def _controller_error(self) -> bytes:
        return codec05.GET_CONTROLLER_ERROR.encode(OVERSPEED if self.errors & codec05.ERROR_CONTROLLER else 0)

    def _payload_functions(self) -> dict[Message, Callable[[], bytes]]:
        return {
            codec.GET_ENCODER_ESTIMATES: self._encoder,
            codec.GET_IQ: self._iq,
            codec.GET_BUS_VOLTAGE_CURRENT: self._bus_voltage,
            codec05.HEARTBEAT: self._heartbeat,
            codec05.GET_ENCODER_COUNT: self._counts,
            codec05.GET_MOTOR_ERROR: self._motor_error,
            codec05.GET_ENCODER_ERROR: lambda: codec05.GET_ENCODER_ERROR.encode(0),
            codec05.GET_CONTROLLER_ERROR: self._controller_error,
        }


def join_boards(drives: Sequence[SimulatedDrive]) -> None:
    """Make each two ODrives with firmware 0.5, in the order of a bus, the two axes of one board."""
    axes = [drive for drive in drives if isinstance(drive, SimulatedOdrive05)]
    for first, second in zip(axes[::2], axes[1::2], strict=False):
        first.board = second.board = (first, second)
