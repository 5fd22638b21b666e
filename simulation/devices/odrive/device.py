"""Simulates a motor drive on the bus: ODrive CANSimple 0.6, byte for byte. The folder odrive05 has what differs in 0.5.

It has the axis state machine (idle, closed loop), the error word with the disarm reason, the watchdog, torque mode with
the velocity-limit clamp, the current limits, the trips of the supply and, where it is on, of overspeed, cyclic
messages, and requests by remote frame or by an empty data frame, to its own id or to all. A command may have more bytes
than it needs, as the makers' DBC has. It can forge frames of its own, and from a firmware other than its type says
(OLD_FIRMWARE).
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from math import isfinite
from random import Random

from drivers.can.frames import Frame, MalformedMessageError
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from drivers.odrive.setup import SAVE
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters
from simulation.devices.odrive.settings import ENABLE_WATCHDOG_ENDPOINT, OdriveSettings
from simulation.devices.simulated_drive import SimulatedDrive

REPEATED = (codec.GET_ENCODER_ESTIMATES, codec.GET_IQ)
VERSION_FIELDS = (2, 0, 0, 0, 0, 6, 11, 0)  # protocol 2, no real board, firmware 0.6.11
TORQUE_MODES = (codec.TORQUE_CONTROL, codec.PASSTHROUGH)

Forgeries = Mapping[Forgery, tuple[Message, tuple[int, ...], bytes]]  # message, values, and bytes after them
COMMON_FORGERIES: Forgeries = {
    Forgery.EMERGENCY_STOP: (codec.ESTOP, (), b""),
    Forgery.CLOSE_LOOP: (codec.SET_AXIS_STATE, (AxisState.CLOSED_LOOP,), b""),
}


def finite(values: tuple[float, ...]) -> tuple[float, ...]:
    """Raise MalformedMessageError for NaN and infinity."""
    if not all(map(isfinite, values)):
        raise MalformedMessageError("not a finite number")
    return values


class SimulatedOdrive(SimulatedDrive):
    """Owns one drive's state. The class attributes are the codes and messages that differ between firmwares."""

    boot_s = 1.0
    error_flags: Mapping[DriveError, int] = {
        DriveError.OVERCURRENT: 0x400,
        DriveError.WATCHDOG: codec.ERROR_WATCHDOG,
        DriveError.OVERSPEED: 0x8000,
        DriveError.OVERVOLTAGE: 0x100,
        DriveError.UNDERVOLTAGE: 0x200,
        DriveError.BRAKE_RESISTOR: 0x8000000,
    }
    trip_voltages_v = (10.5, 60.0)  # dc_bus_undervoltage_trip_level and dc_bus_overvoltage_trip_level, as delivered
    broadcast_node = codec.BROADCAST_NODE
    estop_flag = codec.ERROR_ESTOP
    heartbeat = codec.HEARTBEAT
    slow_messages: tuple[Message, ...] = (codec.GET_ERROR, codec.GET_TEMPERATURE, codec.GET_BUS_VOLTAGE_CURRENT)
    forgeries: Forgeries = {
        **COMMON_FORGERIES,
        Forgery.OLD_FIRMWARE: (codec.GET_VERSION, (2, 4, 4, 58, 0, 5, 6, 0), b""),
        Forgery.STARTING: (codec.HEARTBEAT, (codec.ERROR_INITIALIZING, AxisState.IDLE, 0, 0), b""),
        Forgery.WATCHDOG_OFF: (codec.TX_SDO, (0, ENABLE_WATCHDOG_ENDPOINT, 0), b"\0"),
        Forgery.OTHER_DRIVE: (codec.ADDRESS, (0, 0xABCDEF, 0), b""),
    }

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        self._settings = OdriveSettings()
        self._payloads = self._payload_functions()
        super().__init__(parameters, random)
        self._number_messages()

    def _number_messages(self) -> None:
        self._ids = {message: arbitration_id(self.parameters.node_id, message) for message in self._payloads}

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self.axis_state = AxisState.IDLE
        self.errors = self.disarm_reason = 0
        self._initializing = False
        self._setpoint_nm = self._setpoint_a = 0.0  # the command, and what the current follows after the limits
        self._modes = (0, 0)
        self._set_limits(2.0, 10.0)  # ODrive's defaults
        self._velocity_gain_nm_s_turn = self.parameters.velocity_gain_nm_s_turn
        periods = self.parameters
        self._schedule: list[tuple[float, tuple[Message, ...]]] = [
            (periods.encoder_period_s, (codec.GET_ENCODER_ESTIMATES,)),
            (periods.current_period_s, (codec.GET_IQ,)),
            (periods.heartbeat_period_s, (self.heartbeat,)),
            (periods.slow_period_s, self.slow_messages),
        ]
        # Boards are switched on at different times, so their messages do not all come in the same tick.
        self._due_s = [now_s + period_s * self._random.random() for period_s, _ in self._schedule]
        self._next_due_s = min(self._due_s)

    def restart(self, now_s: float) -> None:
        """Restart and report the initialisation."""
        self.parameters = self._settings.restart(self.parameters)
        self._number_messages()
        super().restart(now_s)
        self._initializing = True

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        node_id, command = frame.arbitration_id >> 5, frame.arbitration_id & 0x1F
        if frame.is_extended or node_id not in (self.parameters.node_id, self.broadcast_node):
            return []
        if now_s < self._boots_until_s:
            return []
        if self.parameters.any_frame_feeds:
            self._fed_s = now_s
        if frame.is_remote or not frame.data:
            asked = [message for message in self._payloads if message.command == command]
            if asked or frame.is_remote:
                return [Frame(self._ids[message], self._payloads[message]()) for message in asked]
        if command == codec.RX_SDO.command:
            return self._read_parameter(frame.data)
        with suppress(MalformedMessageError):  # a drive ignores malformed messages
            self._execute(command, frame.data, now_s)
        return []

    def _execute(self, command: int, data: bytes, now_s: float) -> None:
        if command == codec.SET_INPUT_TORQUE.command:
            (self._setpoint_nm,) = finite(codec.SET_INPUT_TORQUE.decode_padded(data))
            self._fed_s = now_s
        elif command == codec.SET_AXIS_STATE.command:
            self._change_state(codec.SET_AXIS_STATE.decode_padded(data)[0], now_s)
        elif command == codec.SET_CONTROLLER_MODE.command:
            self._modes = codec.SET_CONTROLLER_MODE.decode_padded(data)
        elif command == codec.SET_LIMITS.command:
            self._set_limits(*finite(codec.SET_LIMITS.decode_padded(data)))
        elif command == codec.SET_VEL_GAINS.command:
            (self._velocity_gain_nm_s_turn,) = finite(codec.SET_VEL_GAINS.decode_padded(data)[:1])
        elif command == codec.CLEAR_ERRORS.command:
            self.errors = self.disarm_reason = 0
        elif command == codec.ESTOP.command:
            self._disarm(self.estop_flag)
        elif command == codec.REBOOT.command:
            if codec.REBOOT.decode_padded(data)[0] == SAVE:
                self._settings.save()
            self.restart(now_s)

    def _read_parameter(self, data: bytes) -> list[Frame]:
        """Execute a message that reads or writes a setting."""
        answer, self.parameters = self._settings.execute(data, self.parameters)
        self._number_messages()
        return [Frame(arbitration_id(self.parameters.node_id, codec.TX_SDO), answer)] if answer else []

    def _set_limits(self, velocity_turn_s: float, current_a: float) -> None:
        self._velocity_limit_turn_s = velocity_turn_s
        largest_a = min(current_a, self.parameters.motor_current_limit_a)
        self._largest_nm = largest_a * self.parameters.torque_constant_nm_a

    def _change_state(self, state: int, now_s: float) -> None:
        if state == AxisState.CLOSED_LOOP and not self.errors:
            self.axis_state = AxisState.CLOSED_LOOP
            self.disarm_reason = 0
            self._fed_s = now_s
        elif state == AxisState.IDLE:
            self.axis_state = AxisState.IDLE

    def _disarm(self, reason: int) -> None:
        self.axis_state = AxisState.IDLE
        self.errors |= reason
        self.disarm_reason = reason

    @property
    def energised(self) -> bool:
        return self.axis_state is AxisState.CLOSED_LOOP

    @energised.setter
    def energised(self, energised: bool) -> None:
        self.axis_state = AxisState.CLOSED_LOOP if energised else AxisState.IDLE

    @property
    def failed(self) -> bool:
        return self.errors != 0

    def trip(self, error: DriveError) -> None:
        self._disarm(self.error_flags[error])

    def _named(self, message: Message, *values: float) -> Frame:
        return Frame(arbitration_id(self.parameters.node_id, message), message.encode(*values))

    def forge(self, forgery: Forgery) -> Frame:
        message, values, value = self.forgeries[forgery]
        frame = self._named(message, *values)
        return frame._replace(data=frame.data + value)

    def forge_current(self, current_a: float) -> Frame:
        return self._named(codec.GET_IQ, self._setpoint_a, current_a)

    def forge_torque(self, torque_nm: float) -> Frame:
        return self._named(codec.SET_INPUT_TORQUE, self.parameters.sign * torque_nm)

    def _trip_if_due(self, now_s: float) -> None:
        lowest_v, highest_v = self.trip_voltages_v
        if not lowest_v <= self.parameters.bus_voltage_v <= highest_v:
            low = self.parameters.bus_voltage_v < lowest_v
            self.trip(DriveError.UNDERVOLTAGE if low else DriveError.OVERVOLTAGE)
        if self.axis_state is AxisState.CLOSED_LOOP:
            fastest_turn_s = self.parameters.overspeed_fraction * self._velocity_limit_turn_s
            if 0.0 < self.parameters.watchdog_s < now_s - self._fed_s:
                self.trip(DriveError.WATCHDOG)
            elif 0.0 < fastest_turn_s < abs(self._speed):
                self.trip(DriveError.OVERSPEED)

    def _motor_nm(self, now_s: float) -> float:
        self._trip_if_due(now_s)
        if self.axis_state is not AxisState.CLOSED_LOOP or self._modes != TORQUE_MODES:
            self._current_a = self._setpoint_a = 0.0
            return 0.0
        parameters, largest_nm = self.parameters, self._largest_nm
        gain, limit, turns_s = self._velocity_gain_nm_s_turn, self._velocity_limit_turn_s, self._speed
        torque_nm, lowest_nm, highest_nm = self._setpoint_nm, (-limit - turns_s) * gain, (limit - turns_s) * gain
        torque_nm = lowest_nm if lowest_nm > torque_nm else torque_nm  # min and max cost ten times as much
        torque_nm = highest_nm if highest_nm < torque_nm else torque_nm
        torque_nm = -largest_nm if -largest_nm > torque_nm else torque_nm
        torque_nm = largest_nm if largest_nm < torque_nm else torque_nm
        self._setpoint_a = torque_nm / parameters.torque_constant_nm_a
        if parameters.current_lag_s:
            torque_nm = self._lagged_nm(torque_nm, self._current_a * parameters.torque_constant_nm_a, now_s)
        self._current_a = torque_nm / parameters.torque_constant_nm_a
        return torque_nm

    def _due_frames(self, now_s: float) -> Iterator[Frame]:
        due_s = self._due_s
        for index, message_due_s in enumerate(due_s):
            if now_s < message_due_s:
                continue
            period_s, messages = self._schedule[index]
            due_s[index] = message_due_s + period_s
            if due_s[index] <= now_s:  # delayed by more than a period: lost messages are not sent later
                due_s[index] = now_s + period_s
            for message in messages:
                encode = self._payloads[message]
                payload = self._new_or_repeated(message, encode) if message in REPEATED else encode()
                yield Frame(self._ids[message], payload, stamp_s=now_s)
        self._next_due_s = min(due_s)

    def _encoder(self) -> bytes:
        return codec.GET_ENCODER_ESTIMATES.encode(self._measured_angle(), self._measured_speed())

    def _iq(self) -> bytes:
        return codec.GET_IQ.encode(self._setpoint_a, self._measured_a())

    def _heartbeat(self) -> bytes:
        errors = self.errors | codec.ERROR_INITIALIZING if self._initializing else self.errors
        self._initializing = False
        return codec.HEARTBEAT.encode(errors, self.axis_state, 0, 0)

    def _error(self) -> bytes:
        return codec.GET_ERROR.encode(self.errors, self.disarm_reason)

    def _bus_voltage(self) -> bytes:
        return codec.GET_BUS_VOLTAGE_CURRENT.encode(self.parameters.bus_voltage_v, self.supply_a)

    def _temperature(self) -> bytes:
        return codec.GET_TEMPERATURE.encode(self.parameters.temperature_c, self.parameters.temperature_c)

    def _address(self) -> bytes:
        return codec.encode_address(self.parameters.node_id, int(self.parameters.serial_number or "0", 16))

    def _payload_functions(self) -> dict[Message, Callable[[], bytes]]:
        """Return the encoder of each message that this firmware sends: methods, which a copy of the drive rebinds."""
        return {
            codec.GET_ENCODER_ESTIMATES: self._encoder,
            codec.GET_IQ: self._iq,
            codec.HEARTBEAT: self._heartbeat,
            codec.GET_ERROR: self._error,
            codec.GET_TEMPERATURE: self._temperature,
            codec.GET_BUS_VOLTAGE_CURRENT: self._bus_voltage,
            codec.GET_VERSION: lambda: codec.GET_VERSION.encode(*VERSION_FIELDS),
            codec.ADDRESS: self._address,
        }
