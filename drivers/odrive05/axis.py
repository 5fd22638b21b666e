"""One ODrive with firmware 0.5.6 as one joint: its errors, its counts before it has moved, its watchdog.

Until the drive has been in closed loop once since its supply came, it reports a position and a velocity of exactly
zero. In an idle drive such zeros count as absent, and the program asks for the counts of the encoder in every tick. An
idle drive repeats the last current that was measured. So a current with the same bits as the one before counts as zero,
and the set-point in its message as absent, also before a heartbeat says that the drive is idle. Its currents have the
sign of the motor's phases, which `encoder_direction` turns into that of position and torque.

The watchdog cannot be read over CAN: watchdog_proof.py proves it, and the position waits for that. A drive with an
error proves nothing until the error is cleared, which a robot that knows no position refuses: its position does not
wait. The watchdog also expires in an idle drive while no program runs. That is no error of the drive: it is reported as
one only if torque was on, and is cleared before closed loop. Sources: can_simple.cpp, axis.cpp, controller.cpp,
motor.cpp and foc.cpp of odriverobotics/ODrive, tag fw-v0.5.6.
"""

from collections.abc import Callable, Mapping

from control.records import NEVER_S, UNKNOWN
from drivers.can.frames import Frame
from drivers.drive import DriveHealth, Outlet
from drivers.odrive.cansimple_axis import RESTART_SILENCE_S, CanSimpleAxis
from drivers.odrive.codec import GET_ENCODER_ESTIMATES, GET_VERSION, AxisState, Message, arbitration_id
from drivers.odrive.settings import DriveSettings
from drivers.odrive05 import codec
from drivers.odrive05.parameters import Odrive05Parameters
from drivers.odrive05.watchdog_proof import WatchdogProof

FIRMWARE = "0.5"
ABSENT = bytes(8)  # position and velocity of a drive that has not been in closed loop
NO_SETPOINT = bytes(4)  # as a drive with firmware 0.6 reports as soon as it is idle
SAME_TURNS = 0.05  # by which counts and position may differ, in a joint that is moved by hand
JUMP_TURNS = 0.04  # in one tick: 95 rad/s
LONGEST_GAP_S = 0.03  # between two counts, whose difference is the velocity: one count in one tick is some 0.3 rad/s


class Odrive05Axis(CanSimpleAxis):
    COMMANDS = codec.COMMANDS
    CLEAR_ERRORS = codec.CLEAR_ERRORS.encode()
    parameters: Odrive05Parameters

    def __init__(self, joint: str, parameters: Odrive05Parameters, outlet: Outlet) -> None:
        self._proof = WatchdogProof(parameters.watchdog_s, parameters.heartbeat_period_s)
        self._version_request = Frame(arbitration_id(parameters.node_id, GET_VERSION), is_remote=True)
        self._counts_request = Frame(arbitration_id(parameters.node_id, codec.GET_ENCODER_COUNT), is_remote=True)
        super().__init__(joint, parameters, outlet, DriveSettings())

    def reset(self) -> None:
        self._part_errors = [0, 0, 0]  # of motor, encoder and controller
        self._following = False  # commanded by this program
        self._expired_idle = self._expired = False
        self._absent = False  # position and velocity
        self._turns, self._counted_s = UNKNOWN, NEVER_S  # by the newest counts
        self._idle_data = b""  # of the current
        self._measured_data = b""  # of the newest current
        self._version_answered = False
        self._proof.reset()
        super().reset()
        self._forget_counts()

    def _forget_counts(self) -> None:
        self._counts_known = False
        self._counts_problem = ""

    @property
    def _reports(self) -> Mapping[Message, Callable[[bytes, float], None]]:
        return {
            **super()._reports,
            codec.HEARTBEAT: self._receive_heartbeat,
            codec.GET_ENCODER_COUNT: self._receive_counts,
            codec.GET_MOTOR_ERROR: lambda data, now_s: self._receive_part(0, codec.GET_MOTOR_ERROR, data),
            codec.GET_ENCODER_ERROR: lambda data, now_s: self._receive_part(1, codec.GET_ENCODER_ERROR, data),
            codec.GET_CONTROLLER_ERROR: lambda data, now_s: self._receive_part(2, codec.GET_CONTROLLER_ERROR, data),
        }

    def _receive_heartbeat(self, data: bytes, now_s: float) -> None:
        error, state, motor, encoder, controller = codec.HEARTBEAT.decode(data)
        flags = codec.axis_flags(error, motor, encoder, controller)
        expired = bool(flags & codec.ERROR_WATCHDOG)
        if expired and not self._expired:
            self._expired_idle = not self.closed_loop and not self._following
        self._expired = expired
        self._error_flags = flags & ~codec.ERROR_WATCHDOG if self._expired_idle else flags
        if self.closed_loop and state != AxisState.CLOSED_LOOP:
            self._following, self._current_a, self._idle_data = False, 0.0, b""
        self._receive_state(state, False, now_s)
        self._health = None
        fit = state == AxisState.IDLE and not self._error_flags and not self._following
        self._proof.on_heartbeat(expired, fit, self._read_s, self._read_before_s)

    def _receive_version(self, data: bytes, now_s: float) -> None:
        self._version_answered = True
        super()._receive_version(data, now_s)

    def _receive_part(self, part: int, message: Message, data: bytes) -> None:
        (flags,) = message.decode(data)
        if flags != self._part_errors[part]:
            self._part_errors[part] = flags
            self._health = None

    def _receive_encoder(self, data: bytes, now_s: float) -> None:
        if now_s - self._angle_stamp_s > RESTART_SILENCE_S:
            self._on_silence()  # first: the zeros of a drive that has restarted are no position
        if self.closed_loop or data != ABSENT:
            self._absent = False
            super()._receive_encoder(data, now_s)
        else:
            self._absent = True

    def _receive_counts(self, data: bytes, now_s: float) -> None:
        count, _ = codec.GET_ENCODER_COUNT.decode(data)
        turns = count / self.parameters.encoder_counts
        if not self._counts_known:
            self._counts_known, self._health = True, None
        uses_counts = self._absent and (self._proof.concluded or self._error_flags)
        if uses_counts:
            turns_s = self._turns_s(turns - self._turns, now_s - self._counted_s)
            super()._receive_encoder(GET_ENCODER_ESTIMATES.encode(turns, turns_s), now_s)
        if uses_counts or not self._absent:
            self._compare_counts(count, turns)
        self._turns, self._counted_s = turns, now_s

    def _turns_s(self, moved_turns: float, elapsed_s: float) -> float:
        """Return the velocity between two positions; zero after a gap, and after a jump that no joint can make."""
        if not 0.0 < elapsed_s < LONGEST_GAP_S or abs(moved_turns) > JUMP_TURNS:
            return 0.0
        return moved_turns / elapsed_s

    def _compare_counts(self, count: int, turns: float) -> None:
        reported = self._angle_rad / self._rad_per_turn + self.parameters.zero_turn
        problem = ""
        if abs(turns - reported) > SAME_TURNS:  # not where no position is known
            counts = self.parameters.encoder_counts
            problem = f"it counted {count} in {reported:.3f} turns; encoder_counts = {counts} must be the drive's"
        if problem != self._counts_problem:
            self._counts_problem, self._health = problem, None

    def _receive_current(self, data: bytes, now_s: float) -> None:
        """Ignore the set-point next to a current with the same bits as the one before: only an idle drive sends it."""
        repeated, self._measured_data = data[4:] == self._measured_data, data[4:]
        super()._receive_current(NO_SETPOINT + data[4:] if repeated and self.closed_loop else data, now_s)

    def _idle_current_a(self, data: bytes, measured_a: float) -> float:
        """Return the current of an idle drive: none, unless it differs from the one that was reported before."""
        repeated, self._idle_data = self._idle_data in (b"", data[4:]), data[4:]
        return 0.0 if repeated else super()._idle_current_a(data, measured_a)

    def _on_restart(self) -> None:
        super()._on_restart()
        self.closed_loop = False  # what the last heartbeat said is over
        self._proof.reset()
        self._forget_counts()
        self._following = False

    def _build_health(self) -> DriveHealth:
        settings = self.settings  # which know a version of firmware 0.6 only
        errors = codec.errors_text(self._error_flags, *self._part_errors)
        common = super()._build_health()
        return common._replace(
            firmware=settings.firmware or (FIRMWARE if self._counts_known else ""),
            supported_firmware=FIRMWARE,
            firmware_supported=self._counts_known and settings.version is None,
            watchdog_s=self._proof.watchdog_s,
            watchdog_advice="clear the drive's errors, let no other program send to it, and wait for a second",
            power_cut=bool(self._error_flags & codec.ERROR_ESTOP),
            watchdog_expired=bool(self._error_flags & codec.ERROR_WATCHDOG),
            setting_problem=self._counts_problem,
            active_errors=errors,
            errors=errors,
        )

    def send_torque(self, torque_nm: float) -> None:
        if self.closed_loop or torque_nm != 0.0:
            super().send_torque(torque_nm)
        elif not self._proof.silent:
            super().send_torque(torque_nm)
            self._ask()

    def poll(self) -> None:
        """Ask an idle drive for its counts while it reports no position, or another one, or its watchdog is not proven.

        A drive with firmware 0.6 has none, and reports its version.
        """
        if not self.closed_loop and not self._proof.silent and self._heartbeat_stamp_s > NEVER_S:
            self._ask()
            self.request_settings(self._read_s)

    def _ask(self) -> None:
        if self._proof.must_clear:
            self._proof.begin_again()
            super().clear_errors()
        if self._absent or self._counts_problem or not self._proof.concluded:
            self._outlet.send(self._counts_request)

    def prepare(self) -> None:
        """Also clears what expired while the drive was idle, which would end closed loop at once."""
        self._following = True
        self._proof.begin_again()
        if self._expired_idle and self._expired:
            super().clear_errors()
        super().prepare()

    def disarm(self) -> None:
        self._following = False
        self._proof.begin_again()
        super().disarm()

    def clear_errors(self) -> None:
        """Also tries the watchdog again, if it did not expire."""
        self._following = False
        self._proof.begin_again()
        if not self._proof.watchdog_s:
            self._proof.reset()
            self._health = None
        super().clear_errors()

    def request_supply(self) -> None:
        if not self._proof.silent:
            super().request_supply()

    def request_settings(self, now_s: float) -> None:
        """Ask for the version, which only firmware 0.6 has, and for the counts, which only firmware 0.5 has.

        What else a drive of a known version is asked for would set a new node id in firmware 0.5. A version that is
        not repeated when it is asked for again was a garbled frame.
        """
        if self._proof.silent:
            return
        if self._version_request in self.settings.due_requests(self.parameters.node_id, now_s):
            if self.settings.version and not self._version_answered:
                self.settings.forget()
                self._health = None
            self._version_answered = False
            self._outlet.send(self._version_request)
            self._outlet.send(self._counts_request)
