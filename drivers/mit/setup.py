"""Reads, writes and stores the registers of one Damiao over CAN. A CubeMars has none that MIT mode can read or write.

The answers come under the id MST_ID, which may be any, so an answer is known by what it contains: the drive's own id,
the kind, the register. Storing (0xAA) is acknowledged; that it lasts shows only after the supply was switched off and
on. Source: damiao-motor 1.0.6 (REGISTER_TABLE and store_parameters of core/motor.py).
"""

from collections.abc import Sequence

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_setup import Setting, exactly
from drivers.bench.found_drive import FoundDrive
from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.identity import is_answer, is_register, models_of, number_of
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import (
    CONTROL_MODE,
    FLOAT,
    FLOATS,
    MIT_MODE,
    PMAX,
    SAME_FRACTION,
    SERIAL,
    SOFTWARE,
    TIMEOUT,
    TIMEOUT_UNIT_S,
    TMAX,
    VMAX,
    WORD,
)

MST_ID, ESC_ID = 7, 8
NAMES = {
    "ESC_ID": ESC_ID,
    "MST_ID": MST_ID,
    "CTRL_MODE": CONTROL_MODE,
    "TIMEOUT": TIMEOUT,
    "PMAX": PMAX,
    "VMAX": VMAX,
    "TMAX": TMAX,
}
WATCHDOG_S = 0.1
STORING_S = 2.0
GUIDE = "docs/how-to/mit.md"
NOTHING = "in MIT mode it can be neither read nor written: use the makers' tool, and see docs/how-to/mit.md"


def wanted_settings(drive: MitParameters, longest_watchdog_s: float) -> Sequence[Setting]:
    ranges, units = drive.ranges, 1.0 / TIMEOUT_UNIT_S
    torque_key = "torque_range_nm" if drive.torque_range_nm else "model"
    watchdog = round(min(WATCHDOG_S, longest_watchdog_s) * units)
    return (
        exactly("ESC_ID", drive.node_id, "node_id", "it answers under this id"),
        exactly("MST_ID", drive.node_id + 16, GUIDE),
        exactly("CTRL_MODE", MIT_MODE, GUIDE),
        exactly("PMAX", ranges.position_rad, "model", fraction=SAME_FRACTION),
        exactly("VMAX", ranges.velocity_rad_s, "model", fraction=SAME_FRACTION),
        exactly("TMAX", ranges.torque_nm, torque_key, fraction=SAME_FRACTION),
        Setting("TIMEOUT", watchdog, 1.0, round(longest_watchdog_s * units), "faults.longest_watchdog_s, in 50 µs"),
    )


class DamiaoSetup:
    """Implements DriveSetup."""

    cannot = ""
    stored = "it has acknowledged the storing; switch its supply off and on, and compare again"

    def __init__(self, port: BenchPort, parameters: MitParameters, longest_watchdog_s: float) -> None:
        self._port = port
        self._parameters = parameters
        self._longest_watchdog_s = longest_watchdog_s

    def identify(self) -> FoundDrive:
        values = {register: self._read(register, "its identity") for register in (SOFTWARE, SERIAL, PMAX, VMAX, TMAX)}
        models = " or ".join(models_of(values))
        return FoundDrive(
            "mit", self._parameters.node_id, models, f"{values[SOFTWARE]:.0f}", f"{int(values[SERIAL]):08x}"
        )

    def activity(self) -> str:
        """Asks by the command to leave the mode, the only question there is: it also ends the drive's torque."""
        node_id = self._parameters.node_id
        answer = self._port.ask(
            Frame(node_id, codec.LEAVE),
            lambda frame: is_answer(frame, node_id) and not is_register(frame, node_id),
            "the command to leave the mode",
        )
        status = answer.data[0] >> 4
        return "" if status == codec.DISABLED else f"status {status:X}"

    def settings(self) -> Sequence[Setting]:
        return wanted_settings(self._parameters, self._longest_watchdog_s)

    def read(self, key: str) -> float:
        return self._read(NAMES[key], key)

    def _read(self, register: int, what: str) -> float:
        answer = self._ask(codec.READ, register, bytes(4), what)
        return number_of(register, codec.decode_register(answer.data)[3])

    def write(self, key: str, value: float) -> None:
        register = NAMES[key]
        data = FLOAT.pack(value) if register in FLOATS else WORD.pack(round(value))
        self._ask(codec.WRITE, register, data, f"the writing of {key}")

    def save(self) -> None:
        self._ask(codec.STORE, 1, bytes(4), "the command to store", STORING_S)

    def _ask(self, kind: int, register: int, value: bytes, what: str, longest_s: float = 0.3) -> Frame:
        node_id = self._parameters.node_id
        head = codec.encode_register(node_id, kind, register, value)[:4]
        question = Frame(codec.REGISTER_ID, head + value)
        return self._port.ask(question, lambda frame: _begins(frame, head), what, longest_s)


def _begins(frame: Frame, head: bytes) -> bool:
    return frame.is_plain and len(frame.data) == codec.ANSWER_BYTES and frame.data[: len(head)] == head
