"""Motion that torque and path do not explain: a joint of known mechanics, and each bound and sum from both sides."""

from collections.abc import Callable
from math import copysign, cos, inf, nan, nextafter, pi, sin
from typing import Any, NamedTuple

import pytest

from control.faults import Fault
from control.monitors import motion_monitor
from control.monitors.motion_monitor import AWAY_RAD, PROBE_NM, RUNAWAY_RAD, JointDynamics, MotionMonitor
from control.rate import PERIOD_S
from control.records import DriveState, JointTarget

TORQUE_NM = 0.75
DYNAMICS = JointDynamics(inertia_kg_m2=0.0004, stiffness_nm_rad=8.0)
DAMPING_NM_S = 0.06
STEPS = 100  # of the mechanics in a tick: their own error must be small compared with the bounds
Law = Callable[[float, float, float], float]  # (time, angle, velocity) -> torque


class Samples:
    """A motion monitor with a clock; `add` returns the names of the faults of one sample."""

    def __init__(self, torque_limit_nm: float = TORQUE_NM, dynamics: JointDynamics = DYNAMICS) -> None:
        self.monitor = MotionMonitor("left_sweep", dynamics, torque_limit_nm)
        self.now_s = 1.0
        self.faults: list[Fault] = []

    def add(
        self,
        angle_rad: float = 0.0,
        velocity_rad_s: float = 0.0,
        target_rad: float | None = None,
        dt_s: float = 0.002,
        torque_nm: float = 0.0,
        target_rad_s: float = 0.0,
        braked: bool = False,
    ) -> set[str]:
        self.now_s += dt_s
        found: list[Fault] = []
        target = None if target_rad is None else JointTarget(target_rad, target_rad_s)
        self.monitor.update(found, DriveState(angle_rad, velocity_rad_s, self.now_s), dt_s, torque_nm, target, braked)
        self.faults += found
        return {fault.name for fault in found}

    @property
    def names(self) -> set[str]:
        return {fault.name for fault in self.faults}


class Joint(Samples):
    """A joint without friction, whose motor exerts `fraction` of the torque of `delay_ticks` ago."""

    def __init__(
        self, fraction: float = 1.0, delay_ticks: int = 0, angle_rad: float = 0.0, velocity_rad_s: float = 0.0
    ) -> None:
        super().__init__()
        self.fraction, self.delay_ticks = fraction, delay_ticks
        self.angle_rad, self.velocity_rad_s = angle_rad, velocity_rad_s
        self.commanded_nm, self.inertia_kg_m2 = [0.0], DYNAMICS.inertia_kg_m2
        self.energy_j = 0.0

    def tick(
        self, torque_nm: float, load_nm: float = 0.0, target_rad: float | None = None, target_rad_s: float = 0.0
    ) -> set[str]:
        self.commanded_nm.append(torque_nm)
        given_nm = self.fraction * self.commanded_nm[max(0, len(self.commanded_nm) - 1 - self.delay_ticks)]
        for _ in range(STEPS):
            dt_s = PERIOD_S / STEPS
            self.velocity_rad_s += dt_s * (given_nm + load_nm) / self.inertia_kg_m2
            self.angle_rad += dt_s * self.velocity_rad_s
            self.energy_j += given_nm * dt_s * self.velocity_rad_s
        braked = target_rad is None
        return self.add(self.angle_rad, self.velocity_rad_s, target_rad, PERIOD_S, torque_nm, target_rad_s, braked)

    def run(self, law: Law, duration_s: float, load_nm: float = 0.0, target_rad: float | None = None) -> set[str]:
        """Return the names of the first tick's faults, or none after `duration_s`."""
        for tick in range(round(duration_s / PERIOD_S)):
            torque_nm = law(tick * PERIOD_S, self.angle_rad, self.velocity_rad_s)
            found = self.tick(min(max(torque_nm, -TORQUE_NM), TORQUE_NM), load_nm, target_rad)
            if found:
                return found
        return set()


def damping(now_s: float, angle_rad: float, velocity_rad_s: float) -> float:
    return -DAMPING_NM_S * velocity_rad_s


def holding(now_s: float, angle_rad: float, velocity_rad_s: float) -> float:
    return -DYNAMICS.stiffness_nm_rad * angle_rad - DAMPING_NM_S * velocity_rad_s


def lowering(now_s: float, angle_rad: float, velocity_rad_s: float) -> float:
    return -TORQUE_NM / 2.0


def shaking(now_s: float, angle_rad: float, velocity_rad_s: float) -> float:
    return TORQUE_NM * sin(2.0 * pi * 15.0 * now_s)


def test_the_bounds_are_those_that_the_reference_publishes() -> None:
    names = ("RUNAWAY_RAD", "RUNAWAY_LEAK_S", "RUNAWAY_FLOOR_J", "AWAY_RAD", "AWAY_LEAK_S", "FOLLOWING_RAD")
    times = ("FOLLOWING_S", "LONGEST_GAP_S", "PUNCTUAL_S", "SETTLING_S", "FASTEST_RAD_S")
    resting = ("RESTING_LEAK_S",)
    values = (0.2, 0.2, 0.02, 0.5, 0.3, 0.2, 0.05, 0.03, 0.012, 0.3, 1000.0, 1.0)
    assert tuple(getattr(motion_monitor, name) for name in names + times + resting) == values
    assert JointDynamics() == (0.0004, 8.0)


# energy


@pytest.mark.parametrize("law", [damping, holding])
def test_a_torque_with_the_wrong_sign_is_found_before_it_gave_the_bound(law: Law) -> None:
    joint = Joint(fraction=-1.0, angle_rad=0.001, velocity_rad_s=0.5)
    assert joint.run(law, 1.0) == {"joint_runaway"}
    assert joint.energy_j < RUNAWAY_RAD * TORQUE_NM


@pytest.mark.parametrize(
    ("velocity_rad_s", "law", "load_nm", "target_rad", "found"),
    [
        (20.0, damping, 0.0, None, set()),
        (0.0, lowering, 0.775, None, {"joint_runaway"}),  # a weight that falls against the torque
        (0.0, shaking, 0.0, None, set()),
        (0.0, holding, 0.6, 0.0, set()),  # a load that a held joint yields to
    ],
)
def test_only_energy_that_the_command_does_not_explain_is_a_runaway(
    velocity_rad_s: float, law: Law, load_nm: float, target_rad: float | None, found: set[str]
) -> None:
    assert Joint(velocity_rad_s=velocity_rad_s).run(law, 2.0, load_nm, target_rad) == found


@pytest.mark.parametrize("speed_rad_s", [0.5, 1.0])
def test_a_weight_that_is_lowered_at_the_speed_of_a_path_is_no_runaway(speed_rad_s: float) -> None:
    joint = Joint(velocity_rad_s=speed_rad_s)
    for tick in range(760):
        joint.tick(-TORQUE_NM / 2.0, TORQUE_NM / 2.0, speed_rad_s * tick * PERIOD_S, speed_rad_s)
    assert joint.names == set()


@pytest.mark.parametrize(("target_rad_s", "found"), [(0.0, {"joint_runaway"}), (0.1, set())])
def test_a_joint_that_shakes_against_its_torques_is_found_by_what_it_gains_where_its_target_rests(
    target_rad_s: float, found: set[str]
) -> None:
    samples, pulse = Samples(), 2.0 * pi * 80.0
    for tick in range(570):
        now_s = tick * PERIOD_S
        target_rad, speed_rad_s = target_rad_s * now_s, 2.0 * cos(pulse * now_s)
        angle_rad = target_rad + 2.0 / pulse * sin(pulse * now_s)
        braking_nm = -0.24 * cos(pulse * (now_s - PERIOD_S / 2.0))  # a quarter of a watt
        samples.add(angle_rad, speed_rad_s, target_rad, PERIOD_S, braking_nm, target_rad_s)
    assert samples.names == found


@pytest.mark.parametrize(
    ("limit_nm", "torque_nm", "dt_s", "target", "shaken_at"),
    [
        (0.75, 0.25, 0.0166, {"target_rad": 0.0}, 8),
        (0.75, 0.25, 0.0166, {"braked": True}, 8),
        (0.3, 0.249, 0.0166, {"target_rad": 0.0}, None),  # as much as dry friction
        (3.0, 0.99, 0.0166, {"target_rad": 0.0}, None),  # noise of a large robot
        (0.75, 0.25, 0.0167, {"target_rad": 0.0}, None),  # 0.75 π √(0.0004 kg·m² / 8 N·m/rad) = 16.66 ms
        (0.75, 0.25, 0.0166, {}, None),  # rocked in a recovery
    ],
)
def test_strong_torques_in_turn_that_are_faster_than_a_sound_joint_swings_are_found_at_the_eighth(
    limit_nm: float, torque_nm: float, dt_s: float, target: dict[str, Any], shaken_at: int | None
) -> None:
    samples = Samples(limit_nm)
    samples.add(**target)
    found = [samples.add(torque_nm=copysign(torque_nm, (-1) ** turn), dt_s=dt_s, **target) for turn in range(12)]
    assert [turn for turn, names in enumerate(found, 1) if names] == list(range(shaken_at or 13, 13))
    assert samples.names <= {"joint_oscillating"}


@pytest.mark.parametrize(("kept", "found"), [(0.79, set()), (0.83, {"joint_oscillating"})])
def test_a_joint_that_comes_to_rest_in_stiff_mud_is_not_shaken(kept: float, found: set[str]) -> None:
    samples, angle_rad = Samples(), 0.1
    for _ in range(200):  # settled
        samples.add(angle_rad, target_rad=0.0)
    for _ in range(10):  # half swings of 15 ms, in which the excursion before fades by a twentieth
        for fraction in (0.4, -0.3, -kept):
            samples.add(fraction * angle_rad, target_rad=0.0, dt_s=0.005, torque_nm=copysign(0.3, -angle_rad))
        angle_rad *= -kept
    for _ in range(500):  # at rest, where the last excursion fades
        samples.add(0.001, target_rad=0.0)
    assert samples.names == found


def test_a_joint_that_is_shaken_on_its_path_is_found_too() -> None:
    samples = Samples()
    found = [
        samples.add(0.003 * turn, target_rad=0.003 * turn, torque_nm=0.3 * (-1) ** turn, dt_s=0.01)
        for turn in range(10)
    ]
    assert [bool(names) for names in found] == [False] * 8 + [True] * 2  # the first sample has none before it


def test_a_torque_that_lasts_ends_the_count_of_those_in_turn() -> None:
    samples = Samples()
    for turn in range(24):
        assert samples.add(torque_nm=0.3 * (-1) ** (turn // 2), dt_s=0.0125, target_rad=0.0) == set()


def test_a_pose_held_with_commands_that_come_late_is_found() -> None:
    joint = Joint(delay_ticks=4, angle_rad=0.01)
    assert joint.run(holding, 1.0, target_rad=0.0) & {"joint_runaway", "joint_oscillating"}
    assert joint.energy_j < 0.5


@pytest.mark.parametrize(("velocity_rad_s", "expected"), [(1.0, set()), (1.001, {"joint_runaway"})])
def test_a_joint_may_have_exactly_the_energy_of_the_bound(velocity_rad_s: float, expected: set[str]) -> None:
    samples = Samples(5.0, JointDynamics(2.0, 8.0))  # 0.2 rad · 5 N·m = ½ · 2 kg·m² · (1 rad/s)²
    samples.add(target_rad=1.0)
    assert samples.add(velocity_rad_s=velocity_rad_s, target_rad=1.0) == {"following_error"} | expected
    assert samples.monitor.unexplained_j == pytest.approx(velocity_rad_s**2)


def test_the_torque_of_ticks_without_a_new_sample_counts() -> None:
    samples = Samples()
    samples.add()
    for _ in range(2):
        samples.monitor.update([], DriveState(0.0, 0.0, samples.now_s), 0.002, 0.6, None)
    samples.add(0.3, 30.0)  # ½ · 0.0004 · 30² = 0.18 J
    assert samples.monitor.unexplained_j == pytest.approx(0.18 - 2.0 / 3.0 * 0.6 * 0.3)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("angle_rad", "velocity_rad_s", "dt_s"),
    [
        (0.0, 50.0, 0.03),  # a gap of the longest time
        (0.0, 50.0, 0.05),
        (2.0, 0.0, 0.002),  # 1000 rad/s
        (3.0, 0.0, 0.002),
        *((0.0, velocity_rad_s, 0.002) for velocity_rad_s in (1000.0, 3e38, inf, nan)),
    ],
)
def test_over_a_gap_and_at_a_speed_that_no_joint_has_no_energy_is_added(
    angle_rad: float, velocity_rad_s: float, dt_s: float, side: float
) -> None:
    samples = Samples()
    samples.add()
    assert samples.add(side * angle_rad, side * velocity_rad_s, dt_s=dt_s, torque_nm=-side * TORQUE_NM) == set()
    assert samples.monitor.unexplained_j == 0.0
    assert samples.add() == set()
    assert samples.monitor.unexplained_j == 0.0  # nor is any owed by the next sound sample


# path away from the target


@pytest.mark.parametrize(
    ("first", "second", "away_rad"),  # angle and target
    [
        ((0.0, 0.0), (0.25, 0.0), 0.5),  # the path plus the growth of the error; exactly the bound
        ((0.5, 0.5), (0.6, 0.5), 0.2),
        ((0.5, 0.4), (0.6, 0.45), 0.1 - 0.05 + 0.05),
        ((0.1, None), (0.1, 0.2), 0.0),  # it begins with the second sample that has a target
        ((0.1, 0.2), (0.1, None), 0.0),
    ],
)
def test_the_path_away_is_that_of_the_joint_less_that_of_its_target_and_the_growth_of_the_error(
    first: tuple[float, float | None], second: tuple[float, float | None], away_rad: float
) -> None:
    samples = Samples()
    for angle_rad, target_rad in (first, second):
        assert samples.add(angle_rad, target_rad=target_rad) == set()
    assert samples.monitor.away_rad == pytest.approx(away_rad)


def test_a_target_that_comes_towards_a_joint_does_not_reduce_its_path_away() -> None:
    samples = Samples()
    samples.add(0.0, target_rad=0.25)
    samples.add(0.0, target_rad=0.0)
    assert samples.add(0.26, target_rad=0.0) == {"joint_oscillating"}


def test_a_joint_that_swings_about_its_held_pose_is_found_by_its_path() -> None:
    samples = Samples()
    for tick in range(100):
        samples.add(0.15 * sin(2.0 * pi * 20.0 * tick * PERIOD_S), 0.0, 0.0, PERIOD_S)
    assert samples.names == {"joint_oscillating"}
    assert float(dict(samples.faults[0].values)["away_rad"]) > AWAY_RAD


@pytest.mark.parametrize(("kept", "expected"), [(0.65, set()), (0.95, {"joint_oscillating"})])
def test_swings_about_the_target_that_decay_fast_are_no_oscillation(kept: float, expected: set[str]) -> None:
    samples, farthest_rad = Samples(), 0.0
    for tick in range(100):
        half_cycles = 2.0 * 20.0 * tick * PERIOD_S
        samples.add(0.3 * kept**half_cycles * sin(pi * half_cycles), 0.0, 0.0, PERIOD_S)
        farthest_rad = max(farthest_rad, samples.monitor.away_rad)
    assert farthest_rad > AWAY_RAD
    assert samples.names == expected


def test_a_joint_that_had_come_to_rest_may_be_thrown_again() -> None:
    samples = Samples()
    for extent_rad in (0.12, -0.16, 0.06, -0.14, 0.03):  # thrown twice, as by mud and a stone
        for tick in range(20):
            assert not samples.add(extent_rad * sin(pi * (tick + 0.5) / 20.0), 0.0, 0.0, PERIOD_S)
    assert not samples.add(-0.001, 0.0, 0.0, PERIOD_S)  # the last excursion, smaller than its own side's, is over
    assert samples.monitor.away_rad == pytest.approx(2.0 * 0.03, rel=0.01)


def test_a_loop_that_swings_unevenly_about_a_lag_is_found() -> None:
    """A load shifts the middle of an oscillation, so that each second excursion is half of the one before."""
    samples = Samples()
    times = [t for t in range(190) if samples.add(0.02 + 0.06 * sin(0.4 * t), 0.0, 0.0, PERIOD_S)]
    assert times[0] * PERIOD_S < 0.2


def test_an_excursion_hides_smaller_ones_on_the_other_side_only_until_it_has_faded() -> None:
    samples = Samples()
    for angle_rad in (0.0, 0.24):
        assert not samples.add(angle_rad, 0.0, 0.0, PERIOD_S)
    times = [tick for tick in range(150) if samples.add(-0.06 + 0.05 * sin(0.4 * tick), 0.0, 0.0, PERIOD_S)]
    assert 0.1 < times[0] * PERIOD_S < 0.3


def test_a_slow_push_and_its_return_are_no_oscillation_and_neither_is_a_joint_that_catches_up() -> None:
    pushed, late = Samples(), Samples()
    for tick in range(760):
        assert not pushed.add(0.2 * sin(2.0 * pi * 0.5 * tick * PERIOD_S), 0.0, 0.0, PERIOD_S)
    for tick in range(150):
        assert not late.add(min(0.02 * max(tick - 100, 0), 0.25), 0.0, min(0.0025 * tick, 0.25), PERIOD_S)
    assert late.monitor.away_rad < 0.01


# following, and lateness


@pytest.mark.parametrize("target_rad_s", [0.0, 4.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_following_error_may_grow_with_the_commanded_speed(target_rad_s: float, side: float) -> None:
    most_rad = 0.2 + TORQUE_NM / 8.0 + 0.05 * target_rad_s
    for angle_rad, beyond_rad, expected in (
        (0.0, 0.0, set()),  # exactly the bound
        (0.0, 1e-9, {"following_error"}),
        (0.1, -1e-9, set()),
        (0.1, 1e-9, {"following_error"}),
    ):
        target_rad = angle_rad + side * (most_rad + beyond_rad)
        assert Samples().add(angle_rad, 0.0, target_rad, target_rad_s=copysign(target_rad_s, side)) == expected


def test_next_to_another_fault_each_bound_is_allowed_exactly_too() -> None:
    for first_rad, then_rad, expected in (
        (0.125, 0.375, {"following_error"}),
        (0.0, 0.2 + 0.75 / 8.0, {"joint_oscillating"}),
    ):
        samples = Samples()
        samples.add(first_rad, target_rad=0.0)
        assert samples.add(then_rad, target_rad=0.0) == expected


def test_without_stiffness_there_is_no_path_to_follow() -> None:
    joint = Joint(velocity_rad_s=10.0)
    assert [joint.tick(0.0) for _ in range(100)] == [set()] * 100
    endless = Samples(dynamics=JointDynamics(stiffness_nm_rad=0.0))
    assert [endless.add(target_rad=3.0) for _ in range(3)] == [set()] * 3


@pytest.mark.parametrize(
    ("dt_s", "expected"), [(0.012, set()), (nextafter(0.012, 0.0), {"joint_oscillating", "following_error"})]
)
def test_a_sample_that_is_late_by_exactly_the_bound_begins_the_wait(dt_s: float, expected: set[str]) -> None:
    samples = Samples()
    samples.add(target_rad=0.0)
    assert samples.add(0.6, target_rad=0.0, dt_s=dt_s) == expected


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


# driven back


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("rate_rad_s", [0.05, 0.3, 1.0])
def test_a_joint_at_its_stop_whose_encoder_slips_with_its_speed_is_found(sign: float, rate_rad_s: float) -> None:
    samples, pressed_s, angle_rad = Samples(), 0.0, 0.0
    while not samples.faults and samples.now_s < 11.0:
        angle_rad -= sign * rate_rad_s * PERIOD_S
        torque_nm = min(max(-DYNAMICS.stiffness_nm_rad * angle_rad, -TORQUE_NM), TORQUE_NM)
        torque_nm -= copysign(PROBE_NM, torque_nm) if samples.monitor.probed else 0.0
        pressed_s += PERIOD_S if abs(torque_nm) >= 0.3 else 0.0
        samples.add(angle_rad, -sign * rate_rad_s, 0.0, PERIOD_S, torque_nm)
    assert samples.faults[0].name in ("joint_driven_back", "joint_runaway", "following_error") and pressed_s < 0.31


def rock(slip_rad_s: float, side: float, rock_s: float = 0.1, uneven_rad: float = 0.0) -> tuple[set[str], float]:
    """Rock a joint at its stop as a recovery does, for 2 s; return faults, and how long full torque pressed it."""
    samples, pressed_s, angle_rad, velocity_rad_s, torque_nm = Samples(), 0.0, 0.0, 0.0, 0.0
    for tick in range(round(2.0 / PERIOD_S)):
        away = tick * PERIOD_S / rock_s % 1.0 < 0.8
        wanted_nm = min(max((-1.1 if away else 1.1) - DAMPING_NM_S * velocity_rad_s, -TORQUE_NM), TORQUE_NM)
        torque_nm = min(max(wanted_nm, torque_nm - 0.4), torque_nm + 0.4)  # the slew rate of a tick
        for _ in range(STEPS):
            velocity_rad_s += PERIOD_S / STEPS * torque_nm / DYNAMICS.inertia_kg_m2
            angle_rad += PERIOD_S / STEPS * velocity_rad_s
            angle_rad, velocity_rad_s = (angle_rad, velocity_rad_s) if angle_rad > 0.0 else (0.0, 0.0)
        pressed_s += PERIOD_S if angle_rad == 0.0 and torque_nm < -0.3 else 0.0
        reported_rad, reported_rad_s = angle_rad + slip_rad_s * tick * PERIOD_S, velocity_rad_s + slip_rad_s
        reported_rad += uneven_rad * sin(2.0 * pi * tick * PERIOD_S / 0.37)
        if samples.add(side * reported_rad, side * reported_rad_s, None, PERIOD_S, side * torque_nm):
            break
    return samples.names, pressed_s


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("rate_rad_s", [0.05, 0.3, 1.0])
def test_a_joint_that_a_recovery_rocks_at_its_stop_is_found_where_its_encoder_slips(
    rate_rad_s: float, side: float
) -> None:
    names, pressed_s = rock(rate_rad_s, side)
    assert names == {"joint_driven_back"} and pressed_s < 0.4


@pytest.mark.parametrize("rate_rad_s", [0.0, -0.05, -0.5])
def test_a_joint_that_a_recovery_rocks_and_that_moves_with_its_mean_torque_is_healthy(rate_rad_s: float) -> None:
    assert rock(rate_rad_s, 1.0)[0] == set()


def test_a_joint_that_a_recovery_rocks_in_mud_that_creeps_unevenly_against_it_is_healthy() -> None:
    assert rock(0.05, 1.0, uneven_rad=0.0012)[0] == set()


class Rock(NamedTuple):
    """A part of a recovery's rocking."""

    torque_nm: float
    velocity_rad_s: float
    samples: int = 24  # of 1/512 s
    target_rad: float | None = None


def rocked(*parts: Rock) -> int:
    """Return the intervals in a row in which a rocked joint was driven back."""
    samples, angle_rad = Samples(), 0.0
    for part in (Rock(0.25, 0.0, 8), *parts, Rock(-0.75, 0.0, 1)):
        for _ in range(part.samples):
            angle_rad += part.velocity_rad_s / 512.0
            samples.add(angle_rad, part.velocity_rad_s, part.target_rad, 1.0 / 512.0, part.torque_nm)
    return samples.monitor.driven_back


PRESS, PAUSE = Rock(-0.75, 0.0625), Rock(0.1875, 0.0625)


@pytest.mark.parametrize(
    ("parts", "driven_back"),
    [
        ([PRESS, PAUSE], 1),
        ([PRESS, Rock(0.25, 0.0625)], 0),  # a mean of exactly PRESSING_NM
        ([Rock(-0.75, 0.03125), Rock(0.1875, 0.015625)], 0),  # 2.2 mrad, where 2.8 count
        ([PRESS, PAUSE, Rock(0.25, 4.0, 1), Rock(-0.75, 4.0, 1)], 0),  # the joint is fast as the torque turns
        ([PRESS, Rock(-0.75, 0.0625, 1, 0.0), PAUSE], 0),  # a target in between
        ([PRESS, PAUSE, PRESS, PAUSE, PRESS, PAUSE], 3),
        ([PRESS, PAUSE, Rock(-0.75, 0.125), PAUSE], 0),  # 8.8 mrad after 5.9, where 1.3 more may be
        ([PRESS, PAUSE, Rock(-0.75, 0.0791015625), PAUSE], 2),
    ],
)
def test_a_rocking_counts_where_its_mean_torque_presses_and_its_path_is_as_in_the_one_before(
    parts: list[Rock], driven_back: int
) -> None:
    assert rocked(*parts) == driven_back


def lowered(now_s: float, angle_rad: float) -> float:
    """The load of a weight that a hand lowers."""
    return -0.6 * min(now_s / 2.0, 1.0)


def heavy(now_s: float, angle_rad: float) -> float:
    """The load of a weight that is let go, with which the joint swings."""
    return -0.6 * min(now_s / 0.4, 1.0)


def mud_that_moves(now_s: float, angle_rad: float) -> float:
    """The load of firm mud that takes the plate along."""
    return 20.0 * (-0.05 * min(now_s, 1.5) - angle_rad)


@pytest.mark.parametrize(("load", "inertia_kg_m2"), [(lowered, 0.0004), (heavy, 0.012), (mud_that_moves, 0.0004)])
def test_a_joint_that_yields_to_a_load_when_it_is_probed_is_healthy(
    load: Callable[[float, float], float], inertia_kg_m2: float
) -> None:
    joint, probes = Joint(), 0
    joint.inertia_kg_m2 = inertia_kg_m2
    for tick in range(round(3.0 / PERIOD_S)):
        probed = joint.monitor.probed
        torque_nm = holding(0.0, joint.angle_rad, joint.velocity_rad_s) - (PROBE_NM if probed else 0.0)
        assert not joint.tick(torque_nm, load(tick * PERIOD_S, joint.angle_rad), 0.0)
        probes += joint.monitor.probed and not probed
    assert 1 <= probes <= 5


@pytest.mark.parametrize("rates_rad_s", [(0.1, 0.1), (-0.5, -0.5), (-0.3, -0.1), (-0.3, -0.4), (-0.3, -0.5)])
def test_a_joint_whose_speed_changes_in_its_probe_or_after_it_is_healthy(rates_rad_s: tuple[float, float]) -> None:
    joint = PushedJoint()
    joint.push(0.7, -0.3, 1 + 3 * 31)
    assert joint.monitor.probed
    assert [joint.push(0.5, rate_rad_s, 26) for rate_rad_s in rates_rad_s] == [None, None]
    assert joint.monitor.driven_back < 3


def test_a_target_that_jumps_to_the_joint_does_not_end_its_probe() -> None:
    """As where a stop is requested: the path to a raised flipper begins at the measured angle."""
    joint = PushedJoint()
    joint.push(0.7, -0.3, 1 + 3 * 31)
    assert joint.push(0.575, -0.3, 13) is None
    assert joint.push(0.1, -0.3, 100, target_rad=joint.angle_rad) == 13 + 26


def test_the_probe_of_a_joint_that_hardly_presses_counts_too() -> None:
    joint = PushedJoint()
    joint.push(0.3, -0.3, 1 + 3 * 31)
    assert joint.monitor.probed
    joint.push(0.3 - PROBE_NM, -0.3, 26)
    assert joint.monitor.driven_back == 4


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("follows", [True, False], ids=["a swing", "a recovery"])
@pytest.mark.parametrize(("torque_nm", "leads"), [(-0.95, False), (-0.9, False), (-0.85, True)])
def test_a_target_that_moves_with_the_joint_does_not_explain_a_path_against_full_torque(
    torque_nm: float, leads: bool, follows: bool, sign: float
) -> None:
    samples = Samples()
    for tick in range(round(0.5 / PERIOD_S)):
        angle_rad = sign * 0.3 * tick * PERIOD_S
        target_rad = angle_rad - sign * 0.1 if follows else None
        against_nm = torque_nm * TORQUE_NM + (PROBE_NM if samples.monitor.probed else 0.0)
        samples.add(angle_rad, sign * 0.3, target_rad, PERIOD_S, sign * against_nm, sign * 0.3)
    assert samples.names == (set() if leads and follows else {"joint_driven_back"})


class PushedJoint(Samples):
    """A joint that moves under a torque at its standing target, in samples of 1/512 s."""

    angle_rad = 0.0

    def push(self, torque_nm: float, velocity_rad_s: float, samples: int, target_rad: float = 0.0) -> int | None:
        """Return the number of the sample in which it is driven back, if any."""
        for number in range(1, samples + 1):
            self.angle_rad += velocity_rad_s / 512.0
            if "joint_driven_back" in self.add(self.angle_rad, velocity_rad_s, target_rad, 1.0 / 512.0, torque_nm):
                return number
        return None


@pytest.mark.parametrize("slow", [True, False])
@pytest.mark.parametrize(
    ("before", "begins_after"),
    [
        ([], 0),
        ([(0.7, -2.0, 70), (0.2, -2.0, 1)], 0),  # two intervals of 31 samples, and a torque that is too small
        ([(-0.7, 2.0, 70), (0.1, 0.0, 1)], 0),
        ([(-0.7, 2.0, 70)], 1),  # a torque that changes its sign at once
        ([(0.7, -2.0, 31), (0.7, 1.0, 20)], 0),  # the interval begins where the joint turns back
    ],
)
def test_a_joint_is_driven_back_in_three_intervals_in_a_row_and_its_probe(
    before: list[tuple[float, float, int]], begins_after: int, slow: bool
) -> None:
    """An interval in which it is too slow begins the count again."""
    joint = PushedJoint()
    joint.push(0.0, 0.0, 1)
    assert [joint.push(*each) for each in before] == [None] * len(before)
    if slow:
        assert joint.push(0.7, -0.01, 31 + begins_after) is None
    assert joint.push(0.7, -2.0, 200) == 3 * 31 + 2 * 26 + (0 if slow else begins_after)


def test_a_path_that_lowers_a_load_is_healthy() -> None:
    lag_rad = 0.05
    joint = Joint(angle_rad=lag_rad, velocity_rad_s=0.5)
    for tick in range(760):
        target_rad = 0.5 * tick * PERIOD_S
        torque_nm = DYNAMICS.stiffness_nm_rad * (target_rad - joint.angle_rad)
        torque_nm += DAMPING_NM_S * (0.5 - joint.velocity_rad_s)
        assert not joint.tick(torque_nm, DYNAMICS.stiffness_nm_rad * lag_rad, target_rad, 0.5)
