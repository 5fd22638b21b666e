"""No answer of the socket is long, even with every fault present, because it is computed between two ticks."""

from typing import Any

import msgpack
import pytest

from control.controller import WalkOrder
from control.faults import Fault, FaultKind
from control.modes import Mode
from control.records import FLIPPERS, JOINTS
from drivers.fault_injection.failures import Failures
from estimation.mud_map import MOST_PIECES, PIECE_M
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_injection.failure_calls import with_failures
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_methods import FAULTS_PER_ANSWER, PIECES_PER_ANSWER, STRIDES_PER_ANSWER, Level
from firmware_host.sockets.status_socket import Methods
from simulation.harness.direct import Direct
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

LONGEST_BYTES = 24 * 1024  # the time of an answer grows with its length
SLOW_S = 0.019  # a tick that missed several periods
STRIDES = 12
CALLER = Caller(1, Peer(1, 0, frozenset({0})), Level.DRIVE)
READING = ("hello", "status", "strides", "map", "check", "failures")
SUBJECTS = {"drive": JOINTS, "watchdog": JOINTS, "joint": JOINTS, "bus": ("left", "right"), "flipper": FLIPPERS}


def every_fault() -> list[Fault]:
    return [kind.fault(subject) for kind in FaultKind for subject in SUBJECTS.get(kind.part, ("",))]


@pytest.fixture(scope="module")
def methods(configuration: Configuration) -> Methods:
    """Return the methods of a loop whose answers are as long as they can be."""
    robot = Direct(configuration, Track([(5.0, MUDS["48.5"])]))
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=True, strides=STRIDES))
    robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 60.0)
    for number in range(1000):
        robot.loop.timing.update(number * SLOW_S, SLOW_S, 0, SLOW_S)
    walked = [closed.estimate for closed in robot.loop.learning.strides]
    for piece in range(MOST_PIECES):
        robot.loop.learning.estimator.map.update((piece + 0.5) * PIECE_M, walked)
    robot.loop.faults.update(every_fault(), energised=False)
    calls = OperatorCalls(robot.loop, ["a warning about the operating system"] * 4, lambda: robot.now_s)
    failures = Failures(configuration.bus)
    return with_failures(
        calls.methods, failures, lambda now_s, text: None, lambda: robot.now_s, calls.require_own_robot
    )


def answer(methods: Methods, name: str) -> Any:
    return msgpack.packb([1, 1, None, methods[name]({}, CALLER)])


@pytest.mark.parametrize("name", READING)
def test_every_answer_is_bounded(methods: Methods, name: str) -> None:
    assert len(answer(methods, name)) <= LONGEST_BYTES


def test_the_map_is_read_page_by_page(methods: Methods) -> None:
    pieces: list[float] = []
    while page := methods["map"]({"after_m": pieces[-1]} if pieces else {}, CALLER):
        assert len(page) <= PIECES_PER_ANSWER
        pieces += [piece["place_m"] for piece in page]
    assert pieces == pytest.approx([(number + 0.5) * PIECE_M for number in range(MOST_PIECES)])


def test_the_strides_are_read_page_by_page(methods: Methods) -> None:
    first = methods["strides"]({}, CALLER)
    second = methods["strides"]({"since": first[-1]["number"] + 1}, CALLER)
    assert len(first) == STRIDES_PER_ANSWER and second
    assert [stride["number"] for stride in first + second] == list(range(len(first + second)))


def test_the_status_lists_the_faults_with_the_hardest_reactions(methods: Methods) -> None:
    status = methods["status"]({}, CALLER)
    assert len(status["faults"]) == FAULTS_PER_ANSWER
    assert status["faults_left_out"] == len(every_fault()) - FAULTS_PER_ANSWER
    assert {fault["reaction"] for fault in status["faults"]} <= {"drives_idle", "damping"}
    assert status["fault"] == status["faults"][0]
