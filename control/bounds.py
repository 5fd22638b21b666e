"""The bounds of a configuration value, written beside its default: `length_m: Annotated[float, Bounds(0.05, 0.5)]`.

They are only stated here. The configuration reader of the firmware host enforces them, so this layer needs no
validation library.
"""

from typing import NamedTuple


class Bounds(NamedTuple):
    """Inclusive, in the unit of the field that they belong to."""

    minimum: float
    maximum: float
