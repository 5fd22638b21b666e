"""Every mode with every request and every state of health, against the rules that people rely on."""

from itertools import product

import pytest

from control.faults import Fault
from control.modes import ENERGISED, MOVING, Health, Mode, Request, next_mode, refusal

BROKEN = Fault("drive_error", "The left_sweep drive reports error 0x1.")
FLAGS = (False, True)
HEALTHS = [Health(a, b, c, d, fault) for a, b, c, d, fault in product(FLAGS, FLAGS, FLAGS, FLAGS, (None, BROKEN))]
EVERYTHING = list(product(Mode, Request, HEALTHS))
REQUESTS = [request for request in Request if request is not Request.NONE]
ALWAYS_ACCEPTED = {(request, mode) for request in (Request.STOP, Request.DISARM) for mode in Mode} | {
    (Request.CLEAR, Mode.IDLE)
}
WELL = Health(drives_heard=True, closed_loop=True)


def arrows(mode: Mode, request: Request) -> set[Mode]:
    """All modes that may follow, whatever the health."""
    return {next_mode(mode, request, health) for health in HEALTHS}


@pytest.mark.parametrize("mode", sorted(ENERGISED))
def test_a_fault_takes_the_torque_off_whatever_is_requested(mode: Mode) -> None:
    for request, health in product(Request, HEALTHS):
        if health.fault is not None:
            assert next_mode(mode, request, health) is Mode.FAULT


def test_without_a_fault_nothing_leads_to_fault() -> None:
    for mode, request, health in EVERYTHING:
        if health.fault is None and mode is not Mode.FAULT:
            assert next_mode(mode, request, health) is not Mode.FAULT


@pytest.mark.parametrize("mode", sorted(ENERGISED))
def test_disarm_takes_the_torque_off_at_once(mode: Mode) -> None:
    for health in HEALTHS:
        expected = Mode.IDLE if health.fault is None else Mode.FAULT
        assert next_mode(mode, Request.DISARM, health) is expected


def test_only_arm_in_idle_ever_puts_torque_on() -> None:
    for mode, request, health in EVERYTHING:
        if mode not in ENERGISED and next_mode(mode, request, health) in ENERGISED:
            assert (mode, request) == (Mode.IDLE, Request.ARM)
            assert next_mode(mode, request, health) is Mode.ARMING
            assert health.drives_heard
            assert health.fault is None
    assert next_mode(Mode.IDLE, Request.ARM, WELL) is Mode.ARMING


def test_a_joint_may_only_move_once_all_drives_are_in_closed_loop() -> None:
    for mode, request, health in EVERYTHING:
        if mode not in MOVING and next_mode(mode, request, health) in MOVING:
            assert mode is Mode.ARMING
            assert health.closed_loop


def test_fault_is_left_only_by_clear_once_the_cause_is_gone() -> None:
    for request, health in product(Request, HEALTHS):
        cleared = request is Request.CLEAR and health.fault is None
        assert next_mode(Mode.FAULT, request, health) is (Mode.IDLE if cleared else Mode.FAULT)


def test_walking_starts_only_from_hold_and_only_when_told() -> None:
    for mode, request, health in EVERYTHING:
        if mode is not Mode.WALKING and next_mode(mode, request, health) is Mode.WALKING:
            assert (mode, request) == (Mode.HOLD, Request.WALK)


def test_a_walk_ends_by_raising_the_flippers() -> None:
    assert next_mode(Mode.WALKING, Request.STOP, WELL) is Mode.STOPPING
    assert next_mode(Mode.WALKING, Request.NONE, WELL._replace(walk_finished=True)) is Mode.STOPPING
    assert next_mode(Mode.WALKING, Request.NONE, WELL) is Mode.WALKING
    assert arrows(Mode.WALKING, Request.NONE) == {Mode.WALKING, Mode.STOPPING, Mode.FAULT}


def test_stopping_lasts_until_the_flippers_are_raised() -> None:
    for request in set(Request) - {Request.DISARM}:
        assert next_mode(Mode.STOPPING, request, WELL) is Mode.STOPPING
        assert next_mode(Mode.STOPPING, request, WELL._replace(raised=True)) is Mode.HOLD


def test_boot_ends_when_every_drive_was_heard_and_at_nothing_else() -> None:
    for request, health in product(Request, HEALTHS):
        assert next_mode(Mode.BOOT, request, health) is (Mode.IDLE if health.drives_heard else Mode.BOOT)


def test_modes_without_request_follow_the_picture() -> None:
    health = Health()
    assert next_mode(Mode.BOOT, Request.NONE, health) is Mode.BOOT
    health = health._replace(drives_heard=True)
    assert next_mode(Mode.BOOT, Request.NONE, health) is Mode.IDLE
    assert next_mode(Mode.IDLE, Request.ARM, health) is Mode.ARMING
    assert next_mode(Mode.ARMING, Request.NONE, health) is Mode.ARMING
    health = health._replace(closed_loop=True)
    assert next_mode(Mode.ARMING, Request.NONE, health) is Mode.HOLD
    assert next_mode(Mode.HOLD, Request.WALK, health) is Mode.WALKING


def reachable(mode: Mode, health: Health) -> bool:
    """Whether the loop can be found so between two ticks: a fault has already ended every energised mode."""
    if mode in ENERGISED and health.fault is not None:
        return False
    return mode is Mode.BOOT or health.drives_heard


def test_a_request_is_refused_exactly_where_it_could_change_nothing() -> None:
    for mode, request, health in product(Mode, REQUESTS, HEALTHS):
        if not reachable(mode, health):
            continue
        effective = next_mode(mode, request, health) is not next_mode(mode, Request.NONE, health)
        accepted = effective or (request, mode) in ALWAYS_ACCEPTED
        if request is Request.CLEAR and health.fault is not None:
            accepted = False
        if mode is Mode.WALKING and request is Request.STOP:
            accepted = True  # also in the tick in which the walk ends by itself
        if mode is Mode.HOLD and request is Request.WALK:
            assert effective
        assert (refusal(mode, request, health) is None) == accepted, (mode, request, health)


def test_a_refusal_tells_the_cause_where_there_is_one() -> None:
    faulty = WELL._replace(fault=BROKEN)
    assert refusal(Mode.IDLE, Request.ARM, faulty) == BROKEN.sentence
    assert refusal(Mode.FAULT, Request.CLEAR, faulty) == f"the cause persists: {BROKEN.sentence}"


@pytest.mark.parametrize("mode", Mode)
def test_stop_and_disarm_are_never_refused(mode: Mode) -> None:
    for health in HEALTHS:
        assert refusal(mode, Request.STOP, health) is None
        assert refusal(mode, Request.DISARM, health) is None


def test_a_refusal_is_a_sentence_that_says_what_to_do() -> None:
    sentences = {refusal(mode, Request.WALK, WELL) for mode in Mode} - {None}
    assert len(sentences) == len(Mode) - 1
    assert all(sentence and " " in sentence for sentence in sentences)
