"""The delay from a command to its current, reckoned over ticks that came and ticks that did not."""

from __future__ import annotations

import pytest

from control.modes import Mode
from control.rate import PERIOD_S
from control.records import NO_TORQUE, DriveState, Joints, Torques
from experiments.bench.step_response import LONGEST_TICKS, PULSE_NM, delay_ticks
from experiments.bench.test_rig import Sample
from firmware_host.ticker import Tick

CONSTANT_NM_A = 0.083
STEP = 2  # the sample that sends it
SENT: Torques = Joints(PULSE_NM, 0.0, 0.0, 0.0)


def made_up(answer: int, numbers: list[int]) -> list[Sample]:
    """A current that follows from sample `answer` on, at the ticks of these numbers."""
    rest, following = DriveState(), DriveState(current_a=PULSE_NM / CONSTANT_NM_A)
    return [
        Sample(
            Tick(number * PERIOD_S, 0.0, number, 0),
            Mode.HOLD,
            Joints(following if index >= answer else rest, rest, rest, rest),
            None,
            SENT if index >= STEP else NO_TORQUE,
            False,
        )
        for index, number in enumerate(numbers)
    ]


@pytest.mark.parametrize("delay", [1, 2, 3, LONGEST_TICKS - 1])
def test_it_is_the_ticks_from_the_command_to_its_current(delay: int) -> None:
    samples = made_up(STEP + delay, list(range(20)))
    assert delay_ticks(samples, 0, STEP, CONSTANT_NM_A) == delay


def test_a_tick_that_is_missed_meanwhile_is_one_of_the_delay() -> None:
    samples = made_up(STEP + 1, [0, 1, 2, 4, *range(5, 20)])
    assert delay_ticks(samples, 0, STEP, CONSTANT_NM_A) == 2


def test_a_current_that_does_not_answer_counts_as_the_longest() -> None:
    assert delay_ticks(made_up(20, list(range(20))), 0, STEP, CONSTANT_NM_A) == LONGEST_TICKS


def test_a_pause_longer_than_that_counts_as_the_longest() -> None:
    samples = made_up(STEP + 1, [0, 1, 2, *range(50, 67)])
    assert delay_ticks(samples, 0, STEP, CONSTANT_NM_A) == LONGEST_TICKS
