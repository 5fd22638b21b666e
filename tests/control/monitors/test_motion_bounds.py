"""The exact value of each bound of a joint's motion is allowed, and each sum is the one of its formula."""

from __future__ import annotations

import pytest

from control.faults import Fault
from control.monitors import motion_monitor
from control.monitors.motion_monitor import JointDynamics, MotionMonitor
from control.records import DriveState, JointTarget

TICK_S = 0.002


class Samples:
    """A motion monitor with a clock; `add` returns the names of the faults of one sample."""

    def __init__(self, torque_limit_nm: float = 0.75, inertia_kg_m2: float = 0.0004) -> None:
        self.monitor = MotionMonitor("left_sweep", JointDynamics(inertia_kg_m2, 8.0), torque_limit_nm)
        self.now_s = 1.0

    def add(
        self,
        angle_rad: float = 0.0,
        velocity_rad_s: float = 0.0,
        target_rad: float | None = None,
        dt_s: float = TICK_S,
        torque_nm: float = 0.0,
    ) -> set[str]:
        self.now_s += dt_s
        found: list[Fault] = []
        target = None if target_rad is None else JointTarget(target_rad, 0.0)
        state = DriveState(angle_rad, velocity_rad_s, self.now_s)
        self.monitor.update(found, state, dt_s, torque_nm, target)
        return {fault.name for fault in found}


def test_the_bounds_are_those_that_the_reference_publishes() -> None:
    names = ("RUNAWAY_RAD", "RUNAWAY_LEAK_S", "RUNAWAY_FLOOR_J", "AWAY_RAD", "AWAY_LEAK_S", "FOLLOWING_RAD")
    times = ("FOLLOWING_S", "LONGEST_GAP_S", "PUNCTUAL_S", "SETTLING_S", "FASTEST_RAD_S")
    values = (0.2, 0.2, 0.02, 0.5, 0.3, 0.2, 0.05, 0.03, 0.012, 0.3, 1000.0)
    assert tuple(getattr(motion_monitor, name) for name in names + times) == values
    assert JointDynamics() == (0.0004, 8.0)


# energy


@pytest.mark.parametrize(("velocity_rad_s", "expected"), [(1.0, set()), (1.001, {"joint_runaway"})])
def test_a_joint_may_have_exactly_the_energy_of_the_bound(velocity_rad_s: float, expected: set[str]) -> None:
    samples = Samples(torque_limit_nm=5.0, inertia_kg_m2=2.0)  # 0.2 rad · 5 N·m = ½ · 2 kg·m² · (1 rad/s)²
    samples.add()
    assert samples.add(velocity_rad_s=velocity_rad_s) == expected


def test_the_torque_of_ticks_without_a_new_sample_counts() -> None:
    samples = Samples()
    samples.add()
    for _ in range(2):
        samples.monitor.update([], DriveState(0.0, 0.0, samples.now_s), TICK_S, 0.6, None)
    samples.add(0.3, 30.0)  # ½ · 0.0004 · 30² = 0.18 J
    assert samples.monitor.unexplained_j == pytest.approx(0.18 - 2.0 / 3.0 * 0.6 * 0.3)


@pytest.mark.parametrize("dt_s", [0.03, 0.05])
def test_over_a_gap_of_the_longest_time_no_energy_is_added(dt_s: float) -> None:
    samples = Samples()
    samples.add()
    assert samples.add(velocity_rad_s=50.0, dt_s=dt_s) == set()
    assert samples.monitor.unexplained_j == 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_sample_at_or_beyond_the_fastest_speed_is_no_measurement(side: float) -> None:
    for angle_rad, velocity_rad_s in ((0.0, 1000.0), (2.0, 0.0), (3.0, 0.0)):  # 1000 rad/s for 2 ms
        samples = Samples()
        samples.add()
        assert samples.add(side * angle_rad, side * velocity_rad_s, torque_nm=-side * 0.75) == set()
        assert samples.monitor.unexplained_j == 0.0


# path away from the target


def test_a_joint_may_move_away_by_exactly_the_bound() -> None:
    samples = Samples()
    samples.add(target_rad=0.0)
    assert samples.add(0.25, target_rad=0.0) == set()  # the path plus the growth of the error
    assert samples.monitor.away_rad == 0.5


def test_the_path_away_is_that_of_the_joint_less_that_of_its_target_and_the_growth_of_the_error() -> None:
    samples = Samples()
    samples.add(0.5, target_rad=0.5)
    samples.add(0.6, target_rad=0.5)
    assert samples.monitor.away_rad == pytest.approx(0.2)
    samples = Samples()
    samples.add(0.5, target_rad=0.4)
    samples.add(0.6, target_rad=0.45)
    assert samples.monitor.away_rad == pytest.approx(0.1 - 0.05 + 0.05)


def test_a_target_that_comes_towards_a_joint_does_not_reduce_its_path_away() -> None:
    samples = Samples()
    samples.add(0.0, target_rad=0.25)
    samples.add(0.0, target_rad=0.0)
    assert samples.add(0.26, target_rad=0.0) == {"joint_oscillating"}


def test_a_path_away_begins_with_the_second_sample_that_has_a_target() -> None:
    samples = Samples()
    for target_rad in (None, 0.2, None, 0.2):
        assert samples.add(0.1, target_rad=target_rad) == set()
        assert samples.monitor.away_rad == 0.0


# lateness


def test_a_sample_that_is_late_by_exactly_the_bound_begins_the_wait() -> None:
    samples = Samples()
    samples.add(target_rad=0.0)
    assert samples.add(0.3, target_rad=0.0, dt_s=0.012) == set()


def test_the_path_away_before_a_gap_is_forgotten() -> None:
    samples = Samples()
    samples.add(target_rad=0.0)
    samples.add(0.15, target_rad=0.0)
    samples.add(0.15, target_rad=0.0, dt_s=0.02)
    for _ in range(152):
        samples.add(0.15, target_rad=0.0)
    assert samples.add(0.3, target_rad=0.0) == {"following_error"}
    assert samples.monitor.away_rad == pytest.approx(0.3)


def test_a_joint_counts_as_settled_exactly_at_the_end_of_its_time() -> None:
    samples = Samples()
    samples.add(target_rad=0.0)
    samples.add(target_rad=0.0, dt_s=0.02)
    settled_s = 0.0
    for _ in range(29):
        settled_s += 0.01
        samples.add(target_rad=0.0, dt_s=0.01)
    assert settled_s + (0.3 - settled_s) == 0.3
    assert samples.add(0.3, target_rad=0.0, dt_s=0.3 - settled_s) == {"joint_oscillating", "following_error"}


def test_a_joint_may_lag_by_exactly_the_bound() -> None:
    samples, error_rad = Samples(), 0.2 + 0.75 / 8.0
    assert samples.add(target_rad=error_rad) == set()
    assert samples.add(target_rad=error_rad + 1e-9) == {"following_error"}


def test_next_to_another_fault_each_bound_is_allowed_exactly_too() -> None:
    samples = Samples(torque_limit_nm=5.0, inertia_kg_m2=2.0)
    samples.add(target_rad=1.0)
    assert samples.add(velocity_rad_s=1.0, target_rad=1.0) == {"following_error"}
    samples = Samples()
    samples.add(0.125, target_rad=0.0)
    assert samples.add(0.375, target_rad=0.0) == {"following_error"}
    samples = Samples()
    samples.add(target_rad=0.0)
    assert samples.add(0.2 + 0.75 / 8.0, target_rad=0.0) == {"joint_oscillating"}
