"""The fraction of a CAN bus that the drives on it will take, computed before anything was sent.

A data frame with an 11-bit identifier and n bytes is 47 + 8 n bits long, its three bits of rest included; stuffing adds
at most one bit in four of the 34 + 8 n that it covers. A 29-bit identifier has 20 bits more. In a CAN FD frame 29 bits,
or 48 with a 29-bit identifier, have the nominal rate, and 33 + 8 n the rate of the data, or 38 + 8 n with more than 16
bytes; stuffing covers the 17 or 36 bits before the change of rate and 5 + 8 n after it, and the fixed stuff bits of the
checksum are included (ISO 11898-1). The true load lies between none and the largest stuffing.
"""

from collections.abc import Iterable
from typing import NamedTuple

WARN_FRACTION, MOST_FRACTION = 0.6, 0.8  # beyond, frames of low priority come late, and then not at all


class FrameRate(NamedTuple):
    """A message of known length, sent at a known rate."""

    data_bytes: int
    rate_hz: float
    is_extended: bool = False
    is_fd: bool = False


class BitRates(NamedTuple):
    nominal_bit_s: float
    data_bit_s: float = 0.0  # of CAN FD; 0: the nominal rate


class BusLoad(NamedTuple):
    """Fractions of the bit rate."""

    least: float
    most: float

    def __str__(self) -> str:
        return f"{100.0 * self.least:.0f} to {100.0 * self.most:.0f} %"


def frame_bits(data_bytes: int, is_extended: bool = False) -> tuple[int, int]:
    """Return the number of bits of a CAN 2.0 frame without any stuffing, and with as much as there can be."""
    stuffed = 34 + 8 * data_bytes + 20 * is_extended
    least = stuffed + 13
    return least, least + (stuffed - 1) // 4


def frame_times_s(frame: FrameRate, rates: BitRates) -> tuple[float, float]:
    """Return how long a frame takes without any stuffing, and with as much as there can be."""
    if not frame.is_fd:
        least, most = frame_bits(frame.data_bytes, frame.is_extended)
        return least / rates.nominal_bit_s, most / rates.nominal_bit_s
    begin = 36 if frame.is_extended else 17
    stuffed = 5 + 8 * frame.data_bytes
    checksum = 28 if frame.data_bytes <= 16 else 33
    nominal_s, data_s = 1.0 / rates.nominal_bit_s, 1.0 / (rates.data_bit_s or rates.nominal_bit_s)
    least_s = (begin + 12) * nominal_s + (stuffed + checksum) * data_s
    return least_s, least_s + (begin - 1) // 4 * nominal_s + stuffed // 4 * data_s


def bus_load(messages: Iterable[FrameRate], rates: BitRates) -> BusLoad:
    least = most = 0.0
    for message in messages:
        shortest_s, longest_s = frame_times_s(message, rates)
        least += shortest_s * message.rate_hz
        most += longest_s * message.rate_hz
    return BusLoad(least, most)
