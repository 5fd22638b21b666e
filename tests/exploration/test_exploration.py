"""Every state that modes, latch, lease and arming can reach keeps every promise; a weakened robot does not."""

from collections.abc import Callable
from typing import Any

import pytest

from control import modes
from control.fault_latch import FaultLatch
from control.faults import Clears, FaultKind, Reaction
from control.modes import ENERGISED, MOVING, TRANSITIONS, Health, Mode, Request
from drivers.drives import Drives
from firmware_host import loop as loop_module
from firmware_host.lease import Lease
from firmware_host.loop import Loop
from tests.exploration.abstract_robot import AbstractRobot
from tests.exploration.scopes import EVERYTHING, ONE_OF_EACH, ORDERS, quick_scopes
from tests.exploration.search import Exploration, Scope

SILENT, HOT, QUIET, DISK = (
    FaultKind.DRIVE_SILENT, FaultKind.MOTOR_OVERHEATING, FaultKind.DRIVE_QUIET, FaultKind.DISK_LOW
)  # fmt: skip
OPERATORS, DRIVES = Scope(EVERYTHING), Scope(ORDERS, drives=True)
FAULTS, FORCE, BUG = Scope(ORDERS, (SILENT, HOT)), Scope(ORDERS, (DISK,)), Scope(ORDERS, (QUIET, SILENT))
Patch = Callable[[pytest.MonkeyPatch], None]


def test_every_reachable_state_keeps_every_promise(record_property: Callable[[str, object], None]) -> None:
    """The search also takes every change of mode in the table, so the claim is not empty."""
    robot, states, changes = AbstractRobot(), 0, set[tuple[Mode, Mode]]()
    for scope in quick_scopes():
        exploration = Exploration(scope, robot)
        broken = exploration.run()
        assert broken is None, f"{scope}\n{broken}"
        states += exploration.states
        changes |= exploration.mode_changes
    record_property("states", states)
    print(f"{states} states")
    assert states > 5000
    assert changes == {(source, row.target) for row in TRANSITIONS for source in row.sources}


def test_there_is_one_fault_of_each_combination() -> None:
    assert {kind.reaction for kind in ONE_OF_EACH} == set(Reaction)
    assert {kind.clears for kind in ONE_OF_EACH} == set(Clears)


def rows_without(*texts: str) -> Patch:
    """Return a patch that removes the rows with these causes from the table of modes."""

    def patch(monkeypatch: pytest.MonkeyPatch) -> None:
        kept = [row for row in TRANSITIONS if row.cause.text not in texts]
        monkeypatch.setattr(modes, "_ROWS_OF", rows_of(kept))

    return patch


def rows_of(rows: list[modes.Transition]) -> dict[Mode, tuple[tuple[Any, Mode], ...]]:
    return {mode: tuple((row.cause.is_true, row.target) for row in rows if mode in row.sources) for mode in Mode}


def disarm_last(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modes, "_ROWS_OF", rows_of(sorted(TRANSITIONS, key=lambda row: row.cause.text == "disarm")))


def with_row(source: Mode, is_true: Callable[[Request, Health], bool], target: Mode) -> Patch:
    row = modes.Transition(frozenset({source}), modes.Cause("", is_true), target)
    return lambda monkeypatch: monkeypatch.setattr(modes, "_ROWS_OF", rows_of([row, *TRANSITIONS]))


def replaced(owner: object, name: str, value: object) -> Patch:
    return lambda monkeypatch: monkeypatch.setattr(owner, name, value)


def dropped(owner: type, name: str) -> Patch:
    return replaced(owner, name, lambda *values, **named: None)


def pops_without_end(loop: Loop) -> Request:
    request, loop.pending_request = loop.pending_request, Request.NONE
    return request


def keeps_request(loop: Loop) -> Request:
    return loop.pending_request


def asks_without_preparing(drives: Drives, now_s: float, at_once: bool = False) -> None:
    drives.gate.open()
    for axis in drives.axes:
        axis.close_loop()


def ignores_refused_frames(drives: Drives, now_s: float, at_once: bool = False) -> None:
    drives.gate.open()
    for axis in drives.axes:
        axis.prepare()
    if not at_once:
        for axis in drives.axes:
            axis.close_loop()


def frees_a_lost_lease(lease: Lease, holder: object) -> None:
    if not lease.held or holder == lease.holder:
        lease.reset()


def never_latches(latch: FaultLatch, each: Any, energised: bool, clearing: bool) -> bool:
    return True


WEAKENED: dict[str, tuple[Scope, Patch]] = {
    "no disarm": (OPERATORS, rows_without("disarm")),
    "disarm after all else": (FAULTS, disarm_last),
    "no reaction that idles": (FAULTS, rows_without("fault: drives idle")),
    "no soft stop": (FAULTS, rows_without("fault: soft stop")),
    "no damping": (BUG, rows_without("fault: damping")),
    "no end of damping": (BUG, rows_without("at rest")),
    "no stop": (OPERATORS, rows_without("stop")),
    "no end of a hold": (OPERATORS, rows_without("held for too long")),
    "hold after a soft stop": (FAULTS, rows_without("raised, after a fault")),
    "no end of stopping": (OPERATORS, rows_without("raised, after a fault", "raised")),
    "no end of a fault": (FAULTS, rows_without("fault is over")),
    "arms out of a fault": (FAULTS, with_row(Mode.FAULT, lambda request, health: health.drives_heard, Mode.ARMING)),
    "arms by itself": (OPERATORS, with_row(Mode.IDLE, lambda request, health: health.drives_heard, Mode.ARMING)),
    "arms over a fault": (FORCE, with_row(Mode.IDLE, lambda request, health: request is Request.ARM, Mode.ARMING)),
    "holds before closed loop": (DRIVES, with_row(Mode.ARMING, lambda request, health: True, Mode.HOLD)),
    "walks by itself": (OPERATORS, with_row(Mode.HOLD, lambda request, health: True, Mode.WALKING)),
    "torque while arming": (OPERATORS, replaced(loop_module, "MOVING", MOVING | {Mode.ARMING})),
    "gate open in a fault": (FAULTS, replaced(loop_module, "ENERGISED", ENERGISED | {Mode.FAULT})),
    "believes old heartbeats": (
        DRIVES,
        replaced(Loop, "_all_in_closed_loop", lambda loop: all(state.closed_loop for state in loop.states)),
    ),
    "lets a daemon arm that ends": (OPERATORS, replaced(Loop, "_pop_request", pops_without_end)),
    "repeats a request": (OPERATORS, replaced(Loop, "_pop_request", keeps_request)),
    "sees no lost lease": (OPERATORS, replaced(Loop, "_end_lost_lease", lambda loop, now_s: "")),
    "keeps a lease for ever": (OPERATORS, replaced(Lease, "lost", lambda lease, now_s: False)),
    "ignores a hang-up": (OPERATORS, dropped(Lease, "hang_up")),
    "frees a lost lease": (OPERATORS, replaced(Lease, "release", frees_a_lost_lease)),
    "permits every caller": (OPERATORS, dropped(Lease, "refusal")),
    "forgets whom it ousted": (OPERATORS, replaced(Lease, "oust", lambda lease, by: lease.reset())),
    "latches nothing": (FAULTS, replaced(FaultLatch, "_is_over", never_latches)),
    "detects nothing": (FAULTS, dropped(FaultLatch, "_detect")),
    "idles drives later": (DRIVES, dropped(Drives, "disarm")),
    "asks without preparing": (DRIVES, replaced(Drives, "arm", asks_without_preparing)),
    "ignores refused frames": (DRIVES, replaced(Drives, "arm", ignores_refused_frames)),
    "ends no move": (Scope(ORDERS, (FaultKind.CURRENT_STALE,)), dropped(Loop, "_end_move")),
}


@pytest.mark.parametrize("weakness", WEAKENED)
def test_the_search_finds_a_broken_promise(weakness: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scope, patch = WEAKENED[weakness]
    robot = AbstractRobot()
    patch(monkeypatch)
    assert Exploration(scope, robot).run() is not None
