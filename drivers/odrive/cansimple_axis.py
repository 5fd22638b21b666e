"""One ODrive of any firmware as one joint: motion, current, restarts, and the frames that command it.

A joint's sign inverts angle, velocity, current and torque of a mirrored motor alike. A drive counts as restarted when
it is heard again after a silence of RESTART_SILENCE_S, or reports that it initialises, or that its axis has no state
yet. What was read back from it is then unknown again. Everything that is read in one tick arrived since the tick
before, so a stall of this program is not taken for a silence of the drive.

A command for this drive that arrives here comes from another program, because a port does not receive its own frames.
Emergency stops are no such commands, and neither are requests to read: any program may send them.

axis.py and drivers/odrive05/axis.py add what differs between the firmwares: errors, settings and their messages.
"""

from collections.abc import Callable, Mapping
from math import isfinite, isnan, nan, pi
from typing import ClassVar

from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import DriveHealth, Outlet
from drivers.drive_axis import DriveAxis
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from drivers.odrive.duplicate_node_monitor import DuplicateNodeMonitor
from drivers.odrive.parameters import OdriveParameters
from drivers.odrive.settings import DriveSettings
from drivers.setpoint_monitor import SetpointMonitor

RESTART_SILENCE_S = 0.3  # three heartbeats
SUPPLY_SILENCE_S = 0.25  # of a message that is sent every 0.1 s
LARGEST_FLOAT = 3.4e38  # of binary32
TURN_RAD = 2.0 * pi
QUIET_STATES = (AxisState.UNDEFINED, AxisState.IDLE, AxisState.CLOSED_LOOP)  # in which nothing runs by itself


class CanSimpleAxis(DriveAxis):
    """Owns everything that is known about one drive; each field contains the newest value that arrived."""

    COMMANDS: ClassVar[frozenset[int]]  # that a drive of this firmware obeys
    CLEAR_ERRORS: ClassVar[bytes]  # the payload
    parameters: OdriveParameters

    def __init__(self, joint: str, parameters: OdriveParameters, outlet: Outlet, settings: DriveSettings) -> None:
        setpoints = SetpointMonitor(
            parameters.command_delay_s, parameters.velocity_limit_turn_s, parameters.velocity_gain_nm_s_turn
        )
        super().__init__(joint, parameters.sign, outlet, setpoints)
        self.parameters = parameters
        self.settings = settings
        self._rad_per_turn = self._sign * TURN_RAD
        self._current_sign = self._sign * parameters.current_sign
        self._setpoint_nm_a = parameters.current_sign * parameters.torque_constant_nm_a
        self._supply_request = Frame(arbitration_id(parameters.node_id, codec.GET_BUS_VOLTAGE_CURRENT), is_remote=True)
        self._torque_id = arbitration_id(parameters.node_id, codec.SET_INPUT_TORQUE)
        self._duplicates = DuplicateNodeMonitor(parameters.heartbeat_period_s)
        self.reset()

    def reset(self) -> None:
        super().reset()
        self.busy_state = 0  # a calibration, homing or other axis state that this program has not asked for
        self._starting = True  # until the drive has reported a state; a restart meanwhile is not counted again
        self._duplicates.reset()
        self.settings.reset()

    @property
    def receivers(self) -> dict[int, Callable[[bytes, float], None]]:
        """The handler for the payload of each arbitration id that this drive sends."""
        own = {message.command: receive for message, receive in self._reports.items()}
        foreign = dict.fromkeys(self.COMMANDS - {codec.ESTOP.command}, self._receive_foreign_command)
        return {self.parameters.node_id << 5 | command: receive for command, receive in (own | foreign).items()}

    @property
    def _reports(self) -> Mapping[Message, Callable[[bytes, float], None]]:
        """The handlers of the messages that both firmwares send alike; a firmware adds its own."""
        return {
            codec.GET_ENCODER_ESTIMATES: self._receive_encoder,
            codec.GET_IQ: self._receive_current,
            codec.GET_BUS_VOLTAGE_CURRENT: self._receive_supply,
            codec.GET_VERSION: self._receive_version,
        }

    def _receive_encoder(self, data: bytes, now_s: float) -> None:
        turns, turns_s = codec.GET_ENCODER_ESTIMATES.decode(data)
        if not isfinite(turns + turns_s):
            raise MalformedMessageError("a position or velocity that is not finite")
        if now_s - self._angle_stamp_s > RESTART_SILENCE_S:
            self._on_silence()
        self._duplicates.on_reading(turns, self._read_s)
        self._angle_rad = (turns - self.parameters.zero_turn) * self._rad_per_turn
        self._velocity_rad_s = turns_s * self._rad_per_turn
        self._angle_stamp_s = now_s

    def _receive_current(self, data: bytes, now_s: float) -> None:
        setpoint_a, measured_a = codec.GET_IQ.decode(data)
        if not self.closed_loop:
            measured_a = self._idle_current_a(data, measured_a)
        if not isfinite(measured_a):
            raise MalformedMessageError("a current that is not finite")
        if now_s - self._current_stamp_s > RESTART_SILENCE_S:
            self._on_silence()
        self._current_a = self._current_sign * measured_a
        self._current_stamp_s = now_s
        if self.closed_loop:
            self.setpoints.on_report(setpoint_a * self._setpoint_nm_a, self._sign * self._velocity_rad_s)

    def _idle_current_a(self, data: bytes, measured_a: float) -> float:
        """Return the current of an idle drive, which reports that it measures none."""
        return 0.0 if isnan(measured_a) else measured_a

    @property
    def may_be_on(self) -> bool:
        return self.closed_loop or self.busy_state > codec.LAST_STATE

    def _receive_state(self, state: int, initializing: bool, now_s: float) -> None:
        """Handle the axis state of a heartbeat."""
        if now_s - self._heartbeat_stamp_s > RESTART_SILENCE_S:
            self._on_silence()
        if state == AxisState.UNDEFINED or initializing:
            self._on_restart()
        else:
            self._starting = False
        self._duplicates.on_heartbeat(self._read_s, self._read_before_s)
        self.closed_loop = state == AxisState.CLOSED_LOOP
        self.setpoints.on_heartbeat(self.closed_loop)
        self._heartbeat_stamp_s = now_s
        busy_state = 0 if state in QUIET_STATES else state
        if busy_state != self.busy_state:
            self.busy_state, self._health = busy_state, None

    def _on_silence(self) -> None:
        """Count a restart if all messages were missing, not one of them alone, while this program was reading."""
        heard_s = max(self._angle_stamp_s, self._current_stamp_s, self._heartbeat_stamp_s)
        if isfinite(heard_s) and self._read_before_s - heard_s > RESTART_SILENCE_S:
            self._on_restart()

    def _on_restart(self) -> None:
        if not self._starting:
            self.restarts += 1
        self._starting = True
        self.settings.forget()
        self._health = None

    def _receive_supply(self, data: bytes, now_s: float) -> None:
        self._bus_voltage_v, self._bus_current_a = codec.GET_BUS_VOLTAGE_CURRENT.decode(data)
        self._bus_voltage_stamp_s = now_s

    def _receive_version(self, data: bytes, now_s: float) -> None:
        self.settings.on_version(data)
        self._health = None

    def _receive_foreign_command(self, data: bytes, now_s: float) -> None:
        self._count_foreign_command()

    @property
    def duplicates(self) -> bool:
        """Return whether two drives seem to share this id: see drivers/odrive/duplicate_node_monitor.py."""
        return self._duplicates.found

    def _build_health(self) -> DriveHealth:
        """Add the axis state; a firmware adds its version, watchdog and errors."""
        return super()._build_health()._replace(busy_state=f"axis state {self.busy_state}" if self.busy_state else "")

    def send_torque(self, torque_nm: float) -> None:
        if not -LARGEST_FLOAT < torque_nm < LARGEST_FLOAT:  # binary32 cannot represent it; the gate refuses NaN
            torque_nm = nan
        motor_nm = self._sign * torque_nm
        self.setpoints.on_command(motor_nm)
        self._outlet.send(Frame(self._torque_id, codec.SET_INPUT_TORQUE.encode(motor_nm)))

    def prepare(self) -> None:
        """Set torque mode, limits, velocity gain and zero torque.

        In torque mode ODrive clamps torque to (velocity limit - velocity) times its velocity gain without reporting
        it. As both are by default, the clamp takes at most 3 % of the torque that a joint may have at its speed, and
        all of it from 4 turns/s on, even when this program is dead and its last command is still in force.
        """
        parameters = self.parameters
        self._transmit(codec.SET_CONTROLLER_MODE, codec.TORQUE_CONTROL, codec.PASSTHROUGH)
        self._transmit(codec.SET_LIMITS, parameters.velocity_limit_turn_s, parameters.current_limit_a)
        self._transmit(codec.SET_VEL_GAINS, parameters.velocity_gain_nm_s_turn, 0.0)
        self._transmit(codec.SET_INPUT_TORQUE, 0.0)

    def close_loop(self) -> None:
        self._transmit(codec.SET_AXIS_STATE, AxisState.CLOSED_LOOP)

    def disarm(self) -> None:
        self._transmit(codec.SET_INPUT_TORQUE, 0.0)
        self._transmit(codec.SET_AXIS_STATE, AxisState.IDLE)

    def clear_errors(self) -> None:
        self._outlet.send(Frame(arbitration_id(self.parameters.node_id, codec.CLEAR_ERRORS), self.CLEAR_ERRORS))

    def request_supply(self) -> None:
        """Ask a drive that does not report its supply by itself."""
        if self._read_s - self._bus_voltage_stamp_s > SUPPLY_SILENCE_S:
            self._outlet.send(self._supply_request)

    def request_settings(self, now_s: float) -> None:
        for frame in self.settings.due_requests(self.parameters.node_id, now_s):
            self._outlet.send(frame)

    def _transmit(self, message: Message, *values: float) -> None:
        self._outlet.send(Frame(arbitration_id(self.parameters.node_id, message), message.encode(*values)))
