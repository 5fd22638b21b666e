"""What share of a CAN bus the drives on it will take, before anything was sent.

A data frame with an 11-bit identifier and n bytes is 47 + 8 n bits long, its three bits of rest included; stuffing adds
at most one bit in four of the 34 + 8 n that it covers (ISO 11898-1). The true load lies between. Rates are those that
docs/how-to/odrive.md sets on every drive, and one torque command a tick.
"""

from __future__ import annotations

from typing import NamedTuple

from drivers.odrive import codec

COMMAND_HZ = 380.0
FAST_HZ, SLOW_HZ = 500.0, 10.0  # cyclic messages every 2 and every 100 ms
TORQUE_BYTES = len(codec.SET_INPUT_TORQUE.encode(0.0))
TELEGRAM_BYTES = 8  # of everything that an ODrive tells
MESSAGES_OF_A_DRIVE = (  # bytes and how often
    (TORQUE_BYTES, COMMAND_HZ),
    (TELEGRAM_BYTES, FAST_HZ),  # encoder
    (TELEGRAM_BYTES, FAST_HZ),  # current
    *((TELEGRAM_BYTES, SLOW_HZ),) * 4,  # heartbeat, errors, temperature, voltage
)
WARN_FRACTION, MOST_FRACTION = 0.6, 0.8  # beyond, frames of low priority come late, and then not at all


class BusLoad(NamedTuple):
    """As shares of the bit rate."""

    least: float
    most: float

    def __str__(self) -> str:
        return f"{100.0 * self.least:.0f} to {100.0 * self.most:.0f} %"


def frame_bits(data_bytes: int) -> tuple[int, int]:
    """Without any stuffing, and with as much as there can be."""
    stuffed = 34 + 8 * data_bytes
    least = stuffed + 13
    return least, least + (stuffed - 1) // 4


def bus_load(drives: int, bit_rate_bit_s: float) -> BusLoad:
    least = most = 0.0
    for data_bytes, rate_hz in MESSAGES_OF_A_DRIVE:
        shortest, longest = frame_bits(data_bytes)
        least += shortest * rate_hz
        most += longest * rate_hz
    return BusLoad(drives * least / bit_rate_bit_s, drives * most / bit_rate_bit_s)
