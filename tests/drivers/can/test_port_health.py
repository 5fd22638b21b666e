"""Error frames as linux/can/error.h defines them, byte by byte, and the state of the bus that follows from them."""

import pytest

from drivers.can.port_health import BusState, decode_error_frame, next_state

ACTIVE, WARNING, PASSIVE, OFF = BusState

GOLDEN: list[tuple[int, str, BusState | None, str]] = [
    (0x001, "00 00 00 00 00 00 00 00", None, "transmit time-out"),
    (0x002, "05 00 00 00 00 00 00 00", None, "lost arbitration"),
    (0x004, "00 01 00 00 00 00 00 00", None, "receive overflow"),
    (0x004, "00 02 00 00 00 00 00 00", None, "transmit overflow"),
    (0x004, "00 04 00 00 00 00 00 00", WARNING, "receive warning"),
    (0x004, "00 08 00 00 00 00 00 00", WARNING, "transmit warning"),
    (0x004, "00 10 00 00 00 00 00 00", PASSIVE, "receive passive"),
    (0x004, "00 20 00 00 00 00 00 00", PASSIVE, "transmit passive"),
    (0x004, "00 40 00 00 00 00 00 00", ACTIVE, "active again"),
    (0x004, "00 0c 00 00 00 00 00 00", WARNING, "receive warning, transmit warning"),
    (0x004, "00 24 00 00 00 00 00 00", PASSIVE, "receive warning, transmit passive"),
    (0x204, "00 08 00 00 00 00 60 03", WARNING, "transmit warning, 96 transmit and 3 receive errors"),
    (0x204, "00 00 00 00 00 00 80 00", PASSIVE, "128 transmit and 0 receive errors"),
    (0x008, "00 00 04 0a 00 00 00 00", None, "protocol violation"),
    (0x010, "00 00 00 00 04 00 00 00", None, "transceiver fault"),
    (0x020, "00 00 00 00 00 00 00 00", None, "no acknowledgement"),
    (0x040, "00 00 00 00 00 00 00 00", OFF, "bus-off"),
    (0x044, "00 20 00 00 00 00 00 00", OFF, "bus-off, transmit passive"),
    (0x088, "00 00 80 19 00 00 00 00", None, "protocol violation, bus error"),
    (0x288, "00 00 80 19 00 00 00 7f", WARNING, "protocol violation, bus error, 0 transmit and 127 receive errors"),
    (0x288, "00 00 80 19 00 00 00 80", PASSIVE, "protocol violation, bus error, 0 transmit and 128 receive errors"),
    (0x280, "00 00 00 00 00 00 5f 5f", ACTIVE, "bus error, 95 transmit and 95 receive errors"),
    (0x100, "00 00 00 00 00 00 00 00", ACTIVE, "controller restarted"),
    (0x000, "00 00 00 00 00 00 00 00", None, "error class 0x0"),
    (0x400, "00 00 00 00 00 00 00 00", None, "error class 0x400"),
    (0x004, "", None, "error class 0x4"),
    (0x004, "00 10", PASSIVE, "receive passive"),
    (0x200, "", ACTIVE, "0 transmit and 0 receive errors"),
]


@pytest.mark.parametrize(("class_bits", "data", "state", "text"), GOLDEN)
def test_error_frames_decode_to_state_and_text(class_bits: int, data: str, state: BusState | None, text: str) -> None:
    assert decode_error_frame(class_bits, bytes.fromhex(data)) == (state, text)


@pytest.mark.parametrize(
    ("before", "class_bits", "reported", "after"),
    [
        (ACTIVE, 0x004, WARNING, WARNING),
        (PASSIVE, 0x004, ACTIVE, ACTIVE),
        (WARNING, 0x008, None, WARNING),
        (WARNING, 0x040, OFF, OFF),
        (OFF, 0x100, ACTIVE, ACTIVE),
        (OFF, 0x280, ACTIVE, OFF),
        (OFF, 0x004, WARNING, OFF),
        (OFF, 0x104, WARNING, WARNING),
        (OFF, 0x020, None, OFF),
    ],
)
def test_only_a_restart_leads_out_of_bus_off(
    before: BusState, class_bits: int, reported: BusState | None, after: BusState
) -> None:
    assert next_state(before, class_bits, reported) is after
