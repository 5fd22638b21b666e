"""The published energy bounds follow from torque, speed and time, and no healthy motion of full torque exceeds them."""

from dataclasses import replace

import pytest

from control.faults import Fault, FaultKind, Reaction
from control.monitors.motion_monitor import JointDynamics, MotionMonitor
from control.rate import PERIOD_S
from control.records import DriveState
from experiments.trials.trial import WALKING, configuration_of
from verification.faults.energy_bounds import STOPPING, WATCHDOG_TICKS, energy_bounds

CONFIGURATION = configuration_of(WALKING)
BOUNDS = energy_bounds(CONFIGURATION)


def test_a_motor_at_full_torque_and_speed_until_the_drives_idle_stays_within_the_bound() -> None:
    duration_s = (10 + 2) * PERIOD_S
    assert BOUNDS.stopping_j(10, Reaction.DRIVES_IDLE) >= BOUNDS.torque_nm * BOUNDS.speed_rad_s * duration_s


def test_a_joint_that_speeds_up_from_rest_at_full_torque_stays_within_the_bound() -> None:
    for ticks in (1, 5, 12, 30):
        turned_rad = 0.5 * BOUNDS.torque_nm / BOUNDS.inertia_kg_m2 * (ticks * PERIOD_S) ** 2
        if turned_rad < 3.4:  # beyond this it is at its end stop
            assert BOUNDS.torque_nm * turned_rad <= BOUNDS.stopping_j(ticks, Reaction.DRIVES_IDLE)


@pytest.mark.parametrize("kind", [kind for kind in FaultKind if kind.reaction in STOPPING])
def test_later_detection_and_more_torque_never_lower_the_bound(kind: FaultKind) -> None:
    ticks = kind.bound_ticks
    assert BOUNDS.stopping_j(ticks, kind.reaction) <= BOUNDS.stopping_j(ticks + 1, kind.reaction)
    assert BOUNDS.fault_j(kind) < replace(BOUNDS, torque_nm=2.0 * BOUNDS.torque_nm).fault_j(kind)


def test_a_drive_that_hears_nothing_may_exert_torque_until_its_watchdog_ends_it() -> None:
    unheard = BOUNDS.stopping_j(WATCHDOG_TICKS, Reaction.DAMPING)
    assert BOUNDS.fault_j(FaultKind.DRIVE_QUIET) == unheard > BOUNDS.fault_j(FaultKind.POSITION_STALE)


def test_an_inverted_motor_in_mud_of_any_strength_is_found_within_its_energy() -> None:
    """The mud takes all work, so the joint has no speed; the motor works at constant power until it is found."""
    dynamics, ticks = JointDynamics(BOUNDS.inertia_kg_m2, 8.0), FaultKind.JOINT_RUNAWAY.bound_ticks
    for power_w in (1.4, 2.0, 5.0, 15.0):  # less takes longer than the fault's ticks
        monitor, done_j = MotionMonitor("left_sweep", dynamics, BOUNDS.torque_nm), 0.0
        found: list[Fault] = []
        for tick in range(1, ticks):
            step_rad = power_w * PERIOD_S / BOUNDS.torque_nm
            state = DriveState(angle_rad=tick * step_rad, velocity_rad_s=0.0, angle_stamp_s=tick * PERIOD_S)
            monitor.update(found, state, PERIOD_S, -BOUNDS.torque_nm, None)
            done_j += BOUNDS.torque_nm * step_rad
            if found:
                assert done_j < BOUNDS.fault_j(FaultKind.JOINT_RUNAWAY)
                break
        assert found


def test_the_bound_of_a_walk_grows_with_its_strides() -> None:
    first_j, second_j = BOUNDS.walking_j(BOUNDS.stride_s), BOUNDS.walking_j(2.0 * BOUNDS.stride_s)
    assert second_j - first_j == pytest.approx(BOUNDS.torque_nm * BOUNDS.stride_rad)
