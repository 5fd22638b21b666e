"""The table of all faults: its columns do not contradict each other or the modes, and no text can stop the loop."""

import pytest

from control.faults import FAULT_KINDS, Blocks, Clears, FaultKind, Reaction
from control.modes import Health, Mode, Request, next_mode


def test_every_fault_is_named_as_its_member() -> None:
    assert [kind.name.lower() for kind in FaultKind] == [kind.value for kind in FaultKind] == list(FAULT_KINDS)


def test_reaction_blocking_and_clearing_of_every_fault_agree() -> None:
    for kind in FaultKind:
        armed = next_mode(Mode.IDLE, Request.ARM, Health(drives_heard=True, worst=kind.fault())) is Mode.ARMING
        assert armed == (kind.reaction < Reaction.HOLD), kind  # even by force
        if kind.reaction >= Reaction.HOLD:  # the modes refuse to arm: the check must say why
            assert kind.blocks is Blocks.ALWAYS, kind
        if kind.reaction is Reaction.DRIVES_IDLE:
            assert kind.clears is not Clears.WHEN_GONE, kind
        if kind.clears is Clears.BY_RESTART:  # a bug
            assert kind.reaction is Reaction.DRIVES_IDLE, kind
        if kind.clears is not Clears.WHEN_GONE:  # `clear` is refused while torque is on: a warning could not be cleared
            assert kind.reaction >= Reaction.SOFT_STOP, kind
        if kind.clears is Clears.BY_HAND:
            assert "'mudskipper clear'" in kind.what_to_do, kind
        assert kind.reaction > Reaction.NONE or kind.blocks is not Blocks.NO, kind
        assert 1 <= kind.bound_ticks <= 1900, kind  # two strides: a blocked swing is known once it repeats


@pytest.mark.parametrize(
    ("milder", "harder"),
    [
        (FaultKind.DRIVE_LATE, FaultKind.DRIVE_QUIET),
        (FaultKind.DRIVE_QUIET, FaultKind.DRIVE_SILENT),
        (FaultKind.POSITION_STALE, FaultKind.POSITION_SILENT),
        (FaultKind.CURRENT_STALE, FaultKind.CURRENT_SILENT),
        (FaultKind.CURRENT_STALE, FaultKind.POSITION_STALE),
        (FaultKind.CURRENT_SILENT, FaultKind.POSITION_SILENT),
        (FaultKind.MOTOR_OVERHEATING, FaultKind.MOTOR_HOT),
        (FaultKind.WINDING_OVERHEATING, FaultKind.WINDING_HOT),
        (FaultKind.VOLTAGE_LOW, FaultKind.VOLTAGE_UNDER),
        (FaultKind.LOOP_OVERRUN, FaultKind.LOOP_LAGGING),
        (FaultKind.LOOP_LAGGING, FaultKind.LOOP_STALLED),
        (FaultKind.BUS_WARNING, FaultKind.BUS_OFF),
    ],
)
def test_the_worse_of_two_degrees_has_the_harder_reaction(milder: FaultKind, harder: FaultKind) -> None:
    assert milder.reaction < harder.reaction
    assert milder.blocks <= harder.blocks


def test_a_fault_carries_its_kind_its_subject_and_its_values() -> None:
    fault = FaultKind.JOINT_POSITION.fault("left_sweep", angle_deg=91.0)
    assert (fault.name, fault.check_line, fault.values) == (
        "joint_position",
        "joint.left_sweep",
        (("angle_deg", 91.0),),
    )
    assert fault.with_values(reason="why").values == (("angle_deg", 91.0), ("reason", "why"))
    assert FaultKind.LOOP_OVERRUN.fault(missed=1).check_line == "loop"


def test_every_fault_has_a_meaning_and_an_advice_and_a_message_even_without_its_values() -> None:
    for kind in FaultKind:
        message = kind.fault("left_sweep").message
        assert message and "{" not in message, kind
        assert kind.meaning and kind.what_to_do, kind
        assert kind.clears is Clears.BY_HAND or "'mudskipper clear'" not in kind.what_to_do, kind


def test_a_message_ends_with_the_reason_and_advice_begins_with_the_message() -> None:
    fault = FaultKind.BUS_REFUSES.fault("left", ticks=3, reason="No buffer space available.")
    assert fault.message.endswith(": No buffer space available.")
    assert fault.advice.startswith(fault.message)


def test_a_signal_that_never_came_has_no_age() -> None:
    heartbeat = FaultKind.HEARTBEAT_SILENT
    assert "510 ms" in heartbeat.fault("x", age_s=0.51).exact_message()
    assert "inf" not in heartbeat.fault("x", age_s=float("inf")).exact_message()
