"""A motor drive as the bus sees it: ODrive CANSimple 0.6, byte for byte.

Axis state machine (idle, closed loop), error word with disarm reason, watchdog, torque mode with the velocity-limit
clamp and the current limits, cyclic messages, requests by remote frame. The motor turns current into torque by its
own constant and reports the current with noise and the angle in steps of its encoder.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf, isfinite, pi
from random import Random

from drivers import odrive_codec as codec
from drivers.frames import Frame
from drivers.odrive_codec import AxisState, GarbledMessageError, Message, arbitration_id

TURN_RAD = 2.0 * pi
VERSION_FIELDS = (2, 4, 4, 58, 0, 6, 11, 0)  # protocol 2, an ODrive Pro, firmware 0.6.11


@dataclass(frozen=True)
class OdriveParameters:
    node_id: int
    sign: int = 1
    zero_turn: float = 0.0
    torque_constant_nm_a: float = 0.083
    current_noise_a: float = 0.1
    encoder_counts: int = 16384
    watchdog_s: float = 0.1  # 0: off, as ODrives are delivered
    encoder_period_s: float = 0.002
    current_period_s: float = 0.002
    heartbeat_period_s: float = 0.1
    slow_period_s: float = 0.1  # error, temperature, bus voltage
    velocity_gain_nm_s_turn: float = 1.0 / 6.0  # ODrive's default vel_gain, used by the torque clamp
    temperature_c: float = 30.0
    bus_voltage_v: float = 24.0
    motor_current_limit_a: float = inf  # the motor's own clip, whatever limit the bus sets


class SimulatedOdrive:
    """Owns one drive's state. Angles and torques at this border are the joint's; turns and signs stay inside."""

    def __init__(self, parameters: OdriveParameters, random: Random) -> None:
        self.parameters = parameters
        self._random = random
        self.reset(0.0)

    def reset(self, now_s: float) -> None:
        """As after power-on."""
        self.axis_state = AxisState.IDLE
        self.errors = self.disarm_reason = 0
        self._setpoint_nm = 0.0  # at the motor
        self._modes = (0, 0)
        self._velocity_limit_turn_s, self._current_limit_a = 2.0, 10.0  # ODrive's defaults
        self._fed_s = now_s
        self._current_a = 0.0
        self._turns = self._turns_s = 0.0
        periods = self.parameters
        self._schedule: list[tuple[float, tuple[Message, ...]]] = [
            (periods.encoder_period_s, (codec.GET_ENCODER_ESTIMATES,)),
            (periods.current_period_s, (codec.GET_IQ,)),
            (periods.heartbeat_period_s, (codec.HEARTBEAT,)),
            (periods.slow_period_s, (codec.GET_ERROR, codec.GET_TEMPERATURE, codec.GET_BUS_VOLTAGE_CURRENT)),
        ]
        # Boards are switched on at different moments: their messages do not come all at once.
        self._due_s = [now_s + period_s * self._random.random() for period_s, _ in self._schedule]

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        """Obey one frame of the bus; the answers it calls for."""
        node_id, command = frame.arbitration_id >> 5, frame.arbitration_id & 0x1F
        if frame.is_extended or node_id != self.parameters.node_id:
            return []
        if frame.is_remote:
            return [self._frame(message) for message in self._PAYLOADS if message.command == command]
        with suppress(GarbledMessageError):  # a drive ignores what it cannot read
            self._obey(command, frame.data, now_s)
        return []

    def _obey(self, command: int, data: bytes, now_s: float) -> None:
        if command == codec.SET_INPUT_TORQUE.command:
            (torque_nm,) = codec.SET_INPUT_TORQUE.decode(data)
            self._set_torque(torque_nm, now_s)
        elif command == codec.SET_AXIS_STATE.command:
            self._change_state(codec.SET_AXIS_STATE.decode(data)[0], now_s)
        elif command == codec.SET_CONTROLLER_MODE.command:
            self._modes = codec.SET_CONTROLLER_MODE.decode(data)
        elif command == codec.SET_LIMITS.command:
            self._set_limits(*codec.SET_LIMITS.decode(data))
        elif command == codec.CLEAR_ERRORS.command:
            self.errors = 0
        elif command == codec.ESTOP.command:
            self._disarm(codec.ERROR_ESTOP)

    def _set_torque(self, torque_nm: float, now_s: float) -> None:
        if not isfinite(torque_nm):
            raise GarbledMessageError("not a finite number")
        self._setpoint_nm = torque_nm
        self._fed_s = now_s

    def _set_limits(self, velocity_turn_s: float, current_a: float) -> None:
        if not isfinite(velocity_turn_s + current_a):
            raise GarbledMessageError("not a finite number")
        self._velocity_limit_turn_s, self._current_limit_a = velocity_turn_s, current_a

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

    def torque_nm(self, now_s: float) -> float:
        """At the joint, as the motor exerts it now."""
        parameters = self.parameters
        if self.axis_state is AxisState.CLOSED_LOOP and 0.0 < parameters.watchdog_s < now_s - self._fed_s:
            self._disarm(codec.ERROR_WATCHDOG)
        if self.axis_state is not AxisState.CLOSED_LOOP or self._modes != (codec.TORQUE_CONTROL, codec.PASSTHROUGH):
            self._current_a = 0.0
            return 0.0
        gain, limit = parameters.velocity_gain_nm_s_turn, self._velocity_limit_turn_s
        torque_nm = min(max(self._setpoint_nm, (-limit - self._turns_s) * gain), (limit - self._turns_s) * gain)
        largest_a = min(self._current_limit_a, parameters.motor_current_limit_a)
        largest_nm = largest_a * parameters.torque_constant_nm_a
        torque_nm = min(max(torque_nm, -largest_nm), largest_nm)
        self._current_a = torque_nm / parameters.torque_constant_nm_a
        return parameters.sign * torque_nm

    def measure(self, angle_rad: float, velocity_rad_s: float) -> None:
        """Take in where the joint is."""
        parameters = self.parameters
        turns = parameters.sign * angle_rad / TURN_RAD + parameters.zero_turn
        self._turns = round(turns * parameters.encoder_counts) / parameters.encoder_counts
        self._turns_s = parameters.sign * velocity_rad_s / TURN_RAD

    def cyclic_frames(self, now_s: float) -> Iterator[Frame]:
        """The messages that have come due."""
        for place, (period_s, messages) in enumerate(self._schedule):
            if now_s < self._due_s[place]:
                continue
            self._due_s[place] += period_s
            if self._due_s[place] <= now_s:  # held up for longer than a period: the lost ones are not made up for
                self._due_s[place] = now_s + period_s
            for message in messages:
                yield self._frame(message)._replace(stamp_s=now_s)

    def _frame(self, message: Message) -> Frame:
        return Frame(arbitration_id(self.parameters.node_id, message), self._PAYLOADS[message](self))

    def _encoder(self) -> bytes:
        return codec.GET_ENCODER_ESTIMATES.encode(self._turns, self._turns_s)

    def _iq(self) -> bytes:
        noise_a = self.parameters.current_noise_a
        measured_a = self._current_a + (self._random.gauss(0.0, noise_a) if noise_a else 0.0)
        return codec.GET_IQ.encode(self._current_a, measured_a)

    def _heartbeat(self) -> bytes:
        return codec.HEARTBEAT.encode(self.errors, self.axis_state, 0, 0)

    def _error(self) -> bytes:
        return codec.GET_ERROR.encode(self.errors, self.disarm_reason)

    def _temperature(self) -> bytes:
        return codec.GET_TEMPERATURE.encode(self.parameters.temperature_c, self.parameters.temperature_c)

    def _bus_voltage(self) -> bytes:
        return codec.GET_BUS_VOLTAGE_CURRENT.encode(self.parameters.bus_voltage_v, abs(self._current_a) * 0.1)

    def _version(self) -> bytes:
        return codec.GET_VERSION.encode(*VERSION_FIELDS)

    _PAYLOADS = {
        codec.GET_ENCODER_ESTIMATES: _encoder,
        codec.GET_IQ: _iq,
        codec.HEARTBEAT: _heartbeat,
        codec.GET_ERROR: _error,
        codec.GET_TEMPERATURE: _temperature,
        codec.GET_BUS_VOLTAGE_CURRENT: _bus_voltage,
        codec.GET_VERSION: _version,
    }
