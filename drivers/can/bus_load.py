"""The fraction of a CAN bus that the drives on it will take, computed before anything was sent.

A data frame with an 11-bit identifier and n bytes is 47 + 8 n bits long, its three bits of rest included; stuffing adds
at most one bit in four of the 34 + 8 n that it covers (ISO 11898-1). The true load lies between.
"""

from collections.abc import Iterable
from typing import NamedTuple

WARN_FRACTION, MOST_FRACTION = 0.6, 0.8  # beyond, frames of low priority come late, and then not at all


class FrameRate(NamedTuple):
    """A message of known length, sent at a known rate."""

    data_bytes: int
    rate_hz: float


class BusLoad(NamedTuple):
    """Fractions of the bit rate."""

    least: float
    most: float

    def __str__(self) -> str:
        return f"{100.0 * self.least:.0f} to {100.0 * self.most:.0f} %"


def frame_bits(data_bytes: int) -> tuple[int, int]:
    """Returns the number of bits without any stuffing, and with as much as there can be."""
    stuffed = 34 + 8 * data_bytes
    least = stuffed + 13
    return least, least + (stuffed - 1) // 4


def bus_load(messages: Iterable[FrameRate], bit_rate_bit_s: float) -> BusLoad:
    least = most = 0.0
    for message in messages:
        shortest, longest = frame_bits(message.data_bytes)
        least += shortest * message.rate_hz
        most += longest * message.rate_hz
    return BusLoad(least / bit_rate_bit_s, most / bit_rate_bit_s)
