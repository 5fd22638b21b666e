"""The bounds, the meaning and the unit of a configuration value, written next to its default.

`length_m: Annotated[float, Bounds(0.05, 0.5), Meaning("axis to plate")] = 0.1` states all of them in one place. They
are only stated here: the configuration reader of the firmware host enforces the bounds, so this layer needs no
validation library, and the reference of all keys is generated from the meanings.
"""

from typing import NamedTuple

UNIT_OF_SUFFIX = {  # of a field's name; the longest suffix that fits counts
    "_m": "m", "_m_s": "m/s", "_s": "s", "_hz": "Hz", "_deg": "°", "_rad": "rad", "_rad_s": "rad/s",
    "_n": "N", "_n_m": "N/m", "_n_s_m": "N·s/m", "_nm": "N·m", "_nm_a": "N·m/A",
    "_nm_rad": "N·m/rad", "_nm_s_rad": "N·m·s/rad", "_nm_s_turn": "N·m·s/turn",
    "_kg": "kg", "_kg_m2": "kg·m²", "_a": "A", "_v": "V", "_ohm": "Ω", "_c": "°C", "_k_w": "K/W",
    "_turn": "turn", "_turn_s": "turn/s", "_bytes": "bytes", "_kbit_s": "kbit/s", "_fraction": "1",
}  # fmt: skip


class Bounds(NamedTuple):
    """Inclusive, in the unit of the field that they belong to."""

    minimum: float
    maximum: float


class Meaning(NamedTuple):
    """What a field says, and its unit where the field's name does not end with one."""

    text: str
    unit: str = ""


def unit_of(name: str, meaning: Meaning) -> str:
    """Return a field's unit; empty for a field that is no number."""
    suffixes = [suffix for suffix in UNIT_OF_SUFFIX if name.endswith(suffix)]
    return meaning.unit or UNIT_OF_SUFFIX.get(max(suffixes, key=len, default=""), "")
