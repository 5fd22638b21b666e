"""Simulates a motor drive on the bus: a Damiao or a CubeMars in MIT mode, byte for byte, with a Damiao's registers.

In the mode it follows kp, kd and torque of the newest command within its ranges and the motor's current; outside of it
the motor is without torque and the command is only remembered, to be followed as soon as the mode is entered. Its
watchdog runs in the mode only and is fed by commands alone. Once it expires, a Damiao leaves the mode with the status
"lost commands" until its errors are cleared; a CubeMars here remains in the mode without torque, as the motors of
the mini cheetah do, and reports nothing. Sources: Core/Src/can.c and fsm.c of bgkatz/motorcontrol; damiao-motor 1.0.6.

It sends nothing but the answer to a command, with the values of before. Between the drive and the joint lie the same
imperfections as in simulation/devices/odrive/device.py.
"""

from collections.abc import Iterable
from math import exp, isnan, nan, pi
from random import Random

from control.records import NEVER_S
from drivers.can.frames import Frame, MalformedMessageError
from drivers.mit import codec
from drivers.mit.codec import Answer
from drivers.mit.models import MODELS
from drivers.mit.settings import PMAX, TIMEOUT, TIMEOUT_UNIT_S, TMAX, VMAX
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters
from simulation.devices.late_messages import LateAnswers
from simulation.devices.mit.commands import AT_REST, decode_command
from simulation.devices.mit.forgeries import forged_frame
from simulation.devices.mit.registers import answer_register, first_values
from simulation.devices.motor import encoder_turns, joint_torque_nm

TURN_RAD = 2.0 * pi
BOOT_S = 0.5  # silence of a drive that restarts
DEFAULT_MODEL = "DM4310"
# The status of a Damiao; its last three bits are the fault that a CubeMars reports.
ERRORS = {DriveError.OVERCURRENT: 0xA, DriveError.OVERSPEED: 0xE, DriveError.WATCHDOG: codec.LOST_COMMANDS}


class SimulatedMit:
    """Owns one drive's state. Callers use the joint's angles and torques; turns and signs stay inside."""

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        self.parameters = parameters
        self._random = random
        self._answers = LateAnswers(random)
        model = MODELS[parameters.model or DEFAULT_MODEL]
        self._model = model._replace(torque_nm=parameters.torque_range_nm or model.torque_nm)
        self._feedback_id = codec.feedback_id(parameters.node_id, self._model)
        self.stored: dict[int, float] = {}  # registers that outlast a restart
        self.reset(0.0)

    def reset(self, now_s: float) -> None:
        """Restores the state after power-on."""
        self.registers = first_values(self.parameters, self._model) | self.stored
        self.status = codec.DISABLED
        self._command = AT_REST
        self._limp = False  # a CubeMars whose watchdog has expired: in the mode, without torque
        self._fed_s = self._stepped_s = now_s
        self._torque_nm = 0.0  # of the motor, by the drive's own torque constant
        self._rad = self._rad_s = self._reported_rad = 0.0
        self._boots_until_s = NEVER_S
        self._answers.reset()
        self._forged_current_a = nan

    def restart(self, now_s: float) -> None:
        """Restarts as after a supply dip: ignores and answers nothing for BOOT_S."""
        rad, rad_s = self._rad, self._rad_s
        self.reset(now_s + BOOT_S)
        self._rad, self._rad_s, self._stepped_s = rad, rad_s, now_s
        self._boots_until_s = now_s + BOOT_S

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        """Executes one frame of the bus and returns the answer to it, if it is not late."""
        if frame.is_fd or frame.is_extended or frame.is_remote or now_s < self._boots_until_s:
            return []
        try:
            data = self._answer(frame, now_s)
        except MalformedMessageError:  # a drive ignores malformed frames
            return []
        if not data:
            return []
        return self._answers.give(Frame(self._feedback_id, data, stamp_s=now_s), self.parameters.message_delay_s)

    def _answer(self, frame: Frame, now_s: float) -> bytes:
        """Answers with the values of before, and executes the frame."""
        parameters = self.parameters
        if parameters.any_frame_feeds:
            self._fed_s = now_s
        if frame.arbitration_id == codec.REGISTER_ID and self._model.has_registers:
            return answer_register(self.registers, self.stored, parameters.node_id, frame.data)
        if frame.arbitration_id != parameters.node_id or len(frame.data) != codec.ANSWER_BYTES:
            return b""
        answer = self._answers.new_or_repeated(self._state(), parameters.repeated_fraction)
        self._execute(frame.data, now_s)
        return answer

    def _execute(self, data: bytes, now_s: float) -> None:
        self._fed_s = now_s
        if data == codec.ENTER:
            self.status = codec.ENABLED if self.status == codec.DISABLED else self.status
        elif data == codec.LEAVE:
            self.status = codec.DISABLED if self.status == codec.ENABLED else self.status
        elif data == codec.CLEAR:
            self.status = codec.DISABLED
        elif data != codec.SET_ZERO:
            self._command = decode_command(data, self.registers[PMAX], self.registers[VMAX], self.registers[TMAX])

    def _state(self) -> bytes:
        parameters, model = self.parameters, self._model
        answer = Answer(
            parameters.node_id,
            0 if not model.has_registers else self.status,
            self._measured_rad(),
            self._measured_rad_s(),
            self._measured_nm(),
            parameters.temperature_c,
            int(parameters.temperature_c) if model.has_registers else self.status & 0x7 if self.failed else 0,
        )
        ranges = model._replace(torque_nm=self.registers[TMAX])
        return codec.encode_answer(answer, ranges)

    def _measured_rad(self) -> float:
        if not self.parameters.encoder_frozen:
            self._reported_rad = encoder_turns(self.parameters, self._rad / TURN_RAD, self._random) * TURN_RAD
        return self._reported_rad

    def _measured_rad_s(self) -> float:
        noise_rad_s = self.parameters.velocity_noise_rad_s
        noise_rad_s = self._random.gauss(0.0, noise_rad_s) if noise_rad_s else 0.0
        return 0.0 if self.parameters.encoder_frozen else self._rad_s + noise_rad_s

    def _measured_nm(self) -> float:
        constant_nm_a, noise_a = self.parameters.torque_constant_nm_a, self.parameters.current_noise_a
        forged_a, self._forged_current_a = self._forged_current_a, nan
        if not isnan(forged_a):
            return forged_a * constant_nm_a
        return self._torque_nm + (constant_nm_a * self._random.gauss(0.0, noise_a) if noise_a else 0.0)

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
        return forged_frame(self.parameters.node_id, self._feedback_id, forgery)

    def forge_current(self, current_a: float) -> Frame:
        """The next answer reports this current; the frame itself, for another drive, says nothing."""
        self._forged_current_a = current_a
        return Frame(codec.REGISTER_ID, bytes(codec.ANSWER_BYTES))

    def forge_torque(self, torque_nm: float) -> Frame:
        data = codec.encode_torque(self.parameters.sign * torque_nm, self.registers[TMAX])
        return Frame(self.parameters.node_id, data)

    def torque_nm(self, now_s: float) -> float:
        """Returns the torque that the motor exerts at the joint now."""
        expired = 0.0 < self.registers[TIMEOUT] * TIMEOUT_UNIT_S < now_s - self._fed_s
        self._limp = expired and not self._model.has_registers
        if expired and self.energised:
            self.trip(DriveError.WATCHDOG)
        torque_nm = 0.0
        if self.energised:
            torque_nm = self._computed_nm(now_s)
        else:
            self._torque_nm = 0.0
        self._stepped_s = now_s
        return joint_torque_nm(self.parameters, torque_nm, self._rad / TURN_RAD)

    def _computed_nm(self, now_s: float) -> float:
        """Returns the torque by the drive's own torque constant, after its limits and the lag of the current."""
        parameters, command = self.parameters, self._command
        torque_nm = command.torque_nm + command.kp_nm_rad * (command.position_rad - self._rad)
        torque_nm += command.kd_nm_s_rad * (command.velocity_rad_s - self._rad_s)
        largest_nm = parameters.motor_current_limit_a * parameters.torque_constant_nm_a
        largest_nm = min(self.registers[TMAX], largest_nm)
        torque_nm = max(-largest_nm, min(largest_nm, torque_nm))
        if parameters.current_lag_s:
            torque_nm += (self._torque_nm - torque_nm) * exp((self._stepped_s - now_s) / parameters.current_lag_s)
        self._torque_nm = torque_nm
        return torque_nm

    def measure(self, angle_rad: float, velocity_rad_s: float) -> None:
        """Sets the joint's true angle and velocity, from which the answers are made."""
        parameters = self.parameters
        self._rad = parameters.sign * angle_rad + parameters.zero_turn * TURN_RAD
        self._rad_s = parameters.sign * velocity_rad_s

    def cyclic_frames(self, now_s: float) -> Iterable[Frame]:
        """Returns the answers that have arrived by now, where they are late; it sends nothing by itself."""
        return self._answers.arrived(now_s, self.parameters.message_delay_s)
