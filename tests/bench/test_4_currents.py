"""Stage 4: the delay from a command to its current."""

import pytest

from control.records import JOINTS
from experiments.bench.step_response import check_step_response
from tests.bench.staged_bench import StagedBench

MOVES = "the flippers stay down, and each joint moves to and fro by a few degrees, with 0.08 N·m."


@pytest.mark.parametrize("joint", JOINTS)
def test_a_current_answers_its_command_in_time_and_in_full(bench: StagedBench, joint: str) -> None:
    bench.check(check_step_response, joint)
