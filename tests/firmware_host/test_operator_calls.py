"""Whoever asks is named in the log, and a lease is given while there is something that its loss can stop."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from control.modes import Mode
from firmware_host.configuration import Configuration
from firmware_host.connection import Caller
from firmware_host.log_rows import EVENT
from firmware_host.loop import EVENT_KIND
from firmware_host.operator_calls import OperatorCalls
from firmware_host.recorder import NullRecorder
from firmware_host.rights import NEEDED, Level, Peer
from firmware_host.rpc import RefusedError
from simulation.clay import MUDS
from simulation.lockstep import Lockstep
from simulation.track import Track

ANNA = Caller(1, Peer(77, 1000, frozenset({71})), Level.DRIVE)
BEN = Caller(2, Peer(78, 1001, frozenset({71})), Level.DRIVE)


class Events(NullRecorder):
    """Keeps the sentences."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def put(self, kind_index: int, payload: bytes) -> bool:
        if kind_index == EVENT_KIND:
            self.texts.append(EVENT.decode(payload)["text"])
        return True


class Robot:
    """A simulated one, with its calls."""

    def __init__(self, configuration: Configuration) -> None:
        self.events = Events()
        self.steps = Lockstep(configuration, Track([(5.0, MUDS["48.5"])]), recorder=self.events)
        self.lease = self.steps.loop.lease
        calls = OperatorCalls(self.steps.loop, self.events, [], lambda: self.steps.now_s)
        self._methods = calls.methods
        self.names = set(self._methods)

    def ask(self, method: str, caller: Caller = ANNA, **params: Any) -> Any:
        return self._methods[method](params, caller)


@pytest.fixture
def robot(configuration: Configuration) -> Robot:
    return Robot(configuration)


@pytest.fixture
def armed(robot: Robot) -> Robot:
    robot.steps.arm()
    return robot


def test_whoever_asks_for_something_is_named_in_the_log(armed: Robot) -> None:
    armed.ask("walk", strides=2)
    armed.steps.run_for(0.1)
    armed.ask("stop", BEN)
    armed.ask("disarm", BEN)
    assert [text for text in armed.events.texts if " by " in text] == [
        "request walk by uid 1000 (process 77)",
        "request stop by uid 1001 (process 78)",
        "request disarm by uid 1001 (process 78)",
    ]


def test_a_request_that_is_refused_is_nobody_s(robot: Robot) -> None:
    with pytest.raises(RefusedError):
        robot.ask("walk")
    assert not [text for text in robot.events.texts if "uid" in text]


def test_whatever_moves_the_robot_is_for_operators(robot: Robot) -> None:
    assert robot.names - NEEDED.keys() == {"arm", "walk", "clear", "lease", "release", "reset_timing"}


def test_there_is_no_lease_while_torque_is_off(robot: Robot) -> None:
    robot.steps.run_for(0.1)
    with pytest.raises(RefusedError, match="arm first"):
        robot.ask("lease", for_s=0.5)
    assert not robot.lease.held


@pytest.mark.parametrize("for_s", [None, True, "0.5", 0, 0.09, 10.1, -1.0, nan, 2**70])
def test_a_lease_is_for_a_tenth_of_a_second_to_ten(armed: Robot, for_s: Any) -> None:
    with pytest.raises(RefusedError, match=r"for_s = .*: must be a number from 0.1 to 10"):
        armed.ask("lease", for_s=for_s)
    assert not armed.lease.held


def test_a_lease_that_is_renewed_is_told_once(armed: Robot) -> None:
    for _ in range(5):
        armed.ask("lease", for_s=0.5)
        armed.steps.run_for(0.2)
    assert armed.lease.held and not armed.lease.lost(armed.steps.now_s)
    assert armed.events.texts.count("lease taken by uid 1000 (process 77)") == 1


def test_another_operator_is_told_who_holds_it(armed: Robot) -> None:
    armed.ask("lease", for_s=0.5)
    for method, params in (("lease", {"for_s": 0.5}), ("release", {})):
        with pytest.raises(RefusedError, match=r"^uid 1000 \(process 77\) holds the lease$"):
            armed.ask(method, BEN, **params)


def test_the_same_user_s_next_connection_is_another_holder(armed: Robot) -> None:
    armed.ask("lease", for_s=0.5)
    with pytest.raises(RefusedError, match="holds the lease"):
        armed.ask("lease", ANNA._replace(connection=3), for_s=0.5)


def test_a_lost_lease_is_lost_until_an_operator_releases_it(armed: Robot) -> None:
    armed.ask("lease", for_s=0.5)
    armed.steps.run_for(0.6)
    assert armed.lease.lost(armed.steps.now_s)
    with pytest.raises(RefusedError, match="has lost the lease"):
        armed.ask("lease", for_s=0.5)
    armed.ask("release", BEN)
    assert not armed.lease.lost(armed.steps.now_s)
    armed.ask("lease", BEN, for_s=0.5)


def test_a_clear_that_is_accepted_ends_a_lost_lease(armed: Robot) -> None:
    armed.ask("lease", for_s=0.5)
    armed.lease.hang_up(ANNA)
    armed.ask("disarm")
    armed.steps.run_for(0.1)
    assert armed.steps.loop.mode is Mode.IDLE
    armed.ask("clear", BEN)
    assert not armed.lease.lost(armed.steps.now_s)
