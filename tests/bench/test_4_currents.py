"""Stage 4: from a command to the current that answers it."""

from control.records import JOINTS
from experiments.step_response import step_response
from tests.bench.staged_bench import StagedBench

MOVES = "the flippers rise until they are level, and each joint trembles by 2 degrees."


def test_currents_answer_commands_in_time_and_in_full(bench: StagedBench) -> None:
    with bench.raised() as stand:
        for joint in JOINTS:
            bench.check(step_response(stand, joint))
