"""Simulates a motor drive on the bus: a Damiao, CubeMars or RobStride in MIT mode, byte for byte, with the registers of
a Damiao.

In the mode it follows kp, kd and torque of the newest command within its ranges and the motor's current; outside of it
the motor is without torque and the command is only remembered, to be followed as soon as the mode is entered. Its
watchdog runs in the mode only and is fed by commands alone, that of a CubeMars by torque alone. Once it expires, a
Damiao leaves the mode with the status "lost commands" until its errors are cleared; a CubeMars here remains in the mode
without torque, as the motors of the mini cheetah do, and reports nothing. A RobStride leaves the mode without a fault.
Sources: Core/Src/can.c and fsm.c of bgkatz/motorcontrol; damiao-motor 1.0.6; RobStride User Manuals of 2026-04-28.

It sends nothing but the answer to a command, with the values of before; a Damiao also answers the question for its
state. Its angles are radians. A new zero outlasts a restart in a Damiao only.
"""

from math import isnan, nan
from random import Random
from typing import NamedTuple

from drivers.can.frames import Frame, MalformedMessageError
from drivers.mit import codec
from drivers.mit.codec import Answer
from drivers.mit.models import MODELS
from drivers.mit.settings import PMAX, SERIAL, SOFTWARE, SUPPLY_V, TIMEOUT, TIMEOUT_UNIT_S, TMAX, VMAX
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters
from simulation.devices.mit.registers import answer_register, encode_value, first_values, write_frame
from simulation.devices.simulated_drive import TURN_RAD, SimulatedDrive

DEFAULT_MODEL = "DM4310"
KP_NM_RAD, KD_NM_S_RAD = 500.0, 5.0  # the largest gains
STEPS = 4095
# The status of a Damiao; its last three bits are the fault that a CubeMars reports.
ERRORS = {DriveError.OVERCURRENT: 0xA, DriveError.OVERSPEED: 0xE, DriveError.WATCHDOG: codec.LOST_COMMANDS}
ROBSTRIDE_BITS = {0xA: 1 << 4, 0xE: 1 << 14}  # of these errors in the faults that a RobStride reports
FORGED_COMMANDS = {Forgery.EMERGENCY_STOP: codec.LEAVE, Forgery.CLOSE_LOOP: codec.ENTER}
FORGED_ANSWERS = {  # a drive that starts has no firmware version yet
    Forgery.OLD_FIRMWARE: (SOFTWARE, 0.0),
    Forgery.STARTING: (SOFTWARE, 0.0),
    Forgery.WATCHDOG_OFF: (TIMEOUT, 0.0),
    Forgery.OTHER_DRIVE: (SERIAL, float(0xABCDEF)),
}


class Command(NamedTuple):
    """A command with gains, as a drive understands it."""

    position_rad: float = 0.0
    velocity_rad_s: float = 0.0
    kp_nm_rad: float = 0.0
    kd_nm_s_rad: float = 0.0
    torque_nm: float = 0.0


AT_REST = Command()


def decode_command(data: bytes, position_rad: float, velocity_rad_s: float, torque_nm: float) -> Command:
    """Decode a payload of eight bytes by a drive's ranges: unpack_cmd of Core/Src/can.c of bgkatz/motorcontrol."""
    number = int.from_bytes(data, "big")
    torque, kd, kp, velocity = (number >> shift & 0xFFF for shift in (0, 12, 24, 36))
    return Command(
        (number >> 48) * 2.0 * position_rad / 65535.0 - position_rad,
        velocity * 2.0 * velocity_rad_s / STEPS - velocity_rad_s,
        kp * KP_NM_RAD / STEPS,
        kd * KD_NM_S_RAD / STEPS,
        torque * 2.0 * torque_nm / STEPS - torque_nm,
    )


class SimulatedMit(SimulatedDrive):
    """Owns one drive's state."""

    units_per_turn = TURN_RAD

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        model = MODELS[parameters.model or DEFAULT_MODEL]
        self._model = model.with_ranges(parameters.velocity_range_rad_s, parameters.torque_range_nm)
        self.no_load_rad_s = self._model.velocity_rad_s  # a maker's code for the speed ends where the motor's ends
        self._feedback_id = codec.feedback_id(parameters.node_id, self._model)
        self.stored: dict[int, float] = {}  # registers that outlast a restart
        self._zero_rad = 0.0  # the encoder's angle that counts as zero
        super().__init__(parameters, random)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self.registers = first_values(self.parameters, self._model) | self.stored
        self.status = codec.DISABLED
        if not self._model.has_registers:
            self._zero_rad = 0.0
        self._command = AT_REST
        self._limp = False  # a CubeMars whose watchdog has expired: in the mode, without torque
        self._torque_nm = 0.0  # of the motor, by the drive's own torque constant

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        if frame.is_fd or frame.is_extended or frame.is_remote or now_s < self._boots_until_s:
            return []
        try:
            data = self._answer(frame, now_s)
        except MalformedMessageError:  # a drive ignores malformed frames
            return []
        if not data:
            return []
        return self._send(Frame(self._feedback_id, data, stamp_s=now_s))

    def _answer(self, frame: Frame, now_s: float) -> bytes:
        """Answer with the values of before, and execute the frame."""
        parameters = self.parameters
        if parameters.any_frame_feeds:
            self._fed_s = now_s
        if frame.arbitration_id == codec.REGISTER_ID and self._model.has_registers:
            if frame.data[:3] == codec.encode_read(parameters.node_id, 0)[:2] + bytes([codec.STATE]):
                return self._state()
            self.registers[SUPPLY_V] = parameters.bus_voltage_v
            return answer_register(self.registers, self.stored, parameters.node_id, frame.data)
        if frame.arbitration_id != parameters.node_id or len(frame.data) != codec.ANSWER_BYTES:
            return b""
        if frame.data == codec.FAULT_QUESTION and self._model.reports_faults_apart:
            return codec.encode_faults(parameters.node_id, ROBSTRIDE_BITS.get(self.status, 0))
        state = self._state()
        answer = self._new_or_repeated(Answer, lambda: state)
        self._execute(frame.data, now_s)
        return answer

    def _execute(self, data: bytes, now_s: float) -> None:
        if self._model.has_registers or data[:7] != codec.LEAVE[:7]:
            self._fed_s = now_s
        if data == codec.ENTER:
            self.status = codec.ENABLED if self.status == codec.DISABLED else self.status
        elif data == codec.LEAVE:
            self.status = codec.DISABLED if self.status == codec.ENABLED else self.status
        elif data == codec.CLEAR:
            self.status = codec.DISABLED
        elif data == codec.SET_ZERO:
            self._zero_rad = self._angle
        else:
            self._command = decode_command(data, self.registers[PMAX], self.registers[VMAX], self.registers[TMAX])

    def _state(self) -> bytes:
        parameters, model = self.parameters, self._model
        answer = Answer(
            parameters.node_id,
            0 if not model.has_registers else self.status,
            self._measured_angle() - self._zero_rad,
            self._measured_speed(),
            self._measured_nm(),
            parameters.temperature_c,
            int(max(parameters.temperature_c, 0.0)) if model.has_registers else self.status & 0x7 if self.failed else 0,
        )
        ranges = model._replace(torque_nm=self.registers[TMAX])
        return codec.encode_answer(answer, ranges)

    def _measured_nm(self) -> float:
        constant_nm_a = self.parameters.torque_constant_nm_a
        forged_a, self._forged_a = self._forged_a, nan
        if not isnan(forged_a):
            return forged_a * constant_nm_a
        return self._torque_nm + constant_nm_a * self._noise(self.parameters.current_noise_a)

    @property
    def energised(self) -> bool:
        return self.status == codec.ENABLED and not self._limp

    @energised.setter
    def energised(self, energised: bool) -> None:
        self.status = codec.ENABLED if energised else codec.DISABLED

    @property
    def failed(self) -> bool:
        return self.status not in (codec.DISABLED, codec.ENABLED)

    def trip(self, error: DriveError) -> None:
        self.status = ERRORS[error]

    def forge(self, forgery: Forgery) -> Frame:
        node_id = self.parameters.node_id
        if forgery in FORGED_COMMANDS:
            return Frame(node_id, FORGED_COMMANDS[forgery])
        if forgery is Forgery.OTHER_SETTING:
            return write_frame(node_id, TMAX, 3.0)
        register, value = FORGED_ANSWERS[forgery]
        data = codec.encode_register(node_id, codec.READ, register, encode_value(register, value))
        return Frame(self._feedback_id, data)

    def forge_current(self, current_a: float) -> Frame:
        """The next answer reports this current; the frame itself, for another drive, says nothing."""
        self._forged_a = current_a
        return Frame(codec.REGISTER_ID, bytes(codec.ANSWER_BYTES))

    def forge_torque(self, torque_nm: float) -> Frame:
        data = codec.encode_torque(self.parameters.sign * torque_nm, self.registers[TMAX])
        return Frame(self.parameters.node_id, data)

    def _motor_nm(self, now_s: float) -> float:
        expired = 0.0 < self.registers[TIMEOUT] * TIMEOUT_UNIT_S < now_s - self._fed_s
        if self._model.has_registers or self._model.reports_faults_apart:
            if expired and self.energised:
                self.status = codec.LOST_COMMANDS if self._model.has_registers else codec.DISABLED
        else:
            self._limp = expired
        if not self.energised:
            self._torque_nm = 0.0
            return 0.0
        parameters, command = self.parameters, self._command
        torque_nm = command.torque_nm + command.kp_nm_rad * (command.position_rad - (self._angle - self._zero_rad))
        torque_nm += command.kd_nm_s_rad * (command.velocity_rad_s - self._speed)
        largest_nm = min(self.registers[TMAX], parameters.motor_current_limit_a * parameters.torque_constant_nm_a)
        torque_nm = max(-largest_nm, min(largest_nm, torque_nm))
        if abs(self._speed) > self.no_load_rad_s and torque_nm * self._speed > 0.0:
            torque_nm = 0.0
        if parameters.current_lag_s:
            torque_nm = self._lagged_nm(torque_nm, self._torque_nm, now_s)
        self._torque_nm = torque_nm
        return self._torque_nm
