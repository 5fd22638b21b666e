"""Simulates a motor drive on the bus: ODrive CANSimple 0.6, byte for byte. The folder odrive05 has what differs in 0.5.

It has the axis state machine (idle, closed loop), the error word with the disarm reason, the watchdog, torque mode with
the velocity-limit clamp, the current limits and, where it is on, the overspeed trip, cyclic messages, and requests by
remote frame.

Between the drive and the joint lie imperfections that no drive reports, each off at 0. The motor's true torque constant
differs from the drive's value, and an error of its commutation weakens or inverts the torque; current follows its
command with a first-order lag; magnets pull towards detents at any current. The encoder has steps, noise and an offset,
and may freeze; the current has noise. Messages arrive in order, late by uniformly drawn times, and some repeat their
old values.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from math import exp, isfinite, pi
from random import Random
from typing import NamedTuple

from control.records import NEVER_S
from drivers.can.frames import Frame, MalformedMessageError
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from drivers.odrive.setup import SAVE
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters
from simulation.devices.late_messages import LateMessages
from simulation.devices.motor import encoder_turns, joint_torque_nm
from simulation.devices.odrive import forgeries
from simulation.devices.odrive.settings import OdriveSettings

TURN_RAD = 2.0 * pi
REPEATED = (codec.GET_ENCODER_ESTIMATES, codec.GET_IQ)
VERSION_FIELDS = (2, 0, 0, 0, 0, 6, 11, 0)  # protocol 2, no real board, firmware 0.6.11
TORQUE_MODES = (codec.TORQUE_CONTROL, codec.PASSTHROUGH)
BOOT_S = 1.0  # silence of a drive that restarts


class Firmware(NamedTuple):
    """The codes and messages that differ between firmwares."""

    error_flags: Mapping[DriveError, int]
    estop_flag: int
    heartbeat: Message
    slow_messages: tuple[Message, ...]


FIRMWARE_06 = Firmware(
    error_flags={
        DriveError.OVERCURRENT: 0x400,
        DriveError.WATCHDOG: codec.ERROR_WATCHDOG,
        DriveError.OVERSPEED: 0x8000,
    },
    estop_flag=codec.ERROR_ESTOP,
    heartbeat=codec.HEARTBEAT,
    slow_messages=(codec.GET_ERROR, codec.GET_TEMPERATURE, codec.GET_BUS_VOLTAGE_CURRENT),
)


def finite(values: tuple[float, ...]) -> tuple[float, ...]:
    """Raises MalformedMessageError for NaN and infinity."""
    if not all(map(isfinite, values)):
        raise MalformedMessageError("not a finite number")
    return values


class SimulatedOdrive:
    """Owns one drive's state. Callers use the joint's angles and torques; turns and signs stay inside."""

    def __init__(self, parameters: SimulatedDriveParameters, random: Random, firmware: Firmware = FIRMWARE_06) -> None:
        self.parameters = parameters
        self._firmware = firmware
        self._random = random
        self._late = LateMessages(random)
        self._settings = OdriveSettings()
        self._payloads = self._payload_functions()
        self._ids = {message: arbitration_id(parameters.node_id, message) for message in self._payloads}
        self.reset(0.0)

    def reset(self, now_s: float) -> None:
        """Restores the state after power-on."""
        self.axis_state = AxisState.IDLE
        self.errors = self.disarm_reason = 0
        self._setpoint_nm = 0.0  # at the motor
        self._modes = (0, 0)
        self._set_limits(2.0, 10.0)  # ODrive's defaults
        self._velocity_gain_nm_s_turn = self.parameters.velocity_gain_nm_s_turn
        self._fed_s = now_s
        self._current_a = self._setpoint_a = 0.0  # the motor's, and the one that it follows
        self._stepped_s = now_s
        self._turns = self._turns_s = self._reported_turns = 0.0
        self._boots_until_s, self._initializing = NEVER_S, False
        self._reported: dict[Message, Frame] = {}
        self._late.reset()
        periods = self.parameters
        self._schedule: list[tuple[float, tuple[Message, ...]]] = [
            (periods.encoder_period_s, (codec.GET_ENCODER_ESTIMATES,)),
            (periods.current_period_s, (codec.GET_IQ,)),
            (periods.heartbeat_period_s, (self._firmware.heartbeat,)),
            (periods.slow_period_s, self._firmware.slow_messages),
        ]
        # Boards are switched on at different times, so their messages do not all come in the same tick.
        self._due_s = [now_s + period_s * self._random.random() for period_s, _ in self._schedule]
        self._next_due_s = min(self._due_s)

    def restart(self, now_s: float) -> None:
        """Restarts as after a supply dip: ignores and sends nothing for BOOT_S, then reports its initialisation."""
        turns, turns_s = self._turns, self._turns_s
        self.parameters = self._settings.restart(self.parameters)
        self.reset(now_s + BOOT_S)
        self._turns, self._turns_s = turns, turns_s
        self._stepped_s = now_s
        self._boots_until_s = now_s + BOOT_S
        self._initializing = True

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        """Executes one frame of the bus and returns the answers to it."""
        node_id, command = frame.arbitration_id >> 5, frame.arbitration_id & 0x1F
        if frame.is_extended or node_id != self.parameters.node_id or now_s < self._boots_until_s:
            return []
        if self.parameters.any_frame_feeds:
            self._fed_s = now_s
        if frame.is_remote:
            return [self._frame(message) for message in self._payloads if message.command == command]
        if command == codec.RX_SDO.command:
            return self._read_parameter(frame.data)
        with suppress(MalformedMessageError):  # a drive ignores malformed messages
            self._execute(command, frame.data, now_s)
        return []

    def _execute(self, command: int, data: bytes, now_s: float) -> None:
        if command == codec.SET_INPUT_TORQUE.command:
            (self._setpoint_nm,) = finite(codec.SET_INPUT_TORQUE.decode(data))
            self._fed_s = now_s
        elif command == codec.SET_AXIS_STATE.command:
            self._change_state(codec.SET_AXIS_STATE.decode(data)[0], now_s)
        elif command == codec.SET_CONTROLLER_MODE.command:
            self._modes = codec.SET_CONTROLLER_MODE.decode(data)
        elif command == codec.SET_LIMITS.command:
            self._set_limits(*finite(codec.SET_LIMITS.decode(data)))
        elif command == codec.SET_VEL_GAINS.command:
            (self._velocity_gain_nm_s_turn,) = finite(codec.SET_VEL_GAINS.decode(data)[:1])
        elif command == codec.CLEAR_ERRORS.command:
            self.errors = 0
        elif command == codec.ESTOP.command:
            self._disarm(self._firmware.estop_flag)
        elif command == codec.REBOOT.command:
            if codec.REBOOT.decode(data)[0] == SAVE:
                self._settings.save()
            self.restart(now_s)

    def _read_parameter(self, data: bytes) -> list[Frame]:
        """Executes a message that reads or writes a setting."""
        answer, self.parameters = self._settings.execute(data, self.parameters)
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
        self._disarm(self._firmware.error_flags[error])

    def forge(self, forgery: Forgery) -> Frame:
        return forgeries.forged_frame(self.parameters.node_id, forgery)

    def forge_current(self, current_a: float) -> Frame:
        return forgeries.forged_current(self.parameters.node_id, self._setpoint_a, current_a)

    def forge_torque(self, torque_nm: float) -> Frame:
        return forgeries.forged_torque(self.parameters.node_id, self.parameters.sign * torque_nm)

    def torque_nm(self, now_s: float) -> float:
        """Returns the torque that the motor exerts at the joint now."""
        self._trip_if_due(now_s)
        torque_nm = 0.0
        if self.axis_state is AxisState.CLOSED_LOOP and self._modes == TORQUE_MODES:
            torque_nm = self._computed_nm(now_s)
        else:
            self._current_a = self._setpoint_a = 0.0
        self._stepped_s = now_s
        return joint_torque_nm(self.parameters, torque_nm, self._turns)

    def _trip_if_due(self, now_s: float) -> None:
        if self.axis_state is AxisState.CLOSED_LOOP:
            fastest_turn_s = self.parameters.overspeed_fraction * self._velocity_limit_turn_s
            if 0.0 < self.parameters.watchdog_s < now_s - self._fed_s:
                self.trip(DriveError.WATCHDOG)
            elif 0.0 < fastest_turn_s < abs(self._turns_s):
                self.trip(DriveError.OVERSPEED)

    def _computed_nm(self, now_s: float) -> float:
        """Returns the torque by the drive's own torque constant, after its clamps and the lag of the current."""
        parameters, largest_nm = self.parameters, self._largest_nm
        gain, limit, turns_s = self._velocity_gain_nm_s_turn, self._velocity_limit_turn_s, self._turns_s
        torque_nm, lowest_nm, highest_nm = self._setpoint_nm, (-limit - turns_s) * gain, (limit - turns_s) * gain
        torque_nm = lowest_nm if lowest_nm > torque_nm else torque_nm  # min and max cost ten times as much
        torque_nm = highest_nm if highest_nm < torque_nm else torque_nm
        torque_nm = -largest_nm if -largest_nm > torque_nm else torque_nm
        torque_nm = largest_nm if largest_nm < torque_nm else torque_nm
        self._setpoint_a = torque_nm / parameters.torque_constant_nm_a
        if parameters.current_lag_s:
            before_nm = self._current_a * parameters.torque_constant_nm_a
            torque_nm += (before_nm - torque_nm) * exp((self._stepped_s - now_s) / parameters.current_lag_s)
        self._current_a = torque_nm / parameters.torque_constant_nm_a
        return torque_nm

    def measure(self, angle_rad: float, velocity_rad_s: float) -> None:
        """Sets the joint's true angle and velocity, from which the encoder's messages are made."""
        parameters = self.parameters
        self._turns = parameters.sign * angle_rad / TURN_RAD + parameters.zero_turn
        self._turns_s = parameters.sign * velocity_rad_s / TURN_RAD

    def cyclic_frames(self, now_s: float) -> Iterable[Frame]:
        """Returns the messages that have come due, or have arrived by now where they are delayed."""
        frames = self._due_frames(now_s) if now_s >= self._next_due_s else ()
        longest_s = self.parameters.message_delay_s
        return self._late.update(frames, now_s, longest_s) if longest_s else frames

    def _due_frames(self, now_s: float) -> Iterator[Frame]:
        for index, (period_s, messages) in enumerate(self._schedule):
            if now_s < self._due_s[index]:
                continue
            self._due_s[index] += period_s
            if self._due_s[index] <= now_s:  # delayed by more than a period: lost messages are not sent later
                self._due_s[index] = now_s + period_s
            for message in messages:
                repeating = self.parameters.repeated_fraction and message in REPEATED
                yield self._new_or_repeated_frame(message, now_s) if repeating else self._frame(message, now_s)
        self._next_due_s = min(self._due_s)

    def _new_or_repeated_frame(self, message: Message, now_s: float) -> Frame:
        reported = self._reported.get(message)
        if reported is not None and self._random.random() < self.parameters.repeated_fraction:
            return reported._replace(stamp_s=now_s)
        self._reported[message] = frame = self._frame(message, now_s)
        return frame

    def _frame(self, message: Message, stamp_s: float = NEVER_S) -> Frame:
        return Frame(self._ids[message], self._payloads[message](), stamp_s=stamp_s)

    def _encoder(self) -> bytes:
        parameters = self.parameters
        if parameters.encoder_frozen:
            return codec.GET_ENCODER_ESTIMATES.encode(self._reported_turns, 0.0)
        self._reported_turns = encoder_turns(parameters, self._turns, self._random)
        turns_s = self._turns_s
        if parameters.velocity_noise_rad_s:
            turns_s += self._random.gauss(0.0, parameters.velocity_noise_rad_s) / TURN_RAD
        return codec.GET_ENCODER_ESTIMATES.encode(self._reported_turns, turns_s)

    def _iq(self) -> bytes:
        noise_a = self.parameters.current_noise_a
        measured_a = self._current_a + (self._random.gauss(0.0, noise_a) if noise_a else 0.0)
        return codec.GET_IQ.encode(self._setpoint_a, measured_a)

    def _heartbeat(self) -> bytes:
        errors = self.errors | codec.ERROR_INITIALIZING if self._initializing else self.errors
        self._initializing = False
        return codec.HEARTBEAT.encode(errors, self.axis_state, 0, 0)

    def _error(self) -> bytes:
        return codec.GET_ERROR.encode(self.errors, self.disarm_reason)

    def _temperature(self) -> bytes:
        return codec.GET_TEMPERATURE.encode(self.parameters.temperature_c, self.parameters.temperature_c)

    def _bus_voltage(self) -> bytes:
        return codec.GET_BUS_VOLTAGE_CURRENT.encode(self.parameters.bus_voltage_v, abs(self._current_a) * 0.1)

    def _version(self) -> bytes:
        return codec.GET_VERSION.encode(*VERSION_FIELDS)

    def _address(self) -> bytes:
        return codec.encode_address(self.parameters.node_id, int(self.parameters.serial_number or "0", 16))

    def _payload_functions(self) -> dict[Message, Callable[[], bytes]]:
        """Returns the encoder of each message that this firmware sends."""
        return {
            codec.GET_ENCODER_ESTIMATES: self._encoder,
            codec.GET_IQ: self._iq,
            codec.HEARTBEAT: self._heartbeat,
            codec.GET_ERROR: self._error,
            codec.GET_TEMPERATURE: self._temperature,
            codec.GET_BUS_VOLTAGE_CURRENT: self._bus_voltage,
            codec.GET_VERSION: self._version,
            codec.ADDRESS: self._address,
        }
