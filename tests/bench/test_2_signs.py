"""Stage 2: the first torque, one joint after the other."""

import pytest

from control.records import JOINTS
from experiments.bench.sign_check import check_nudge, check_shown_motion
from tests.bench.staged_bench import StagedBench

MOVES = "each joint is shaken and moves a little, with at most 0.2 N·m, then by 12 degrees; watch which one, and how."


@pytest.mark.parametrize("joint", JOINTS)
def test_a_tiny_torque_moves_that_joint_alone_and_its_signs_agree(bench: StagedBench, joint: str) -> None:
    bench.check(check_nudge, joint)


@pytest.mark.parametrize("joint", JOINTS)
def test_the_operator_sees_the_right_flipper_move_in_the_right_direction(bench: StagedBench, joint: str) -> None:
    bench.check(check_shown_motion, joint)
