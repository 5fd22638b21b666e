"""No answer of the socket is long, even with every fault present, because it is computed between two ticks."""

from __future__ import annotations

import pytest

from estimation.mud_map import MOST_PIECES, PIECE_M
from firmware_host.sockets.socket_methods import FAULTS_PER_ANSWER, PIECES_PER_ANSWER, STRIDES_PER_ANSWER
from firmware_host.sockets.status_socket import Methods
from verification.speed.serving_time import CALLER, READING, answer, every_fault, fullest_methods

LONGEST_BYTES = 24 * 1024  # the time of an answer grows with its length: verification.speed.serving_time


@pytest.fixture(scope="module")
def methods() -> Methods:
    return fullest_methods()


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
