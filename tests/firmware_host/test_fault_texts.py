"""Every fault has a text, and a fault without its values never stops the loop."""

from control.faults import Clears, FaultKind
from firmware_host.fault_texts import FAULT_TEXTS, fault_advice, fault_message


def test_every_fault_has_a_meaning_a_message_and_an_advice() -> None:
    assert set(FAULT_TEXTS) == set(FaultKind)
    assert all(text.meaning and text.what_to_do for text in FAULT_TEXTS.values())
    assert all("clear" not in FAULT_TEXTS[kind].what_to_do for kind in FaultKind if kind.clears is not Clears.BY_HAND)


def test_a_fault_without_its_values_is_described_in_general() -> None:
    for kind in FaultKind:
        message = fault_message(kind.fault("left_sweep"))
        assert message and "{" not in message


def test_a_message_shows_values_and_ends_with_the_reason() -> None:
    fault = FaultKind.BUS_REFUSES.fault("left", ticks=3, reason="No buffer space available.")
    assert fault_message(fault) == "The left bus lost commands in 3 ticks in a row: No buffer space available."
    assert fault_advice(fault).startswith(f"{fault_message(fault)} Check wiring")


def test_a_signal_that_never_came_has_no_age() -> None:
    heartbeat = FaultKind.HEARTBEAT_SILENT
    assert fault_message(heartbeat.fault("x", age_s=0.51)) == "No heartbeat came from the x drive for 510 ms."
    assert fault_message(heartbeat.fault("x", age_s=float("inf"))) == "No heartbeat came from the x drive at all."
