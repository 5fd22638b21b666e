"""The answers by which a drive in MIT mode is recognised: its own id in the first byte, and the ranges of a Damiao."""

from collections.abc import Mapping
from struct import Struct

from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.models import MODELS
from drivers.mit.parameters import LARGEST_ID
from drivers.mit.settings import FLOAT, FLOATS, PMAX, SAME_FRACTION, TMAX, VMAX, WORD


def number_of(register: int, value: bytes) -> float:
    layout: Struct = FLOAT if register in FLOATS else WORD
    return float(layout.unpack(value)[0])


def node_of(frame: Frame) -> int:
    return frame.data[0] & LARGEST_ID if frame.data else 0


def is_answer(frame: Frame, node_id: int) -> bool:
    """Drives answer under their own id, under that plus 16 as the set-up page says, or under 0 as delivered."""
    known = frame.is_plain and len(frame.data) == codec.ANSWER_BYTES and node_of(frame) == node_id
    return known and frame.arbitration_id in (0, node_id, node_id + 16)


def is_register(frame: Frame, node_id: int) -> bool:
    return codec.is_register_answer(frame.data, node_id)


def models_of(values: Mapping[int, float]) -> list[str]:
    """Returns the models with registers that are delivered with these ranges."""
    found = [values.get(register, 0.0) for register in (PMAX, VMAX, TMAX)]
    return [
        name
        for name, model in MODELS.items()
        if model.has_registers
        and all(
            abs(each - expected) <= SAME_FRACTION * expected for each, expected in zip(found, model[:3], strict=True)
        )
    ]
