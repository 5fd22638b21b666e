"""The load of a bus, against frames that are laid out and stuffed bit by bit."""

import random

import pytest

from drivers.can.bus_load import BitRates, FrameRate, bus_load, frame_bits, frame_times_s
from drivers.drive import DriveParameters
from drivers.drive_types import traffic_of
from drivers.moteus.parameters import MoteusParameters

CRC15 = 0x4599  # of ISO 11898-1
ODRIVE = [DriveParameters("left", 0)]


def bits_on_the_wire(identifier: int, data: bytes) -> int:
    """Return the bits of one frame up to the next, written from the standard and not from the formula."""
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
    return [value >> shift & 1 for shift in reversed(range(width))]


def test_real_frames_lie_between_the_bounds() -> None:
    chance = random.Random(6)
    for _ in range(2000):
        data = bytes(chance.choice((0, 255, chance.randrange(256))) for _ in range(chance.randrange(9)))
        least, most = frame_bits(len(data))
        assert least <= bits_on_the_wire(chance.randrange(2048), data) <= most


@pytest.mark.parametrize(
    ("drives", "rates", "least", "most"),
    [
        (2 * ODRIVE, BitRates(1e6), 0.0, 0.355),
        (4 * ODRIVE, BitRates(1e6), 0.0, 0.8),
        (2 * ODRIVE, BitRates(250e3), 1.0, 2.0),  # as delivered: it cannot carry two drives
        ([MoteusParameters("left", node) for node in (1, 2, 3, 4)], BitRates(1e6, 5e6), 0.0, 0.45),
    ],
)
def test_the_load_of_a_bus(drives: list[DriveParameters], rates: BitRates, least: float, most: float) -> None:
    load = bus_load(traffic_of(drives), rates)
    assert least < load.least < load.most < most


def test_a_can_fd_frame_is_fast_only_between_the_two_changes_of_the_rate() -> None:
    """A frame of 32 bytes with a 29-bit identifier, counted field by field from the standard."""
    before = [1, 11, 1, 1, 18, 1, 1, 1, 1]  # start, base id, SRR, IDE, extension, RRS, FDF, reserved, rate switch
    fast = [1, 4, 8 * 32, 4, 21, 7, 1]  # ESI, length, data, stuff count, checksum, its fixed stuff bits, delimiter
    after = [2, 7, 3]  # acknowledgement, end of frame, rest
    least_s, most_s = frame_times_s(FrameRate(32, 1.0, is_extended=True, is_fd=True), BitRates(1e6, 5e6))
    assert least_s == pytest.approx(1e-6 * (sum(before) + sum(after)) + 0.2e-6 * sum(fast))
    assert least_s < most_s < 1.25 * least_s
