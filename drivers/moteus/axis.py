"""One moteus as one joint: the newest reply, what it says of the drive, and the frames that command it.

The drive sends nothing unless it is asked, so every frame to it asks for all signals, and the reply to the frame of one
tick is read in the next. A drive answers before it executes the command of the same frame: the current is still that of
the command before, so it has the time of the question as its stamp. While the drive is idle the frames
only ask, because a torque command of zero would let it follow torque. A joint's sign inverts angle, velocity, current
and torque of a mirrored motor alike.

drivers/answering_axis.py finds restarts and a second drive with this id. A command for this drive that arrives here
comes from another program, because a port does not receive its own frames. Stops and questions are no such commands:
any program may send them.
"""

from collections.abc import Callable
from math import nan, pi

from control.records import NEVER_S, UNKNOWN
from drivers.answering_axis import AnsweringAxis
from drivers.can.frames import Frame
from drivers.drive import FD, DriveHealth, Outlet
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode
from drivers.moteus.parameters import MoteusParameters
from drivers.moteus.registers import Register
from drivers.moteus.settings import REGISTER_MAP, MoteusSettings
from drivers.setpoint_monitor import SetpointMonitor

LARGEST_FLOAT = 3.4e38  # of binary32
TURN_RAD = 2.0 * pi
STOPPING_S = 0.1  # for which a drive that another program commanded is stopped in every tick
FOREIGN_MODES = (Mode.CURRENT, Mode.STAY_WITHIN)  # with torque; this program never commands them
QUIET_MODES = (Mode.STOPPED, Mode.FAULT, Mode.POSITION, Mode.TIMEOUT)  # in which nothing runs by itself


class MoteusAxis(AnsweringAxis):
    """Owns everything that is known about one drive."""

    parameters: MoteusParameters
    settings: MoteusSettings

    def __init__(self, joint: str, parameters: MoteusParameters, outlet: Outlet) -> None:
        super().__init__(joint, parameters.sign, outlet, SetpointMonitor(parameters.command_delay_s))
        self.parameters = parameters
        self._id = codec.command_id(parameters.node_id)
        self._rad_per_turn = self._sign * TURN_RAD
        self.settings = MoteusSettings(parameters)
        self.reset()

    def reset(self) -> None:
        super().reset()
        self._mode = int(Mode.STOPPED)
        self._reason = 0  # the last error, which a stop clears in the drive
        self._followed_s = UNKNOWN  # the last read with an answer that said so
        self._disturbed_s = NEVER_S  # the last read of such an answer, or of a foreign command

    @property
    def receivers(self) -> dict[int, Callable[[bytes, float], None]]:
        node_id = self.parameters.node_id
        return {
            codec.reply_id(node_id) | FD: self._receive,
            codec.command_id(node_id) | FD: self._receive_foreign,
            node_id | FD: self._receive_foreign,  # without a wish for a reply
        }

    def _receive(self, data: bytes, now_s: float) -> None:
        if len(data) == codec.REPLY_BYTES and data[0] == codec.FIRST_REPLY_BYTE:
            self._receive_signals(data, now_s)
        elif (power_w := codec.decode_power(data)) is not None:
            self._bus_current_a = power_w / self._bus_voltage_v if self._bus_voltage_v > 0.0 else UNKNOWN
        else:
            self._receive_settings(data, now_s)

    def _receive_signals(self, data: bytes, now_s: float) -> None:
        mode, turns, turns_s, current_a, temperature_c, voltage_v, fault, control_nm, _ = codec.decode_reply(data)
        self._on_answer()
        if turns - turns == 0.0 == turns_s - turns_s:  # finite
            self._angle_rad = (turns - self.parameters.zero_turn) * self._rad_per_turn
            self._velocity_rad_s = turns_s * self._rad_per_turn
            self._angle_stamp_s = self._measured_s(now_s)
        if current_a - current_a == 0.0:
            self._current_a = self._sign * current_a
            self._current_stamp_s = min(now_s, self._asked_s)
        if temperature_c != 0.0 and temperature_c == temperature_c:  # zero where no thermistor is configured
            self._temperature_c, self._temperature_stamp_s = temperature_c, now_s
        if voltage_v == voltage_v:
            self._bus_voltage_v, self._bus_voltage_stamp_s = voltage_v, now_s
        if mode != codec.ABSENT:
            self._receive_mode(mode, fault, now_s)
        if self.closed_loop and control_nm == control_nm:
            self.setpoints.on_report(control_nm, self._sign * self._velocity_rad_s)

    @property
    def _asked_s(self) -> float:
        """Return when the newest answer was asked for: every tick asks after it has read."""
        return self._read_before_s if self._read_before_s > NEVER_S else self._read_s

    def _measured_s(self, stamp_s: float) -> float:
        """Return when the drive measured: just before its answer, or where that has no stamp, when it was asked."""
        return stamp_s if stamp_s != self._read_s else min(stamp_s, self._asked_s)

    def _receive_mode(self, mode: int, fault: int, now_s: float) -> None:
        """Handle mode and fault. A drive that left position mode by itself is not commanded back into it.

        It counts as in closed loop if any answer of a read says so: other commands and stops may alternate.
        """
        flags = codec.error_flags(mode, fault)
        if mode != self._mode or flags != self._error_flags:
            self._mode, self._error_flags, self._health = mode, flags, None
            self._reason = flags or self._reason
        if self.closed_loop and mode != Mode.POSITION:
            self._following = False
        if mode == Mode.POSITION:
            self._followed_s = self._disturbed_s = self._read_s
        self.closed_loop = self._followed_s == self._read_s
        self._heartbeat_stamp_s = now_s
        self.setpoints.on_heartbeat(self.closed_loop)

    def _receive_settings(self, data: bytes, now_s: float) -> None:
        values: dict[int, float] = {}
        for subframe in registers.decode_frame(data):
            if subframe.kind == registers.CONSOLE_OUTPUT:
                self.settings.on_console(subframe.text, now_s)
            else:
                values |= registers.replied_values([subframe])
        self.settings.on_registers(values)
        self._health = None

    def _receive_foreign(self, data: bytes, now_s: float) -> None:
        """Count commands of another program; its questions get answers too."""
        subframes = list(registers.decode_frame(data))
        if any(each.kind == registers.READ and each.register == Register.MODE for each in subframes):
            self._on_question()
        stops = [each for each in subframes if each.register == Register.MODE and each.values == (Mode.STOPPED,)]
        commands = [each for each in subframes if each.kind in (registers.WRITE, registers.CONSOLE_INPUT)]
        if len(commands) > len(stops):
            self._count_foreign_command()
            self._disturbed_s = self._read_s

    def _build_health(self) -> DriveHealth:
        return (
            super()
            ._build_health()
            ._replace(
                supported_firmware=f"one with register map {REGISTER_MAP}",
                watchdog_advice="the drive did not answer on its console: is another program connected to it?",
                power_cut=self._error_flags == codec.UNDER_VOLTAGE,
                watchdog_expired=self._reason == codec.TIMEOUT_FLAG,
                busy_state="" if self._mode in QUIET_MODES else f"mode {self._mode}",
                active_errors=codec.error_text(self._error_flags),
                errors=codec.error_text(self._reason),
            )
        )

    def poll(self) -> None:
        self._transmit(codec.QUERY_ALONE)

    def send_torque(self, torque_nm: float) -> None:
        """Command torque; to a drive that is to be idle zero torque is no command, but a question, or a stop."""
        if not -LARGEST_FLOAT < torque_nm < LARGEST_FLOAT:  # binary32 cannot represent it; the gate refuses NaN
            torque_nm = nan
        motor_nm = self._sign * torque_nm
        self.setpoints.on_command(motor_nm)
        if self._following or motor_nm != 0.0:
            self._transmit(codec.encode_torque(motor_nm))
        else:
            self._transmit(codec.STOP_AND_QUERY if self._is_disturbed else codec.QUERY_ALONE)

    @property
    def _is_disturbed(self) -> bool:
        """Return whether a drive that is to be idle follows torque, or soon may: another program commands it.

        Its next command starts the drive again between two ticks. After a fault a drive obeys none until a stop.
        """
        return (
            self.closed_loop
            or self._mode in FOREIGN_MODES
            or self._mode == Mode.STOPPED
            and self._read_s - self._disturbed_s < STOPPING_S
        )

    def close_loop(self) -> None:
        """Let the torque commands that follow, and not the questions, leave."""
        self._following, self._reason, self._health = True, 0, None

    def disarm(self) -> None:
        self._following = False
        self._transmit(codec.STOP_AND_QUERY)

    def clear_errors(self) -> None:
        """Stop the drive, which clears a fault and the latched time-out."""
        self._reason, self._health = 0, None
        self._transmit(codec.STOP_AND_QUERY)

    def request_supply(self) -> None:
        """Ask for the motor's power: divided by the voltage, it is the current without what the drive takes itself."""
        self._outlet.send(codec.command_frame(self.parameters.node_id, codec.POWER_QUERY))

    def request_settings(self, now_s: float) -> None:
        request = self.settings.due_request(now_s)
        if request:
            self._outlet.send(codec.command_frame(self.parameters.node_id, request))

    def _transmit(self, data: bytes) -> None:
        self._on_question()
        self._outlet.send(Frame(self._id, data, is_extended=True, is_fd=True, bit_rate_switch=True))
