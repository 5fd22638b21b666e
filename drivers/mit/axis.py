"""One drive in MIT mode as one joint: the newest answer, what it says of the drive, and the frames that command it.

The drive sends nothing but one answer to each command, made before it executes it, so the signals have the time of the
command as their stamp and their torque is that of the command before. No code is zero torque, so every
tick commands a drive that is to be idle to leave the mode; a lost command is repeated by the next tick.

A Damiao's answer says whether it follows torque. A CubeMars's does not: it counts as following from its first answer
without a fault after the command to enter, until a command to leave, also another program's, or a restart. So does a
RobStride, which is asked for its faults in place of the supply. The question is a command with full gains to another
maker's drive, so what has not answered it while idle is no RobStride and is not armed.
drivers/answering_axis.py finds restarts and a second drive with this id. A command that arrives here comes from another
program; one that does not, such as a command on the drive's serial line, shows in the torque that the answers measure.
"""

from collections.abc import Callable
from math import pi

from control.records import NEVER_S
from drivers.answering_axis import AnsweringAxis
from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import DriveHealth, Outlet
from drivers.mit import codec
from drivers.mit.gate_table import gate_table
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import FLOAT, SUPPLY_V, MitSettings
from drivers.setpoint_monitor import TOLERANCE_NM, SetpointMonitor

MASTER_ID = 0  # under which older CubeMars answer, all of a bus, and RobStrides as their manual has it
TURN_RAD = 2.0 * pi


class MitAxis(AnsweringAxis):
    """Owns everything that is known about one drive."""

    parameters: MitParameters
    settings: MitSettings

    def __init__(self, joint: str, parameters: MitParameters, outlet: Outlet) -> None:
        tolerance_nm = TOLERANCE_NM + parameters.torque_step_nm
        setpoints = SetpointMonitor(
            parameters.command_delay_s, parameters.fastest_rad_s / TURN_RAD, tolerance_nm=tolerance_nm, measured=True
        )
        super().__init__(joint, parameters.sign, outlet, setpoints)
        self.parameters = parameters
        self._ranges = parameters.ranges
        self._supply_request = Frame(codec.REGISTER_ID, codec.encode_read(parameters.node_id, SUPPLY_V))
        self._zero_rad = TURN_RAD * parameters.zero_turn
        self._amperes_per_nm = self._sign / parameters.reported_constant_nm_a
        self._harmless = gate_table(parameters).always[parameters.node_id]  # to this model, from any program
        self.settings = MitSettings(parameters)
        self.reset()

    def reset(self) -> None:
        super().reset()
        self._reported_fault: int | None = None  # of a RobStride, when it was asked

    @property
    def receivers(self) -> dict[int, Callable[[bytes, float], None]]:
        node_id = self.parameters.node_id
        if self._ranges.has_registers:
            return {
                codec.feedback_id(node_id, self._ranges): self._receive,
                node_id: self._receive_foreign,
                codec.REGISTER_ID: self._receive_foreign_register,
            }
        if self._ranges.reports_faults_apart:
            masters = dict.fromkeys((MASTER_ID, codec.ROBSTRIDE_MASTER), self._receive_master)
            return {node_id: self._receive_foreign, **masters}
        return {node_id: self._receive_shared, MASTER_ID: self._receive_master}

    def _receive(self, data: bytes, now_s: float) -> None:
        """Handle what arrives under a Damiao's MST_ID: the answer of a drive in the mode is never like a register's."""
        if codec.is_register_answer(data, self.parameters.node_id):
            _, _, register, value = codec.decode_register(data)
            if register == SUPPLY_V:
                (self._bus_voltage_v,), self._bus_voltage_stamp_s = FLOAT.unpack(value), now_s
                return
            self.settings.on_register(register, value)
            self._health = None
        else:
            self._receive_answer(data, now_s)

    def _receive_shared(self, data: bytes, now_s: float) -> None:
        """Handle what arrives under a CubeMars's id, of which its answers begin with that id."""
        if len(data) == codec.ANSWER_BYTES and data[0] != self.parameters.node_id:
            self._receive_foreign(data, now_s)
        else:
            self._receive_answer(data, now_s)

    def _receive_master(self, data: bytes, now_s: float) -> None:
        """Handle what arrives under an id that all drives of a bus share, by the first byte."""
        if data[:1] != bytes([self.parameters.node_id]):
            return
        if self._ranges.reports_faults_apart and codec.is_faults(data):
            self._on_answer()
            self._reported_fault, self._health = codec.decode_faults(data), None
        else:
            self._receive_answer(data, now_s)

    def _receive_answer(self, data: bytes, now_s: float) -> None:
        answer = codec.decode_answer(data, self._ranges)
        if answer.node_id != self.parameters.node_id:
            raise MalformedMessageError(f"an answer of node {answer.node_id}")
        self._on_answer()
        asked_s = self._read_before_s  # every tick asks after it has read
        stamp_s = asked_s if NEVER_S < asked_s < now_s else now_s
        self._angle_stamp_s = self._current_stamp_s = self._heartbeat_stamp_s = stamp_s
        self._angle_rad = self._sign * (answer.position_rad - self._zero_rad)
        self._velocity_rad_s = self._sign * answer.velocity_rad_s
        self._current_a = self._amperes_per_nm * answer.torque_nm
        has_registers = self._ranges.has_registers
        temperature_c = float(answer.last) if has_registers else answer.temperature_c
        if temperature_c:  # zero where no sensor is connected
            self._temperature_c, self._temperature_stamp_s = temperature_c, stamp_s
        if has_registers:
            faulty = answer.status not in (codec.DISABLED, codec.ENABLED)
            self._receive_status(answer.status, answer.status if faulty else 0)
        else:
            fault = answer.fault or self._reported_fault or 0
            follows = self._following and not fault
            self._receive_status(codec.ENABLED if follows else codec.DISABLED, fault)
        if self.closed_loop:
            self.setpoints.on_report(answer.torque_nm, answer.velocity_rad_s)
        self.setpoints.on_heartbeat(self.closed_loop)

    def _receive_status(self, status: int, flags: int) -> None:
        """Handle status and fault. A drive that left the mode by itself is not commanded back into it."""
        if flags != self._error_flags:
            self._error_flags, self._health = flags, None
        if flags or self.closed_loop and status != codec.ENABLED:
            self._following = False
        self.closed_loop = status == codec.ENABLED

    def _receive_foreign(self, data: bytes, now_s: float) -> None:
        """Count commands of another program, which the drive answers too. It may have left the mode by one."""
        self._on_question()
        if data == codec.LEAVE:
            self._following = False
        if data not in self._harmless:
            self._count_foreign_command()

    def _receive_foreign_register(self, data: bytes, now_s: float) -> None:
        node_id, kind, _, _ = codec.decode_register(data)
        if node_id != self.parameters.node_id:
            return
        if kind == codec.STATE:
            self._on_question()
        elif kind in (codec.WRITE, codec.STORE):
            self._count_foreign_command()

    def _on_restart(self) -> None:
        super()._on_restart()
        self._following, self._reported_fault = False, None

    def _build_health(self) -> DriveHealth:
        errors, apart = codec.error_text(self._error_flags), self._ranges.reports_faults_apart
        question = "question for faults" if apart else "reading of register 14"
        return (
            super()
            ._build_health()
            ._replace(
                firmware_supported=self.settings.supported and not (apart and self._reported_fault is None),
                supported_firmware=f"one that answers the {question}",
                watchdog_advice=self.settings.watchdog_advice,
                power_cut=self._error_flags in codec.UNDER_VOLTAGES,
                watchdog_expired=self._error_flags == codec.LOST_COMMANDS,
                active_errors=errors,
                errors=errors,
            )
        )

    def poll(self) -> None:
        self._transmit(codec.LEAVE)

    def send_torque(self, torque_nm: float) -> None:
        """Command torque; to a drive that is to be idle zero torque is no command, but the one to leave the mode."""
        motor_nm = self._sign * torque_nm
        self.setpoints.on_command(motor_nm)
        if self._following or torque_nm != 0.0:
            self._transmit(codec.encode_torque(motor_nm, self._ranges.torque_nm))
        else:
            self._transmit(codec.LEAVE)

    def prepare(self) -> None:
        """Replace the command that the drive remembers, which it would follow as soon as it enters the mode."""
        self._transmit(codec.encode_torque(0.0, self._ranges.torque_nm))

    def close_loop(self) -> None:
        self._following = True
        self._transmit(codec.ENTER)

    def disarm(self) -> None:
        self._following = False
        self._transmit(codec.LEAVE)

    def clear_errors(self) -> None:
        """Clear the errors of a Damiao or a RobStride; those of a CubeMars end with their cause or with its supply."""
        self._transmit(codec.CLEAR if codec.CLEAR in self._harmless else codec.LEAVE)

    def request_supply(self) -> None:
        """Ask a Damiao for its voltage, a RobStride for its faults; none reports the current of its supply."""
        if self._ranges.has_registers:
            self._outlet.send(self._supply_request)
        elif self._ranges.reports_faults_apart:
            self._transmit(codec.FAULT_QUESTION)

    def request_settings(self, now_s: float) -> None:
        request = self.settings.due_request(now_s)
        if request:
            self._outlet.send(Frame(codec.REGISTER_ID, request))

    def _transmit(self, data: bytes) -> None:
        self._on_question()
        self._outlet.send(Frame(self.parameters.node_id, data))
