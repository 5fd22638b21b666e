"""Every mode with every request, every reaction and every state of health, against the rules that operators rely on."""

from itertools import product

import pytest

from control.faults import Fault, FaultKind, Reaction
from control.modes import (
    ENERGISED,
    HELD,
    MOVING,
    TRANSITIONS,
    Health,
    Mode,
    Refusal,
    Request,
    next_mode,
    refusal,
)
from tests.mode_hardness import HARDNESS, MILDEST

FLAGS = (False, True)
OF_REACTION = {kind.reaction: kind.fault("left_sweep") for kind in FaultKind}
WORST: list[Fault | None] = [None, *OF_REACTION.values()]
HEALTHS = [
    Health(heard, closed, finished, raised, settled, cut_short, rested, fault, blocking)
    for heard, closed, finished in product(FLAGS, FLAGS, FLAGS)
    for raised, settled, cut_short, rested in product(FLAGS, FLAGS, FLAGS, FLAGS)
    for fault, blocking in product(WORST, ((), (OF_REACTION[Reaction.NONE],)))
]
EVERYTHING = list(product(Mode, Request, HEALTHS))
WELL = Health(drives_heard=True, closed_loop=True)


def faulty(reaction: Reaction, health: Health = WELL) -> Health:
    return health._replace(worst=OF_REACTION[reaction])


def test_every_reaction_is_at_least_as_hard_as_it_says_in_every_mode_with_torque() -> None:
    for mode, request, health in product(MOVING, Request, HEALTHS):
        assert HARDNESS[next_mode(mode, request, health)] >= MILDEST[health.reaction], (mode, request, health)


def test_arming_ends_at_any_fault_that_would_stop_a_walk() -> None:
    for request, health in product(Request, HEALTHS):
        if health.reaction >= Reaction.SOFT_STOP:
            assert next_mode(Mode.ARMING, request, health) in (Mode.FAULT, Mode.IDLE)


def test_a_fault_never_makes_the_reaction_milder() -> None:
    """Of two healths that differ only in the fault, the one with the worse fault leads to the harder mode."""
    for mode, request, health in product(MOVING, Request, HEALTHS):
        if health.worst is None or request is Request.WALK:
            continue
        worse = [faulty(reaction, health) for reaction in Reaction if reaction > health.reaction]
        hardness = [HARDNESS[next_mode(mode, request, each)] for each in (health, *worse)]
        if not (health.raised or health.rested or health.settled or health.walk_finished or request is Request.STOP):
            assert hardness == sorted(hardness), (mode, request, health)


def test_without_a_fault_that_stops_nothing_leads_to_fault_or_damping() -> None:
    for mode, request, health in EVERYTHING:
        after = next_mode(mode, request, health)
        if health.reaction < Reaction.SOFT_STOP and after is not mode and mode is not Mode.DAMPING:
            assert after not in (Mode.FAULT, Mode.DAMPING)


@pytest.mark.parametrize("mode", sorted(ENERGISED))
def test_disarm_takes_the_torque_off_at_once(mode: Mode) -> None:
    for health in HEALTHS:
        hard = health.reaction is Reaction.DRIVES_IDLE
        assert next_mode(mode, Request.DISARM, health) is (Mode.FAULT if hard else Mode.IDLE)


def test_only_arm_in_idle_ever_puts_torque_on() -> None:
    for mode, request, health in EVERYTHING:
        if mode not in ENERGISED and next_mode(mode, request, health) in ENERGISED:
            assert (mode, request) == (Mode.IDLE, Request.ARM)
            assert next_mode(mode, request, health) is Mode.ARMING
            assert health.drives_heard and not health.blocking and health.reaction < Reaction.HOLD
    assert next_mode(Mode.IDLE, Request.ARM, WELL) is Mode.ARMING


def test_a_joint_may_only_move_once_all_drives_are_in_closed_loop() -> None:
    for mode, request, health in EVERYTHING:
        if mode not in MOVING and next_mode(mode, request, health) in MOVING:
            assert mode is Mode.ARMING
            assert health.closed_loop


def test_stiffness_never_comes_back_after_damping() -> None:
    for request, health in product(Request, HEALTHS):
        assert next_mode(Mode.DAMPING, request, health) not in HELD


def test_fault_lasts_until_no_fault_stands_that_stops() -> None:
    for request, health in product(Request, HEALTHS):
        stands = health.reaction >= Reaction.SOFT_STOP
        assert next_mode(Mode.FAULT, request, health) is (Mode.FAULT if stands else Mode.IDLE)


def test_walking_starts_only_from_hold_on_request_and_without_a_fault_that_holds() -> None:
    for mode, request, health in EVERYTHING:
        if mode is not Mode.WALKING and next_mode(mode, request, health) is Mode.WALKING:
            assert (mode, request) == (Mode.HOLD, Request.WALK)
            assert health.reaction < Reaction.HOLD


def test_a_walk_ends_by_raising_the_flippers() -> None:
    assert next_mode(Mode.WALKING, Request.STOP, WELL) is Mode.STOPPING
    assert next_mode(Mode.WALKING, Request.NONE, WELL._replace(walk_finished=True)) is Mode.STOPPING
    assert next_mode(Mode.WALKING, Request.NONE, WELL) is Mode.WALKING


def test_a_stop_while_drives_are_armed_lets_them_go_idle() -> None:
    for health in (WELL, WELL._replace(closed_loop=False)):
        assert next_mode(Mode.ARMING, Request.STOP, health) is Mode.IDLE


def test_a_stop_raises_flippers_that_a_fault_left_in_the_mud() -> None:
    """A stop moves nothing of a robot that holds a pose for another reason."""
    for health in (WELL, faulty(Reaction.WARN), faulty(Reaction.HOLD)):
        cut_short = health._replace(cut_short=True)
        assert next_mode(Mode.HOLD, Request.STOP, cut_short) is Mode.STOPPING
        assert next_mode(Mode.HOLD, Request.NONE, cut_short) is Mode.HOLD
        assert next_mode(Mode.HOLD, Request.STOP, health) is Mode.HOLD


def test_a_requested_stop_ends_in_hold_and_one_for_a_fault_without_torque() -> None:
    for request in set(Request) - {Request.DISARM}:
        assert next_mode(Mode.STOPPING, request, WELL) is Mode.STOPPING
        raised = WELL._replace(raised=True)
        assert next_mode(Mode.STOPPING, request, raised) is Mode.HOLD
        assert next_mode(Mode.STOPPING, request, faulty(Reaction.SOFT_STOP)) is Mode.STOPPING
        assert next_mode(Mode.STOPPING, request, faulty(Reaction.SOFT_STOP, raised)) is Mode.FAULT


def test_a_fault_that_holds_ends_a_walk_where_it_is_and_lets_a_stop_go_on() -> None:
    """A stop in the tick of the fault too, or the flippers would stay in the mud, against the operator's request."""
    assert next_mode(Mode.WALKING, Request.NONE, faulty(Reaction.HOLD)) is Mode.HOLD
    assert next_mode(Mode.WALKING, Request.STOP, faulty(Reaction.HOLD)) is Mode.STOPPING
    assert next_mode(Mode.STOPPING, Request.NONE, faulty(Reaction.HOLD)) is Mode.STOPPING
    assert next_mode(Mode.HOLD, Request.WALK, faulty(Reaction.HOLD)) is Mode.HOLD


def test_a_warning_changes_no_mode() -> None:
    for mode, request, health in EVERYTHING:
        if health.worst is None:
            assert next_mode(mode, request, health) is next_mode(mode, request, faulty(Reaction.WARN, health))


def test_a_pose_without_requests_is_not_held_for_ever() -> None:
    assert next_mode(Mode.HOLD, Request.NONE, WELL._replace(rested=True)) is Mode.IDLE


def test_boot_ends_when_every_drive_was_heard_and_at_nothing_else() -> None:
    for request, health in product(Request, HEALTHS):
        assert next_mode(Mode.BOOT, request, health) is (Mode.IDLE if health.drives_heard else Mode.BOOT)


def test_every_row_of_the_table_applies_for_some_input() -> None:
    """A row that is hidden by those above it in each of its modes would make the diagram wrong."""
    for index, row in enumerate(TRANSITIONS):
        above = TRANSITIONS[:index]
        for source in row.sources:
            hidden = [other for other in above if source in other.sources]
            assert any(
                row.cause.is_true(request, health) and not any(other.cause.is_true(request, health) for other in hidden)
                for request, health in product(Request, HEALTHS)
            ), (row, source)


def test_a_request_is_refused_exactly_where_it_could_change_nothing() -> None:
    for mode, request, health in product(Mode, (Request.ARM, Request.WALK), HEALTHS):
        if mode in ENERGISED and health.reaction >= Reaction.SOFT_STOP or health.rested:
            continue  # a fault has already ended the mode, or is about to
        effective = next_mode(mode, request, health) is not next_mode(mode, Request.NONE, health)
        if mode is Mode.IDLE and not health.drives_heard:
            continue  # impossible: BOOT lasts until every drive is heard
        assert (refusal(mode, request, health) is None) == effective, (mode, request, health)


def test_a_refusal_names_its_cause() -> None:
    blocked = WELL._replace(blocking=(OF_REACTION[Reaction.NONE], OF_REACTION[Reaction.WARN]))
    assert refusal(Mode.IDLE, Request.ARM, blocked) == Refusal(Mode.IDLE, Request.ARM, blocked.blocking)
    held = (OF_REACTION[Reaction.HOLD],)
    for health in (WELL, blocked):  # what only prevents arming was overruled then
        refused = refusal(Mode.HOLD, Request.WALK, faulty(Reaction.HOLD, health))
        assert refused == Refusal(Mode.HOLD, Request.WALK, held)


def test_before_all_drives_are_heard_a_refusal_is_that_of_boot() -> None:
    assert refusal(Mode.IDLE, Request.ARM, Health()) == Refusal(Mode.BOOT, Request.ARM, ())


def test_an_unknown_state_of_the_robot_permits_nothing() -> None:
    assert not any(Health()) and Health().reaction is Reaction.NONE


def test_modes_keep_the_numbers_that_logs_contain() -> None:
    names = ["BOOT", "IDLE", "ARMING", "HOLD", "WALKING", "STOPPING", "FAULT", "DAMPING"]
    assert [Mode(number).name for number in range(8)] == names == [mode.name for mode in Mode]


@pytest.mark.parametrize("mode", Mode)
def test_stop_and_disarm_are_never_refused(mode: Mode) -> None:
    for health in HEALTHS:
        assert refusal(mode, Request.STOP, health) is None
        assert refusal(mode, Request.DISARM, health) is None
