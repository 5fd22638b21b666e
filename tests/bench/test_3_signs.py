"""Stage 3: the first torque, one joint after the other."""

import pytest

from control.records import JOINTS
from experiments.bench.sign_check import check_nudge
from tests.bench.staged_bench import StagedBench

MOVES = "each joint is shaken and moves a little, with at most 0.2 N·m."


@pytest.mark.parametrize("joint", JOINTS)
def test_a_tiny_torque_moves_that_joint_alone_and_its_signs_agree(bench: StagedBench, joint: str) -> None:
    bench.check(check_nudge, joint)
