"""What a tiny torque shows of each joint: that motor and encoder agree, and that the current is the commanded one."""

from collections.abc import Sequence
from functools import partial

from experiments.bench.measured_check import measure_check
from experiments.bench.sign_check import check_nudge
from experiments.bench.step_response import check_step_response
from experiments.bench.test_rig import TestRig
from experiments.calibration.joint_picture import draw_joint
from experiments.robot.bench_errors import BenchError, EndedError
from experiments.robot.steps import OperatorStep
from experiments.study.notebook import Entry
from experiments.study.prompt import GO_ON

ON_BLOCKS = (
    "{picture}\n{joint} is shaken and moves a little, with at most 0.2 N·m, then to and fro by a few degrees. The robot"
    " stands on blocks, its flippers lie on something soft. Nobody's hands are near them, and the power switch is at"
    " hand."
)
CHECKS = (check_nudge, check_step_response)


def torque_key(joint: str) -> str:
    return f"{joint}: torque"


def torque_steps(test_rig: TestRig, joints: Sequence[str]) -> list[OperatorStep]:
    return [
        OperatorStep(torque_key(joint), partial(_ask, test_rig, joint), partial(_measure, test_rig, joint))
        for joint in joints
    ]


def _ask(test_rig: TestRig, joint: str) -> str:
    """Raises EndedError where the operator does not allow motion."""
    question = ON_BLOCKS.format(picture=draw_joint(joint), joint=joint)
    if not test_rig.operator.allows_motion(question, test_rig.run_during_prompt):
        raise EndedError("nothing moved; the same command continues here")
    return GO_ON


def _measure(test_rig: TestRig, joint: str) -> Entry:
    """Raises BenchError with what is wrong, and what to do about it."""
    entry: Entry = {"readings": []}
    for check in CHECKS:
        measured = measure_check(test_rig, check, joint)
        if measured.problem:
            raise BenchError(measured.problem)
        entry["readings"] += [reading.as_json for reading in measured.readings]
    return entry
