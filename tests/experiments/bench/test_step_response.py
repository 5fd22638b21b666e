"""The delay from a command to its current counts ticks, including missed ones."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from control.modes import Mode
from control.rate import PERIOD_S
from control.records import DriveState, Joints, Torques
from experiments.bench.step_response import LONGEST_TICKS, PULSE_NM, delay_ticks
from experiments.bench.test_rig import Sample
from firmware_host.ticker import Tick
from tests.control.synthetic_states import NO_TORQUE

CONSTANT_NM_A = 0.083
STEP = 2  # the sample that sends it
SENT: Torques = Joints(PULSE_NM, 0.0, 0.0, 0.0)


def synthetic_samples(answer: int, numbers: Sequence[int]) -> list[Sample]:
    """Return samples at the ticks of these numbers; the current answers from sample `answer` on."""
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


@pytest.mark.parametrize(
    ("answer", "numbers", "delay"),
    [
        *((STEP + delay, range(20), delay) for delay in (1, 2, 3, LONGEST_TICKS - 1)),
        (STEP + 1, (0, 1, 2, 4, *range(5, 20)), 2),  # a missed tick counts
        (20, range(20), LONGEST_TICKS),  # no answer
        (STEP + 1, (0, 1, 2, *range(50, 67)), LONGEST_TICKS),  # a pause
    ],
)
def test_the_delay_is_the_ticks_from_the_command_to_its_current(
    answer: int, numbers: Sequence[int], delay: int
) -> None:
    assert delay_ticks(synthetic_samples(answer, numbers), 0, STEP, CONSTANT_NM_A) == delay
