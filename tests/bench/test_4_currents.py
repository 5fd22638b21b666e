"""Stage 4: from a command to the current that answers it."""

import pytest

from control.records import JOINTS
from experiments.bench.step_response import step_response
from tests.bench.staged_bench import StagedBench

MOVES = "the flippers go on lying, and each joint trembles by a few degrees, with 0.08 N·m."


@pytest.mark.parametrize("joint", JOINTS)
def test_a_current_answers_its_command_in_time_and_in_full(bench: StagedBench, joint: str) -> None:
    bench.check(step_response, joint)
