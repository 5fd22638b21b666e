"""The robot's four ODrives over one or two CAN ports, as joints.

`read` drains the ports and keeps the newest of every signal with the time it arrived; `send` commands torque. A
joint's sign turns a mirrored motor round in angle, velocity, current and torque alike. Nothing is transmitted here
unless the caller asks for it, and the frames of strangers, garbled ones included, are counted and ignored.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite, pi
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.records import JOINTS, NEVER_S, UNKNOWN, DriveState, DriveStates, Torques
from drivers import odrive_codec as codec
from drivers.can_port import CanPort
from drivers.frames import Frame
from drivers.odrive_codec import AxisState, GarbledMessageError, Message, arbitration_id

REPEAT_S = 0.1  # between two requests to change the axis state, of which the heartbeat tells the result
LONGEST_IN_QUEUE_S = 0.05  # a stamp older than that is of another clock
VERSION_REPEAT_S = 0.5
TURN_RAD = 2.0 * pi


@dataclass(frozen=True)
class DriveParameters:
    bus: str
    node_id: Annotated[int, Bounds(0, 62)]
    sign: Annotated[int, Bounds(-1, 1)] = 1  # -1 for a mirrored motor; 0 is refused
    zero_turn: Annotated[float, Bounds(-1000.0, 1000.0)] = 0.0  # encoder reading at joint angle zero
    torque_constant_nm_a: Annotated[float, Bounds(0.001, 10.0)] = 0.083  # 60 / (2π · 115 rpm/V), as in the paper
    velocity_limit_turn_s: Annotated[float, Bounds(0.1, 200.0)] = 10.0  # also bounds torque: see `arm`
    current_limit_a: Annotated[float, Bounds(0.1, 200.0)] = 12.0


class Version(NamedTuple):
    major: int
    minor: int
    revision: int


class OdriveAxis:
    """Owns what is known of one drive; every field is the newest that arrived."""

    def __init__(self, joint: str, parameters: DriveParameters, port: CanPort) -> None:
        self.joint = joint
        self.parameters = parameters
        self._port = port
        self._rad_per_turn = parameters.sign * TURN_RAD
        self._torque_id = arbitration_id(parameters.node_id, codec.SET_INPUT_TORQUE)
        self.reset()

    def reset(self) -> None:
        self._angle_rad = self._velocity_rad_s = self._current_a = UNKNOWN
        self._angle_stamp_s = self._current_stamp_s = self._heartbeat_stamp_s = NEVER_S
        self._temperature_c = self._bus_voltage_v = UNKNOWN
        self._temperature_stamp_s = NEVER_S
        self.closed_loop = False
        self._error_flags = 0
        self.disarm_reason = 0
        self.version: Version | None = None

    @property
    def receivers(self) -> dict[int, Callable[[bytes, float], None]]:
        """What to do with the payload of each arbitration id that this drive sends."""
        table: dict[Message, Callable[[bytes, float], None]] = {
            codec.GET_ENCODER_ESTIMATES: self._receive_encoder,
            codec.GET_IQ: self._receive_current,
            codec.HEARTBEAT: self._receive_heartbeat,
            codec.GET_ERROR: self._receive_error,
            codec.GET_TEMPERATURE: self._receive_temperature,
            codec.GET_BUS_VOLTAGE_CURRENT: self._receive_bus_voltage,
            codec.GET_VERSION: self._receive_version,
        }
        return {arbitration_id(self.parameters.node_id, message): receive for message, receive in table.items()}

    def _receive_encoder(self, data: bytes, now_s: float) -> None:
        turns, turns_s = codec.GET_ENCODER_ESTIMATES.decode(data)
        _require_finite(turns + turns_s)
        self._angle_rad = (turns - self.parameters.zero_turn) * self._rad_per_turn
        self._velocity_rad_s = turns_s * self._rad_per_turn
        self._angle_stamp_s = now_s

    def _receive_current(self, data: bytes, now_s: float) -> None:
        _, measured_a = codec.GET_IQ.decode(data)
        _require_finite(measured_a)
        self._current_a = self.parameters.sign * measured_a
        self._current_stamp_s = now_s

    def _receive_heartbeat(self, data: bytes, now_s: float) -> None:
        self._error_flags, state, _, _ = codec.HEARTBEAT.decode(data)
        self.closed_loop = state == AxisState.CLOSED_LOOP
        self._heartbeat_stamp_s = now_s

    def _receive_error(self, data: bytes, now_s: float) -> None:
        self._error_flags, self.disarm_reason = codec.GET_ERROR.decode(data)

    def _receive_temperature(self, data: bytes, now_s: float) -> None:
        _, self._temperature_c = codec.GET_TEMPERATURE.decode(data)
        self._temperature_stamp_s = now_s

    def _receive_bus_voltage(self, data: bytes, now_s: float) -> None:
        self._bus_voltage_v, _ = codec.GET_BUS_VOLTAGE_CURRENT.decode(data)

    def _receive_version(self, data: bytes, now_s: float) -> None:
        fields = codec.GET_VERSION.decode(data)
        self.version = Version(*fields[4:7])

    @property
    def state(self) -> DriveState:
        return DriveState(
            self._angle_rad,
            self._velocity_rad_s,
            self._angle_stamp_s,
            self._current_a,
            self._current_stamp_s,
            self.closed_loop,
            self._error_flags,
            self._heartbeat_stamp_s,
            self._temperature_c,
            self._temperature_stamp_s,
            self._bus_voltage_v,
        )

    @property
    def heard(self) -> bool:
        """Every signal that control depends on has come at least once."""
        return isfinite(self._angle_stamp_s + self._current_stamp_s + self._heartbeat_stamp_s)

    def send_torque(self, torque_nm: float) -> None:
        data = codec.SET_INPUT_TORQUE.encode(self.parameters.sign * torque_nm)
        self._port.send(Frame(self._torque_id, data))

    def arm(self) -> None:
        """Torque mode, limits, zero torque, closed loop.

        In torque mode ODrive clamps torque to (velocity limit - velocity) times its velocity gain, silently; the
        velocity limit is set here so that the clamp lies above every torque that we command.
        """
        limits = (self.parameters.velocity_limit_turn_s, self.parameters.current_limit_a)
        self._transmit(codec.SET_CONTROLLER_MODE, codec.TORQUE_CONTROL, codec.PASSTHROUGH)
        self._transmit(codec.SET_LIMITS, *limits)
        self._transmit(codec.SET_INPUT_TORQUE, 0.0)
        self._transmit(codec.SET_AXIS_STATE, AxisState.CLOSED_LOOP)

    def disarm(self) -> None:
        self._transmit(codec.SET_INPUT_TORQUE, 0.0)
        self._transmit(codec.SET_AXIS_STATE, AxisState.IDLE)

    def clear_errors(self) -> None:
        self._transmit(codec.CLEAR_ERRORS, 0)

    def request(self, message: Message) -> None:
        """Ask for one message by a remote frame."""
        self._port.send(Frame(arbitration_id(self.parameters.node_id, message), is_remote=True))

    def _transmit(self, message: Message, *values: float) -> None:
        self._port.send(Frame(arbitration_id(self.parameters.node_id, message), message.encode(*values)))


def _require_finite(value: float) -> None:
    if not isfinite(value):
        raise GarbledMessageError("not a finite number")


class OdriveDrives:
    """All four, in the order of JOINTS."""

    def __init__(self, parameters: Mapping[str, DriveParameters], ports: Mapping[str, CanPort]) -> None:
        self.ports = dict(ports)
        self.axes = tuple(OdriveAxis(joint, parameters[joint], ports[parameters[joint].bus]) for joint in JOINTS)
        self._receivers = [(port, self._receivers_on(name)) for name, port in self.ports.items()]
        self.reset()

    def reset(self) -> None:
        for axis in self.axes:
            axis.reset()
        self.unknown_frames = 0  # of other ids, remote or extended
        self.garbled_frames = 0  # of a drive of ours, with a payload that makes no sense
        self._armed_s = self._disarmed_s = self._version_asked_s = NEVER_S

    def read(self, now_s: float) -> DriveStates:
        """The newest of every signal after draining the ports, with the stamp of its frame."""
        for port, receivers in self._receivers:
            for frame in port.receive():
                receive = None if frame.is_remote or frame.is_extended else receivers.get(frame.arbitration_id)
                if receive is None:
                    self.unknown_frames += 1
                    continue
                try:
                    receive(frame.data, _stamp_s(frame, now_s))
                except GarbledMessageError:
                    self.garbled_frames += 1
        a, b, c, d = self.axes
        return a.state, b.state, c.state, d.state

    def _receivers_on(self, bus: str) -> dict[int, Callable[[bytes, float], None]]:
        table: dict[int, Callable[[bytes, float], None]] = {}
        for axis in self.axes:
            if axis.parameters.bus == bus:
                table.update(axis.receivers)
        return table

    @property
    def heard(self) -> bool:
        return all(axis.heard for axis in self.axes)

    def send(self, torques_nm: Torques) -> None:
        for axis, torque_nm in zip(self.axes, torques_nm, strict=True):
            axis.send_torque(torque_nm)

    def arm(self, now_s: float, at_once: bool = False) -> None:
        """Ask for closed loop: all drives `at_once`, else every REPEAT_S those that are not in it yet."""
        if not at_once and now_s - self._armed_s < REPEAT_S:
            return
        self._armed_s = now_s
        for axis in self.axes:
            if at_once or not axis.closed_loop:
                axis.arm()

    def disarm(self, now_s: float, at_once: bool = False) -> None:
        """Zero torque and idle: for all drives `at_once`, else every REPEAT_S for those still in closed loop."""
        if not at_once and now_s - self._disarmed_s < REPEAT_S:
            return
        for axis in self.axes:
            if at_once or axis.closed_loop:
                self._disarmed_s = now_s
                axis.disarm()

    def clear_errors(self) -> None:
        for axis in self.axes:
            axis.clear_errors()

    def request_versions(self, now_s: float) -> None:
        """Of the drives that did not tell theirs yet, every VERSION_REPEAT_S."""
        if now_s - self._version_asked_s < VERSION_REPEAT_S:
            return
        self._version_asked_s = now_s
        for axis in self.axes:
            if axis.version is None:
                axis.request(codec.GET_VERSION)

    def close(self) -> None:
        for port in self.ports.values():
            port.close()


def _stamp_s(frame: Frame, now_s: float) -> float:
    """When a frame was on the bus, or now, where its port does not know or its clock is another one."""
    return frame.stamp_s if 0.0 <= now_s - frame.stamp_s < LONGEST_IN_QUEUE_S else now_s
