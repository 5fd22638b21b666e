"""Motion that torque and path do not explain, on both sides of each bound, with a joint of known mechanics."""

from collections.abc import Callable
from math import copysign, pi, sin

import pytest

from control.faults import Fault
from control.monitors.motion_monitor import (
    AWAY_RAD,
    FASTEST_RAD_S,
    FOLLOWING_RAD,
    FOLLOWING_S,
    PUNCTUAL_S,
    RUNAWAY_RAD,
    SETTLING_S,
    JointDynamics,
    MotionMonitor,
)
from control.rate import PERIOD_S
from control.records import DriveState, JointTarget

TORQUE_NM = 0.75
DYNAMICS = JointDynamics(inertia_kg_m2=0.0004, stiffness_nm_rad=8.0)
DAMPING_NM_S = 0.06
STEPS = 100  # of the mechanics in a tick: their own error must be small compared with the bounds
Law = Callable[[float, float, float], float]  # (time, angle, velocity) -> torque


class Joint:
    """A joint without friction, whose motor exerts `fraction` of the torque of `delay_ticks` ago."""

    def __init__(self, fraction: float = 1.0, delay_ticks: int = 0, velocity_rad_s: float = 0.0) -> None:
        self.monitor = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM)
        self.fraction, self.delay_ticks = fraction, delay_ticks
        self.angle_rad, self.velocity_rad_s = 0.0, velocity_rad_s
        self.commanded_nm = [0.0]
        self.energy_j = 0.0
        self.now_s = 0.0

    def tick(self, torque_nm: float, load_nm: float = 0.0, target: JointTarget | None = None) -> list[Fault]:
        self.commanded_nm.append(torque_nm)
        given_nm = self.fraction * self.commanded_nm[max(0, len(self.commanded_nm) - 1 - self.delay_ticks)]
        for _ in range(STEPS):
            dt_s = PERIOD_S / STEPS
            self.velocity_rad_s += dt_s * (given_nm + load_nm) / DYNAMICS.inertia_kg_m2
            self.angle_rad += dt_s * self.velocity_rad_s
            self.energy_j += given_nm * dt_s * self.velocity_rad_s
        self.now_s += PERIOD_S
        found: list[Fault] = []
        state = DriveState(self.angle_rad, self.velocity_rad_s, self.now_s)
        self.monitor.update(found, state, PERIOD_S, torque_nm, target)
        return found

    def run(self, law: Law, duration_s: float, load_nm: float = 0.0, target_rad: float | None = None) -> list[str]:
        """Return the names of the first tick's faults, or none after `duration_s`."""
        target = JointTarget(target_rad, 0.0) if target_rad is not None else None
        while self.now_s < duration_s:
            torque_nm = min(max(law(self.now_s, self.angle_rad, self.velocity_rad_s), -TORQUE_NM), TORQUE_NM)
            found = self.tick(torque_nm, load_nm, target)
            if found:
                return [fault.name for fault in found]
        return []


def damping(now_s: float, angle_rad: float, velocity_rad_s: float) -> float:
    return -DAMPING_NM_S * velocity_rad_s


def holding(now_s: float, angle_rad: float, velocity_rad_s: float) -> float:
    return -DYNAMICS.stiffness_nm_rad * angle_rad - DAMPING_NM_S * velocity_rad_s


def test_damping_torque_that_accelerates_a_joint_is_found_before_it_gave_the_bound() -> None:
    joint = Joint(fraction=-1.0, velocity_rad_s=0.5)
    assert joint.run(damping, 1.0) == ["joint_runaway"]
    assert joint.energy_j < RUNAWAY_RAD * TORQUE_NM


def test_damping_that_brakes_a_fast_joint_is_no_runaway() -> None:
    assert Joint(velocity_rad_s=20.0).run(damping, 1.0) == []


def test_an_inverted_motor_that_holds_a_pose_is_found() -> None:
    joint = Joint(fraction=-1.0)
    joint.angle_rad = 0.001
    assert joint.run(holding, 1.0) == ["joint_runaway"]
    assert joint.energy_j < RUNAWAY_RAD * TORQUE_NM


@pytest.mark.parametrize("speed_rad_s", [0.5, 1.0])
def test_a_weight_that_is_lowered_at_the_speed_of_a_path_is_no_runaway(speed_rad_s: float) -> None:
    load_nm = TORQUE_NM / 2.0
    joint = Joint(velocity_rad_s=speed_rad_s)
    assert joint.run(lambda *motion: -load_nm, 1.0, load_nm) == []
    assert joint.angle_rad == pytest.approx(speed_rad_s, rel=0.01)


def test_a_weight_that_falls_against_the_torque_is_a_runaway() -> None:
    assert Joint().run(lambda *motion: -0.2, 1.0, load_nm=0.6) == ["joint_runaway"]


def test_free_swinging_at_full_torque_is_explained_by_the_command() -> None:
    assert Joint().run(lambda now_s, *motion: TORQUE_NM * sin(2.0 * pi * 15.0 * now_s), 2.0) == []


def test_a_pose_held_with_commands_that_come_late_is_found() -> None:
    joint = Joint(delay_ticks=4)
    joint.angle_rad = 0.01
    (first, *_) = joint.run(holding, 1.0, target_rad=0.0)
    assert first in ("joint_runaway", "joint_oscillating")
    assert joint.energy_j < 0.5


def path_of(monitor: MotionMonitor, angles_rad: list[float], target_rad: Callable[[int], float]) -> list[Fault]:
    found: list[Fault] = []
    for tick, angle_rad in enumerate(angles_rad):
        state = DriveState(angle_rad, 0.0, tick * PERIOD_S)
        monitor.update(found, state, PERIOD_S, 0.0, JointTarget(target_rad(tick), 0.0))
    return found


def test_a_joint_that_swings_about_its_held_pose_is_found_by_its_path() -> None:
    angles_rad = [0.15 * sin(2.0 * pi * 20.0 * tick * PERIOD_S) for tick in range(100)]
    found = path_of(MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), angles_rad, lambda tick: 0.0)
    assert {fault.name for fault in found} == {"joint_oscillating"}
    assert float(dict(found[0].values)["away_rad"]) > AWAY_RAD


def test_a_slow_push_and_its_return_are_no_oscillation() -> None:
    angles_rad = [0.2 * sin(2.0 * pi * 0.5 * tick * PERIOD_S) for tick in range(760)]
    assert not path_of(MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), angles_rad, lambda tick: 0.0)


def test_a_joint_that_lags_behind_and_then_catches_up_does_not_move_away() -> None:
    stuck = [0.0] * 100
    freed = [min(0.02 * tick, 0.25) for tick in range(50)]
    monitor = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM)
    assert not path_of(monitor, stuck + freed, lambda tick: min(0.0025 * tick, 0.25))
    assert monitor.away_rad < 0.01


@pytest.mark.parametrize("velocity_rad_s", [0.0, 4.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_following_error_may_grow_with_the_commanded_speed(velocity_rad_s: float, side: float) -> None:
    most_rad = FOLLOWING_RAD + TORQUE_NM / DYNAMICS.stiffness_nm_rad + FOLLOWING_S * velocity_rad_s
    for error_rad, expected in ((most_rad - 1e-6, set()), (most_rad + 1e-6, {"following_error"})):
        monitor, found = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), list[Fault]()
        target = JointTarget(0.1 + side * error_rad, copysign(velocity_rad_s, side))
        for tick in range(3):
            monitor.update(found, DriveState(0.1, 0.0, tick * PERIOD_S), PERIOD_S, 0.0, target)
        assert {fault.name for fault in found} == expected


def test_without_stiffness_there_is_no_path_to_follow() -> None:
    joint = Joint(velocity_rad_s=10.0)
    assert [joint.tick(0.0) for _ in range(100)] == [[]] * 100
    endless = MotionMonitor("left_sweep", JointDynamics(stiffness_nm_rad=0.0), TORQUE_NM)
    assert not path_of(endless, [0.0] * 3, lambda tick: 3.0)


def test_a_gap_between_two_samples_explains_any_motion() -> None:
    joint = Joint()
    joint.tick(0.0)
    joint.angle_rad, joint.now_s = 0.5, 1.0
    found: list[Fault] = []
    joint.monitor.update(found, DriveState(0.5, 0.0, 1.0), 0.03, TORQUE_NM, None)
    assert not found and joint.monitor.unexplained_j == 0.0


@pytest.mark.parametrize(("gap_s", "counts"), [(PUNCTUAL_S - 1e-6, True), (PUNCTUAL_S + 1e-6, False)])
def test_after_a_late_command_the_path_counts_only_when_the_joint_has_settled(gap_s: float, counts: bool) -> None:
    monitor, late = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), list[Fault]()
    held = JointTarget(0.0, 0.0)
    monitor.update(late, DriveState(0.0, 0.0, 1.0), PERIOD_S, 0.0, held)
    monitor.update(late, DriveState(0.6, 0.0, 1.0 + gap_s), gap_s, 0.0, held)
    assert {fault.name for fault in late} == ({"joint_oscillating", "following_error"} if counts else set())
    for tick in range(1, round(SETTLING_S / PERIOD_S) + 10):
        settled = list[Fault]()
        monitor.update(settled, DriveState(0.6, 0.0, 2.0 + tick * PERIOD_S), PERIOD_S, 0.0, held)
    assert {fault.name for fault in settled} == {"following_error"}


def test_a_speed_that_no_joint_has_is_no_energy() -> None:
    monitor, found = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), list[Fault]()
    for tick, velocity_rad_s in enumerate((0.0, 2.0 * FASTEST_RAD_S, 3e38, float("inf"), float("nan"), 0.0)):
        monitor.update(found, DriveState(0.0, velocity_rad_s, tick * PERIOD_S), PERIOD_S, 0.0, None)
    assert not found and monitor.unexplained_j == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("rate_rad_s", [0.05, 0.3, 1.0])
def test_a_joint_at_its_stop_whose_encoder_slips_with_its_speed_is_found(sign: float, rate_rad_s: float) -> None:
    """A target that stands still excuses less than 90 % of the limit: a hand may push the joint."""
    monitor, pressed_s, now_s = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), 0.0, 0.0
    found: list[Fault] = []
    while not found and now_s < 10.0:
        now_s += PERIOD_S
        angle_rad = -sign * rate_rad_s * now_s
        torque_nm = min(max(-DYNAMICS.stiffness_nm_rad * angle_rad, -TORQUE_NM), TORQUE_NM)
        pressed_s += PERIOD_S if abs(torque_nm) >= 0.3 else 0.0
        state = DriveState(angle_rad, -sign * rate_rad_s, now_s)
        monitor.update(found, state, PERIOD_S, torque_nm, JointTarget(0.0, 0.0))
    excused_s = (0.9 * TORQUE_NM - 0.3) / DYNAMICS.stiffness_nm_rad / rate_rad_s
    assert found[0].name in ("joint_driven_back", "following_error") and pressed_s < 0.4 + excused_s


@pytest.mark.parametrize("follows", [True, False], ids=["a swing", "a recovery"])
@pytest.mark.parametrize(("torque_nm", "is_found"), [(-0.95 * TORQUE_NM, True), (-0.85 * TORQUE_NM, False)])
def test_a_target_that_moves_with_the_joint_does_not_explain_a_path_against_full_torque(
    torque_nm: float, is_found: bool, follows: bool
) -> None:
    monitor, found = MotionMonitor("left_sweep", DYNAMICS, TORQUE_NM), list[Fault]()
    for tick in range(round(0.4 / PERIOD_S)):
        now_s = tick * PERIOD_S
        target = JointTarget(0.3 * now_s - 0.1, 0.3) if follows else None
        monitor.update(found, DriveState(0.3 * now_s, 0.3, now_s), PERIOD_S, torque_nm, target)
    assert {fault.name for fault in found} == ({"joint_driven_back"} if is_found else set())


def test_a_load_that_a_held_joint_yields_to_and_a_path_that_lowers_it_are_healthy() -> None:
    assert Joint().run(holding, 3.0, load_nm=0.6, target_rad=0.0) == []
    joint = Joint(velocity_rad_s=0.5)
    joint.angle_rad = lag_rad = 0.05
    while joint.now_s < 2.0:
        target = JointTarget(joint.now_s * 0.5, 0.5)
        torque_nm = DYNAMICS.stiffness_nm_rad * (target.angle_rad - joint.angle_rad) + DAMPING_NM_S * (
            target.velocity_rad_s - joint.velocity_rad_s
        )
        assert joint.tick(torque_nm, DYNAMICS.stiffness_nm_rad * lag_rad, target) == []
