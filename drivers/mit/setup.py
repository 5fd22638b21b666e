"""Reads, writes and stores the registers of one Damiao over CAN. A CubeMars has none that MIT mode can read or write,
and those of a RobStride are left to its makers' tool.

The answers come under the id MST_ID, which may be any, so an answer is known by what it contains: the drive's own id,
the kind, the register. Storing (0xAA) is acknowledged; that it lasts shows only after the supply was switched off and
on. Source: damiao-motor 1.0.6 (REGISTER_TABLE and store_parameters of core/motor.py).
"""

from collections.abc import Mapping, Sequence

from drivers.bench.bench_port import NoAnswerError
from drivers.bench.drive_setup import WATCHDOG_S, AskedSetup, FoundDrive, Setting, encoded, exactly
from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.models import MODELS
from drivers.mit.parameters import LARGEST_ID, MitParameters
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
    number_of,
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
STORING_S = 2.0
GUIDE = "docs/how-to/mit.md"
NOTHING = "in MIT mode it can be neither read nor written: use the makers' tool, and see docs/how-to/mit.md"


def node_of(frame: Frame) -> int:
    return frame.data[0] & LARGEST_ID if frame.data else 0


def is_answer(frame: Frame, node_id: int) -> bool:
    """Drives answer under their own id, that plus 16 as the set-up page says, or 0 or a RobStride's master's."""
    known = frame.is_plain and len(frame.data) == codec.ANSWER_BYTES and node_of(frame) == node_id
    return known and frame.arbitration_id in (0, node_id, node_id + 16, codec.ROBSTRIDE_MASTER)


def is_register(frame: Frame, node_id: int) -> bool:
    return codec.is_register_answer(frame.data, node_id)


def models_of(values: Mapping[int, float]) -> list[str]:
    """Return the models with registers that are delivered with these ranges."""
    found = [values.get(register, 0.0) for register in (PMAX, VMAX, TMAX)]
    return [
        name
        for name, model in MODELS.items()
        if model.has_registers
        and all(
            abs(each - expected) <= SAME_FRACTION * expected for each, expected in zip(found, model[:3], strict=True)
        )
    ]


class DamiaoSetup(AskedSetup):
    stored = "it has acknowledged the storing; switch its supply off and on, and compare again"

    _parameters: MitParameters

    def identify(self) -> FoundDrive:
        values = {register: self._read(register, "its identity") for register in (SOFTWARE, SERIAL, PMAX, VMAX, TMAX)}
        models = " or ".join(models_of(values))
        return FoundDrive(
            type="mit",
            node_id=self._parameters.node_id,
            hardware=models,
            firmware=f"{values[SOFTWARE]:.0f}",
            serial_number=f"{int(values[SERIAL]):08x}",
        )

    def activity(self) -> str:
        """Ask for the state; old firmware by the command to leave the mode, which also ends its torque."""
        try:
            answer = self._ask_state(codec.state_request(self._parameters.node_id))
        except NoAnswerError:
            answer = self._ask_state(Frame(self._parameters.node_id, codec.LEAVE))
        status = answer.data[0] >> 4
        return "" if status == codec.DISABLED else f"status {status:X}"

    def _ask_state(self, question: Frame) -> Frame:
        node_id = self._parameters.node_id
        return self._port.ask(
            question,
            lambda frame: is_answer(frame, node_id) and not is_register(frame, node_id),
            "the request of its state and the command to leave the mode",
        )

    def settings(self) -> Sequence[Setting]:
        drive, longest_s = self._parameters, self._longest_watchdog_s
        ranges, torque_key = drive.ranges, "torque_range_nm" if drive.torque_range_nm else "model"
        velocity_key = "velocity_range_rad_s" if drive.velocity_range_rad_s > 0.0 else "model"
        return (
            exactly("ESC_ID", drive.node_id, "node_id", "it answers under this id"),
            exactly("MST_ID", drive.node_id + 16, GUIDE),
            exactly("CTRL_MODE", MIT_MODE, GUIDE),
            exactly("PMAX", ranges.position_rad, "model", fraction=SAME_FRACTION),
            exactly("VMAX", ranges.velocity_rad_s, velocity_key, fraction=SAME_FRACTION),
            exactly("TMAX", ranges.torque_nm, torque_key, fraction=SAME_FRACTION),
            Setting(
                key="TIMEOUT",
                wanted=round(min(WATCHDOG_S, longest_s) / TIMEOUT_UNIT_S),
                least=1.0,
                most=round(longest_s / TIMEOUT_UNIT_S),
                source="faults.longest_watchdog_s, in 50 µs",
            ),
        )

    def read(self, key: str) -> float:
        return self._read(NAMES[key], key)

    def _read(self, register: int, what: str) -> float:
        answer = self._ask(codec.READ, register, bytes(4), what)
        return number_of(register, codec.decode_register(answer.data)[3])

    def write(self, key: str, value: float) -> None:
        register = NAMES[key]
        data = encoded(FLOAT if register in FLOATS else WORD, key, value)
        self._ask(codec.WRITE, register, data, f"the writing of {key}")

    def save(self) -> None:
        self._ask(codec.STORE, 1, bytes(4), "the command to store", STORING_S)

    def _ask(self, kind: int, register: int, value: bytes, what: str, longest_s: float = 0.3) -> Frame:
        node_id = self._parameters.node_id
        head = codec.encode_register(node_id, kind, register, value)[:4]
        question = Frame(codec.REGISTER_ID, head + value)
        size = codec.ANSWER_BYTES
        return self._port.ask(
            question,
            lambda frame: frame.is_plain and len(frame.data) == size and frame.data.startswith(head),
            what,
            longest_s,
        )
