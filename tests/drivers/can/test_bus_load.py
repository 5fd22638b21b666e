"""The load of a bus, against frames that are laid out and stuffed bit by bit."""

from __future__ import annotations

import random

import pytest

from drivers.can.bus_load import BusLoad, frame_bits
from drivers.can.bus_load import bus_load as load_of
from drivers.drive import DriveParameters
from drivers.drive_types import traffic_of

CRC15 = 0x4599  # of ISO 11898-1


def bus_load(drives: int, bit_rate_bit_s: float) -> BusLoad:
    return load_of(traffic_of([DriveParameters("left", 0)] * drives), bit_rate_bit_s)


def bits_on_the_wire(identifier: int, data: bytes) -> int:
    """Of one frame up to the next: written from the standard, not from the formula."""
    bits = [0, *number(identifier, 11), 0, 0, 0, *number(len(data), 4)]
    for byte in data:
        bits += number(byte, 8)
    crc = 0
    for bit in bits:
        flips = bit ^ crc >> 14 & 1
        crc = (crc << 1 ^ (CRC15 if flips else 0)) & 0x7FFF
    bits += number(crc, 15)
    stuffed, run, last = 0, 0, -1
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, run, last = stuffed + 1, 1, 1 - bit
    return len(bits) + stuffed + 3 + 7 + 3  # delimiters and acknowledgement, end of frame, rest


def number(value: int, width: int) -> list[int]:
    return [value >> place & 1 for place in reversed(range(width))]


def test_real_frames_lie_between_the_bounds() -> None:
    chance = random.Random(6)
    for _ in range(2000):
        data = bytes(chance.choice((0, 255, chance.randrange(256))) for _ in range(chance.randrange(9)))
        least, most = frame_bits(len(data))
        assert least <= bits_on_the_wire(chance.randrange(2048), data) <= most


def test_two_drives_on_a_megabit_leave_room_and_four_are_close() -> None:
    assert bus_load(2, 1e6).most == pytest.approx(0.353, abs=0.002)
    assert 0.6 < bus_load(4, 1e6).most < 0.8


def test_what_odrives_are_delivered_with_cannot_carry_two_drives() -> None:
    assert bus_load(2, 250e3).least > 1.0


def test_every_message_that_the_readme_sets_is_counted() -> None:
    assert sum(rate_hz for _, rate_hz in traffic_of([DriveParameters("left", 0)])) == 380 + 2 * 500 + 4 * 10
