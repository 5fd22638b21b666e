"""What one Damiao reports of itself when its registers are read; a CubeMars has none that MIT mode can read.

Codes mean nothing without their ranges, so the registers PMAX, VMAX and TMAX must be those of the configured model: a
drive with another TMAX would exert another torque than was commanded, without any report. TIMEOUT is the watchdog, in
units of 50 µs. It is read last, so a known watchdog means that all is known.
"""

from collections.abc import Iterator, Mapping
from math import isfinite, nan
from struct import Struct

from control.records import NEVER_S
from drivers.mit import codec
from drivers.mit.parameters import MitParameters

TIMEOUT, CONTROL_MODE, SOFTWARE, SERIAL, PMAX, VMAX, TMAX = 9, 10, 14, 15, 21, 22, 23
REGISTERS = (SOFTWARE, SERIAL, CONTROL_MODE, PMAX, VMAX, TMAX, TIMEOUT)
UNDERVOLTAGE, TORQUE_CONSTANT, POLE_PAIRS, GEAR_RATIO = 0, 1, 16, 20
MAX_CURRENT, SUPPLY_V, DRIVE_C, ROTOR_C = 59, 60, 61, 62
FLOATS = frozenset(
    {UNDERVOLTAGE, TORQUE_CONSTANT, GEAR_RATIO, PMAX, VMAX, TMAX, MAX_CURRENT, SUPPLY_V, DRIVE_C, ROTOR_C}
)
FLOAT, WORD = Struct("<f"), Struct("<I")
TIMEOUT_UNIT_S = 50e-6
MIT_MODE = 1  # of CONTROL_MODE
REPEAT_UNKNOWN_S, REFRESH_S = 0.5, 2.0  # between two readings of unknown and of known settings
ANSWER_S = 0.1  # without an answer, after which reading begins again
SAME_FRACTION = 0.001  # of a range


def number_of(register: int, value: bytes) -> float:
    return float((FLOAT if register in FLOATS else WORD).unpack(value)[0])


class MitSettings:
    """Owns the registers of one drive that were read, and how far their reading has come."""

    def __init__(self, parameters: MitParameters) -> None:
        self._parameters = parameters
        self._readable = parameters.ranges.has_registers
        self.reset()

    def reset(self) -> None:
        self._begun_s = self._asked_s = NEVER_S
        self._next = len(REGISTERS)  # the index of the register that is asked for; their number: none
        self._waiting = False
        self.forget()

    def forget(self) -> None:
        self._values: dict[int, float] = {}

    @property
    def supported(self) -> bool:
        """Return whether the drive has said which firmware it has; a CubeMars cannot."""
        return SOFTWARE in self._values or not self._readable

    @property
    def firmware(self) -> str:
        return f"{self._values[SOFTWARE]:.0f}" if SOFTWARE in self._values else ""

    @property
    def serial_number(self) -> str:
        return f"{int(self._values[SERIAL]):08x}" if SERIAL in self._values else ""

    @property
    def watchdog_s(self) -> float:
        """The time-out: NaN until it was read back, 0 where the watchdog is off. That of a CubeMars may be proven."""
        if not self._readable:
            return self._parameters.proven_watchdog.watchdog_s or nan
        return self._values.get(TIMEOUT, nan) * TIMEOUT_UNIT_S

    @property
    def watchdog_advice(self) -> str:
        if not self._readable:
            return f"an {self._parameters.model} reports none in MIT mode; docs/how-to/mit.md: how to prove it once"
        return "the drive did not answer on id 0x7FF: check ESC_ID, MST_ID and its firmware"

    @property
    def problem(self) -> str:
        """Return why settings do not fit the configuration, with what was found and what to do; empty where they do."""
        return "; ".join(_problems(self._values, self._parameters))

    def due_request(self, now_s: float) -> bytes:
        """Return the payload of the next request; empty where nothing is due. It is called in every tick."""
        if not self._readable:
            return b""
        if self._next == len(REGISTERS) or self._waiting and now_s - self._asked_s > ANSWER_S:
            if now_s - self._begun_s < (REFRESH_S if isfinite(self.watchdog_s) else REPEAT_UNKNOWN_S):
                return b""
            self._begun_s, self._next, self._waiting = now_s, 0, False
        if self._waiting:
            return b""
        self._asked_s, self._waiting = now_s, True
        return codec.encode_read(self._parameters.node_id, REGISTERS[self._next])

    def on_register(self, register: int, value: bytes) -> None:
        """Handle an answer, also one that was not asked for. A drive without a firmware version is only starting."""
        number = number_of(register, value)
        if register == SOFTWARE and not number:
            self.forget()
            return
        self._values[register] = number
        if self._next < len(REGISTERS) and register == REGISTERS[self._next]:
            self._next, self._waiting = self._next + 1, False


def _problems(values: Mapping[int, float], drive: MitParameters) -> Iterator[str]:
    ranges = drive.ranges
    model_key = f"model = {drive.model!r}"
    own_range = drive.velocity_range_rad_s > 0.0
    velocity_key = f"velocity_range_rad_s = {drive.velocity_range_rad_s:g}" if own_range else model_key
    torque_key = f"torque_range_nm = {drive.torque_range_nm:g}" if drive.torque_range_nm else model_key
    for register, name, expected, key in (
        (PMAX, "PMAX", ranges.position_rad, model_key),
        (VMAX, "VMAX", ranges.velocity_rad_s, velocity_key),
        (TMAX, "TMAX", ranges.torque_nm, torque_key),
    ):
        if register in values and not abs(values[register] - expected) <= SAME_FRACTION * expected:
            found = f"{name} (register {register}) is {values[register]:g} and that of {key} is {expected:g}"
            yield f"{found}: correct the key, or set the register"
    if CONTROL_MODE in values and values[CONTROL_MODE] != MIT_MODE:
        yield f"CTRL_MODE (register {CONTROL_MODE}) is {values[CONTROL_MODE]:g}: set 1, MIT mode"
