"""Simulates a motor drive on the bus: a moteus on CAN FD, byte for byte, with the registers that this program uses.

It has the modes stopped, fault, current, position, timeout, zero velocity and brake. In position mode it adds the
feed-forward torque to a PD law of position and velocity, scaled as the command says, within the commanded torque and
the configured current. Its watchdog runs in position mode only and is fed by commands alone. Once it expires, the mode
timeout is latched until a stop, and the drive does what `servo.timeout_mode` says: 12 damps with the scale of kd of the
last command, as the firmware does (ISR_DoZeroVelocity of fw/bldc_servo_control.h), 15 shorts the windings, 10 holds the
position, 0 lets go.

It sends nothing unless it is asked, and answers a register that it does not have with an error. An answer has the
current, mode and torque of before the frame's command.
"""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from math import isnan
from random import Random

from drivers.can.frames import Frame, MalformedMessageError
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode, Reply
from drivers.moteus.registers import Register, Subframe
from drivers.moteus.settings import MAX_CURRENT, REGISTER_MAP, TIMEOUT_MODE, WATCHDOG
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters
from simulation.devices.moteus.console import MoteusConsole
from simulation.devices.moteus.forgeries import answer_frame, command_frame, forged_frame
from simulation.devices.moteus.torque import DEFAULTS, PURE_TORQUE, position_mode_nm, timeout_nm
from simulation.devices.simulated_drive import SimulatedDrive

FIRMWARE = 0x010100  # 1.1.0
SERIAL_WORDS = range(Register.SERIAL_NUMBER, Register.SERIAL_NUMBER + 3)
UNUSED_REGISTERS = (0x006, 0x00B, 0x00C)  # absolute position, trajectory, homing: always 0 here
REGISTERS = frozenset({*Register, *SERIAL_WORDS, *UNUSED_REGISTERS})
RUNNING = (Mode.STOPPED, Mode.CURRENT, Mode.POSITION, Mode.ZERO_VELOCITY, Mode.BRAKE)  # in which it obeys every command
DAMPING = (Mode.ZERO_VELOCITY, Mode.BRAKE)
FAULTS = {DriveError.OVERCURRENT: 33, DriveError.OVERSPEED: 50}


class SimulatedMoteus(SimulatedDrive):
    """Owns one drive's state."""

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        self._ids = (codec.command_id(parameters.node_id), parameters.node_id)
        super().__init__(parameters, random)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self.console = MoteusConsole(self.parameters)
        self.mode = Mode.STOPPED
        self.fault = 0
        self._command = dict(DEFAULTS)
        self._setpoint_nm = self._held_turns = 0.0  # the torque that the current follows, the angle at position mode
        self._q_current_a = 0.0  # the command of current mode

    def restart(self, now_s: float) -> None:
        """Restart with the settings that are stored."""
        console = self.console
        super().restart(now_s)
        self.console = console
        console.load()

    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        if frame.arbitration_id not in self._ids or not frame.is_fd or now_s < self._boots_until_s:
            return []
        if self.parameters.any_frame_feeds:
            self._fed_s = now_s
        data = b""
        with suppress(MalformedMessageError):  # a drive ignores malformed frames
            data = self._usual_answer(frame.data, now_s) or self._any_answer(frame.data, now_s)
        if not data or not frame.arbitration_id & codec.REPLY_WANTED:
            return []
        return self._send(answer_frame(self.parameters.node_id, data, now_s))

    def _any_answer(self, data: bytes, now_s: float) -> bytes:
        """Answer with the values of before, as a drive does, and execute the frame."""
        subframes = list(registers.decode_frame(data))
        answer = registers.padded(b"".join(map(self._answer, subframes)))
        self._execute(subframes, now_s)
        return answer

    def _usual_answer(self, data: bytes, now_s: float) -> bytes:
        """The same for a torque command or the question for all signals alone, ten times as fast; else nothing."""
        torque_nm = codec.decode_torque(data)
        if isnan(torque_nm) and data != codec.QUERY_ALONE:
            return b""
        parameters = self.parameters
        answer = codec.encode_reply(
            Reply(
                self.mode,
                self._value(Register.POSITION),
                self._value(Register.VELOCITY),
                self._measured_a(),
                parameters.temperature_c,
                parameters.bus_voltage_v,
                self.fault,
                self._setpoint_nm,
                parameters.temperature_c,
            )
        )
        if data != codec.QUERY_ALONE:
            self._follow(PURE_TORQUE | {Register.COMMAND_TORQUE: torque_nm}, now_s)
        return self._new_or_repeated(Reply, lambda: answer)

    def _execute(self, subframes: Iterable[Subframe], now_s: float) -> None:
        """Write the registers; the mode comes first, and all that a command does not write is at its default."""
        written: dict[int, float] = {}
        for each in subframes:
            if each.kind == registers.CONSOLE_INPUT:
                with suppress(ValueError):  # a value that is no number
                    self.console.write(each.text)
            elif each.kind == registers.WRITE:
                written |= {each.register + index: value for index, value in enumerate(each.values)}
        mode = written.pop(Register.MODE, None)
        if mode == Mode.STOPPED:
            self.mode, self.fault = Mode.STOPPED, 0
        elif mode == Mode.POSITION:
            self._follow({Register(each): value for each, value in written.items() if each in DEFAULTS}, now_s)
        elif mode in RUNNING and self.mode in RUNNING:
            self.mode = Mode(int(mode))
            self._q_current_a = written.get(Register.COMMAND_Q_CURRENT, 0.0)
            self._command = {**self._command, Register.KD_SCALE: written.get(Register.KD_SCALE, 1.0)}

    def _follow(self, written: Mapping[Register, float], now_s: float) -> None:
        """Enter position mode, or stay there; a fault or an expired watchdog ends with a stop only."""
        if self.mode not in RUNNING:
            return
        if self.mode is not Mode.POSITION:
            self._held_turns = self._angle
        self._command = {**DEFAULTS, **written}
        self.mode, self._fed_s = Mode.POSITION, now_s

    def _answer(self, subframe: Subframe) -> bytes:
        """Return the answer to one subframe: values for a read, text for a poll."""
        if subframe.kind == registers.CONSOLE_POLL:
            return registers.encode_console(registers.CONSOLE_OUTPUT, self.console.read(subframe.length))
        if subframe.kind != registers.READ:
            return b""
        asked = range(subframe.register, subframe.register + subframe.length)
        for register in asked:
            if register not in REGISTERS:
                return registers.encode_read_error(register)
        values = [self._value(register) for register in asked]
        return registers.encode_values(registers.REPLY, subframe.resolution, subframe.register, values)

    def _value(self, register: int) -> float:
        parameters = self.parameters
        match register:
            case Register.MODE:
                return float(self.mode)
            case Register.POSITION:
                return self._measured_angle()
            case Register.VELOCITY:
                return self._measured_speed() + 0.0  # without a negative zero
            case Register.TORQUE:
                return self._measured_a() * parameters.torque_constant_nm_a
            case Register.Q_CURRENT:
                return self._measured_a()
            case Register.MOTOR_TEMPERATURE | Register.BOARD_TEMPERATURE:
                return parameters.temperature_c
            case Register.VOLTAGE:
                return parameters.bus_voltage_v
            case Register.POWER:
                return parameters.bus_voltage_v * self.supply_a
            case Register.FAULT:
                return float(self.fault)
            case Register.CONTROL_TORQUE:
                return self._setpoint_nm
            case Register.FIRMWARE | Register.REGISTER_MAP:
                return float(FIRMWARE if register == Register.FIRMWARE else REGISTER_MAP)
        return self._serial_part(register - Register.SERIAL_NUMBER)

    def _serial_part(self, index: int) -> float:
        """Return one of the three words of the serial number; 0 for any other register."""
        if not 0 <= index < 3:
            return 0.0
        word = int(self.parameters.serial_number.rjust(24, "0")[8 * index : 8 * index + 8], 16)
        return float(word - (1 << 32) if word >> 31 else word)

    @property
    def energised(self) -> bool:
        return self.mode in (Mode.POSITION, Mode.CURRENT)

    @energised.setter
    def energised(self, energised: bool) -> None:
        self.mode = Mode.POSITION if energised else Mode.STOPPED

    @property
    def failed(self) -> bool:
        return self.mode in (Mode.FAULT, Mode.TIMEOUT)

    def trip(self, error: DriveError) -> None:
        if error is DriveError.WATCHDOG:
            self.mode, self._held_turns = Mode.TIMEOUT, self._angle
        else:
            self.mode, self.fault = Mode.FAULT, FAULTS[error]

    def forge(self, forgery: Forgery) -> Frame:
        return forged_frame(self.parameters.node_id, forgery)

    def forge_current(self, current_a: float) -> Frame:
        """The next answer reports this current; the frame itself, an empty answer, says nothing."""
        self._forged_a = current_a
        return answer_frame(self.parameters.node_id, registers.padded(b""))

    def forge_torque(self, torque_nm: float) -> Frame:
        """Ask for nothing: the answers would go to the other program, not to this one."""
        data = codec.encode_torque(self.parameters.sign * torque_nm).removesuffix(codec.QUERY)
        return command_frame(self.parameters.node_id, registers.padded(data))

    def _motor_nm(self, now_s: float) -> float:
        timeout_s = self._command[Register.WATCHDOG] or self.console.settings[WATCHDOG]  # of the last command
        if self.mode is Mode.POSITION and 0.0 < timeout_s < now_s - self._fed_s:
            self.trip(DriveError.WATCHDOG)
        motion = self._angle, self._speed, self._held_turns
        if self.mode is Mode.POSITION:
            torque_nm = position_mode_nm(self._command, *motion)
        elif self.mode is Mode.TIMEOUT:
            torque_nm = timeout_nm(self.console.settings[TIMEOUT_MODE], self._command[Register.KD_SCALE], *motion)
        elif self.mode is Mode.CURRENT:
            torque_nm = self._q_current_a * self.parameters.torque_constant_nm_a
        elif self.mode in DAMPING:
            torque_nm = timeout_nm(self.mode, self._command[Register.KD_SCALE], *motion)
        else:
            self._current_a = self._setpoint_nm = 0.0
            return 0.0
        parameters = self.parameters
        largest_a = min(self.console.settings[MAX_CURRENT], parameters.motor_current_limit_a)
        largest_nm = largest_a * parameters.torque_constant_nm_a
        torque_nm = -largest_nm if torque_nm < -largest_nm else largest_nm if torque_nm > largest_nm else torque_nm
        self._setpoint_nm = torque_nm
        if parameters.current_lag_s:
            torque_nm = self._lagged_nm(torque_nm, self._current_a * parameters.torque_constant_nm_a, now_s)
        self._current_a = torque_nm / parameters.torque_constant_nm_a
        return torque_nm
