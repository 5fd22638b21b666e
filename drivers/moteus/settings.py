"""What one moteus reports of itself when it is asked: its firmware, its serial number, and its configured settings.

Firmware and serial number are registers. The settings are read from the drive's console, as text: `conf get` writes the
value of one setting, and polls of the console's output return it. They must agree with this program's configuration:
a drive with a smaller current limit would clamp torque without reporting it, and one with another torque constant would
exert another torque than its current says. The watchdog is read last, so a known watchdog means that all is known.
"""

from collections.abc import Iterator, Mapping
from math import isfinite, nan

from control.records import NEVER_S
from drivers.drive import DriveParameters
from drivers.moteus import registers
from drivers.moteus.registers import Register, Resolution

REGISTER_MAP = 5  # the version of the registers whose meaning the codec knows
IDENTITY = registers.padded(
    registers.encode_read(Resolution.INT32, Register.MODEL, 3)
    + registers.encode_read(Resolution.INT32, Register.SERIAL_NUMBER, 3)
)
MOST_CONSOLE_BYTES = 48  # of one answer
POLL = registers.padded(registers.encode_console_poll(MOST_CONSOLE_BYTES))
MAX_CURRENT, KV, RATIO = "servo.max_current_A", "motor.Kv", "motor_position.rotor_to_output_ratio"
TIMEOUT_MODE, WATCHDOG = "servo.timeout_mode", "servo.default_timeout_s"
KEYS = (MAX_CURRENT, KV, RATIO, TIMEOUT_MODE, WATCHDOG)
REPEAT_UNKNOWN_S, REFRESH_S = 0.5, 2.0  # between two readings of unknown and of known settings
ANSWER_S = 0.1  # without the rest of an answer, after which reading begins again
LONGEST_LINE = 200
TORQUE_FACTOR = 8.27  # N·m/A of a motor of 1 rpm/V: 3/2 · 1/√3 · 60 / 2π, for the amplitude of the phase current
SAME_FRACTION = 0.01  # of a current limit
SAME_TORQUE_FRACTION = 0.05  # of a torque constant
HOLDS_POSITION = 10  # the timeout mode in which a drive holds its position with up to its whole current


def encode_question(key: str) -> bytes:
    """Ask for one setting, and for as much of the answer as there is already."""
    text = registers.encode_console(registers.CONSOLE_INPUT, f"conf get {key}\n".encode())
    return registers.padded(text + registers.encode_console_poll(MOST_CONSOLE_BYTES))


QUESTIONS = tuple(map(encode_question, KEYS))


class MoteusSettings:
    """Owns the answers of one drive, and how far their reading has come."""

    def __init__(self, parameters: DriveParameters) -> None:
        self._parameters = parameters
        self._answered_s = NEVER_S
        self.reset()

    def reset(self) -> None:
        self._identity_s = self._read_s = NEVER_S  # when they were asked for last
        self.forget()

    def forget(self) -> None:
        self.firmware = self.serial_number = ""
        self._register_map = 0
        self._values: dict[str, float] = {}
        self._stop_reading()

    def _stop_reading(self) -> None:
        self._reading = False
        self._asked = -1  # the index of the setting that was asked for; -1: none, older output is read first
        self._next = POLL  # the next request of this reading
        self._line = b""

    @property
    def supported(self) -> bool:
        return self._register_map == REGISTER_MAP

    @property
    def watchdog_s(self) -> float:
        """The time-out that the drive uses: NaN until it was read back, 0 where the watchdog is off."""
        timeout_s = self._values.get(WATCHDOG)
        if timeout_s is None:
            return nan
        return timeout_s if isfinite(timeout_s) else 0.0

    @property
    def problem(self) -> str:
        """Return why settings do not fit the configuration, with what was found and what to do; empty where they do."""
        return "; ".join(_problems(self._values, self._parameters))

    def due_request(self, now_s: float) -> bytes:
        """Return the payload of the next request; empty where nothing is due. It is called in every tick."""
        if now_s - self._identity_s >= (REFRESH_S if self.firmware else REPEAT_UNKNOWN_S):
            self._identity_s = now_s
            return IDENTITY
        if self._reading:
            if now_s - self._answered_s < ANSWER_S:
                request, self._next = self._next, POLL
                return request
            self._stop_reading()
        if now_s - self._read_s < (REFRESH_S if isfinite(self.watchdog_s) else REPEAT_UNKNOWN_S):
            return b""
        self._read_s = self._answered_s = now_s
        self._reading = True
        return POLL

    def on_registers(self, values: Mapping[int, float]) -> None:
        if Register.REGISTER_MAP in values:
            self._register_map = int(values[Register.REGISTER_MAP])
            version = int(values.get(Register.FIRMWARE, 0))
            self.firmware = f"{version >> 16 & 0xFF}.{version >> 8 & 0xFF}.{version & 0xFF}"
        parts = [values.get(Register.SERIAL_NUMBER + index) for index in range(3)]
        if None not in parts:
            self.serial_number = "".join(f"{int(part or 0) & 0xFFFFFFFF:08x}" for part in parts)

    def on_console(self, text: bytes, now_s: float) -> None:
        """Handle the output of the console, of which an answer is one line."""
        if not self._reading:
            return
        if text:
            self._answered_s = now_s
        if self._asked < 0:
            if not text:
                self._ask(0)
            return
        self._line = (self._line + text)[-LONGEST_LINE:]
        line, end, _ = self._line.partition(b"\n")
        if end:
            self._values[KEYS[self._asked]] = _number(line)
            self._ask(self._asked + 1)

    def _ask(self, index: int) -> None:
        if index == len(KEYS):
            self._stop_reading()
        else:
            self._asked, self._next, self._line = index, QUESTIONS[index], b""


def _number(line: bytes) -> float:
    """Return NaN also for an error text, which fits no setting and, as a watchdog, is none."""
    try:
        return float(line)
    except ValueError:
        return nan


def _problems(values: Mapping[str, float], drive: DriveParameters) -> Iterator[str]:
    limit_a, constant_nm_a = drive.current_limit_a, drive.torque_constant_nm_a
    if MAX_CURRENT in values and not abs(values[MAX_CURRENT] - limit_a) <= SAME_FRACTION * limit_a:
        yield f"{MAX_CURRENT} is {values[MAX_CURRENT]:g} and current_limit_a = {limit_a:g}: make them equal"
    if KV in values:
        found_nm_a = TORQUE_FACTOR / values[KV] if values[KV] else nan
        if not abs(found_nm_a - constant_nm_a) <= SAME_TORQUE_FRACTION * constant_nm_a:
            found = f"{KV} is {values[KV]:g}, so the drive uses {found_nm_a:.4g} N·m/A"
            yield f"{found}, and torque_constant_nm_a = {constant_nm_a:g}: make them equal, or calibrate the drive"
    if RATIO in values and values[RATIO] != 1.0:
        yield f"{RATIO} is {values[RATIO]:g}: must be 1 for a motor that drives its joint directly"
    if values.get(TIMEOUT_MODE) == HOLDS_POSITION:
        yield f"{TIMEOUT_MODE} is 10, which holds the position with the whole current: set 15, 12 or 0"
