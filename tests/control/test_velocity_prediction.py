"""The present velocity is recovered from answers of a tick ago; a joint in stiff mud does not oscillate with it."""

import pytest

from control.joint_pd import VelocityPrediction
from control.parameters.arm_mass import ArmMass
from control.rate import PERIOD_S
from control.records import DriveState, Joints, same_for_all

MASS = ArmMass()
ALL = (True,) * 4
NONE = same_for_all(0.0)


def test_a_prediction_is_exact_for_any_torques_against_a_steady_load_and_for_asked_drives_alone() -> None:
    """The drives measure when a torque arrives; the load is what the mud and the weight pull."""
    prediction, loads_nm = VelocityPrediction((True, True, True, False), MASS), (0.1, -0.2, 0.05, 0.3)
    inertias_kg_m2 = (MASS.sweep_inertia_kg_m2, MASS.adduction_inertia_kg_m2) * 2
    velocities_rad_s, sent_nm = [1.0, -2.0, 0.0, 3.0], NONE
    answers = Joints(*(DriveState(0.0, velocity, angle_stamp_s=0.0) for velocity in velocities_rad_s))
    for tick, torque_nm in enumerate((0.3, -0.4, 0.7, 0.1), 1):
        present = prediction.update(answers, sent_nm)
        if tick > 2:
            assert [state.velocity_rad_s for state in present[:3]] == pytest.approx(velocities_rad_s[:3])
            assert present[3] is answers[3] and present[0].angle_rad == answers[0].angle_rad
        answers = Joints(*(DriveState(0.0, each, angle_stamp_s=tick * PERIOD_S) for each in velocities_rad_s))
        sent_nm = Joints(torque_nm, -torque_nm, 2.0 * torque_nm, 0.0)
        for index, (sent, load_nm) in enumerate(zip(sent_nm, loads_nm, strict=True)):
            velocities_rad_s[index] += PERIOD_S * (sent - load_nm) / inertias_kg_m2[index]


@pytest.mark.parametrize("elapsed_s", [0.51 * PERIOD_S, 1.49 * PERIOD_S])
def test_the_acceleration_is_that_of_the_time_between_two_answers(elapsed_s: float) -> None:
    prediction, slow = VelocityPrediction(ALL, MASS), DriveState(0.1, 1.0, angle_stamp_s=1.0, current_a=2.0)
    prediction.update(same_for_all(slow), NONE)
    faster = slow._replace(velocity_rad_s=1.0 + 100.0 * elapsed_s, angle_stamp_s=1.0 + elapsed_s)
    present = prediction.update(same_for_all(faster), NONE)[0]
    assert present.velocity_rad_s == pytest.approx(1.0 + 100.0 * (elapsed_s + PERIOD_S))
    assert present._replace(velocity_rad_s=faster.velocity_rad_s) == faster


@pytest.mark.parametrize("gap_s", [0.0, 0.5 * PERIOD_S, 1.5 * PERIOD_S, 5.0 * PERIOD_S])
def test_nothing_is_predicted_from_a_repeated_answer_or_over_a_gap(gap_s: float) -> None:
    prediction, still = VelocityPrediction(ALL, MASS), DriveState(0.1, 0.0, angle_stamp_s=0.0)
    prediction.update(same_for_all(still), NONE)
    fast = still._replace(velocity_rad_s=3.0, angle_stamp_s=gap_s)
    assert prediction.update(same_for_all(fast), same_for_all(0.5))[0].velocity_rad_s == 3.0
