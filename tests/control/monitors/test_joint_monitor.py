"""Each check of a joint on both sides of its bound, in ticks from the cause, and what does not trigger it.

The figures are ticks of 1 / 380 s, pinned without the module's own constants.
"""

from math import copysign, inf, isfinite, nan, nextafter, radians
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.faults import FAULT_KINDS
from control.monitors.joint_monitor import JointMonitor, TickFacts
from control.parameters.fault_bounds import FaultBounds
from control.parameters.joint_limits import JointLimits
from control.rate import PERIOD_S
from control.records import UNKNOWN, DriveState
from tests.control.monitors.monitored_joint import (
    BOUNDS,
    CURRENT_LIMIT_A,
    LIMITS,
    NOW_S,
    TORQUE_CONSTANT_NM_A,
    WINDING,
    faults_of,
    healthy,
    make_monitor,
    names_of,
)

Changes = dict[str, Any]
FULL_NM, MARGIN_RAD = LIMITS.torque_nm, radians(70.0)
OFF: Changes = {"energised": False, "moving": False}
FAST_PER_TICK_S = BOUNDS.fast_s * 2.0 / 3.0  # one tick and two ticks are equally far from the bound


def pushed(torque_nm: float, **changes: Any) -> Changes:
    return {"torque_nm": torque_nm, **changes}


@pytest.mark.parametrize(
    ("name", "state", "tick", "ticks"),
    [
        ("drive_error", {"error_flags": 1}, {}, 1),
        ("drive_error", {"error_flags": 0x4000000}, {}, 1),
        ("drive_disarmed", {"closed_loop": False}, {}, 1),
        ("drive_energised", {}, OFF, 76),  # 0.2 s
        ("torque_missing", {}, pushed(0.226), 39),  # 0.1 s
        ("torque_missing", {}, pushed(-0.226), 39),
        ("torque_missing", {"current_a": 0.226 / TORQUE_CONSTANT_NM_A}, {}, 39),
        ("torque_missing", {}, pushed(0.25, dt_s=0.03), 4),
        ("torque_missing", {}, pushed(0.25, dt_s=10.0), 4),  # a tick counts for 30 ms at most
        ("torque_missing", {}, pushed(0.25, dt_s=0.02), 6),  # exactly its time is no fault
        ("joint_not_following", {"current_a": 9.0}, pushed(FULL_NM), 761),  # 2 s
        ("joint_not_following", {"current_a": 9.0}, pushed(-FULL_NM), 761),
        ("joint_not_following", {"current_a": 9.0}, pushed(0.95 * FULL_NM), 761),
        ("joint_not_following", {}, pushed(FULL_NM, dt_s=0.015625), 129),  # missed ticks count
        ("voltage_low", {"bus_voltage_v": 19.9}, {}, 58),  # 0.15 s, two messages
        ("voltage_under", {"bus_voltage_v": 17.9}, {}, 58),
        ("voltage_low", {"bus_voltage_v": 19.9}, {"dt_s": 0.03}, 6),  # exactly its time is no fault
        ("voltage_under", {"bus_voltage_v": 17.9}, {"dt_s": 0.03}, 6),
        ("motor_overheating", {"temperature_c": 80.0}, {}, 57),  # heat is checked every eighth tick, from the first
        ("motor_overheating", {"temperature_c": 80.0}, {"dt_s": 0.03}, 6),
        ("motor_hot", {"temperature_c": 90.0}, {}, 57),
        ("joint_position", {"angle_rad": nextafter(MARGIN_RAD, inf)}, {}, 1),
        ("joint_position", {"angle_rad": nextafter(-MARGIN_RAD, -inf)}, {}, 1),
        ("joint_position", {"angle_rad": nan}, {}, 1),
        ("joint_position", {"angle_rad": -inf}, {}, 1),
        ("joint_velocity", {"velocity_rad_s": 25.001}, {}, 3),
        ("joint_velocity", {"velocity_rad_s": -25.001}, {}, 3),
        ("joint_velocity", {"velocity_rad_s": 30.0}, {"dt_s": FAST_PER_TICK_S + 1e-9}, 1),
        ("joint_velocity", {"velocity_rad_s": 30.0}, {"dt_s": FAST_PER_TICK_S - 1e-9}, 2),
        ("joint_velocity", {"velocity_rad_s": 30.0}, {"dt_s": 1.0}, 1),
        ("joint_current", {"current_a": 15.001}, {}, 3),
        ("joint_current", {"current_a": -15.001}, {}, 3),
    ],
)
def test_a_fault_begins_in_its_tick(name: str, state: Changes, tick: Changes, ticks: int) -> None:
    monitor = make_monitor()
    found = [name in names_of(monitor, healthy(**state), **tick) for _ in range(ticks + 1)]
    assert found == [False] * (ticks - 1) + [True] * 2
    assert ticks <= FAULT_KINDS[name].bound_ticks


@pytest.mark.parametrize(
    ("angle_deg", "torque_nm", "found_after"),
    [
        (60.1, FULL_NM, 114),
        (-69.9, FULL_NM, 114),
        (60.1, 0.226, 114),  # three tenths of the limit
        (60.1, 0.224, None),
        (60.0, FULL_NM, None),
        (-60.0, FULL_NM, None),
    ],
)
def test_a_joint_that_a_lasting_torque_does_not_bring_back_is_outside_of_its_range(
    angle_deg: float, torque_nm: float, found_after: int | None
) -> None:
    monitor, state = make_monitor(), healthy(angle_rad=radians(angle_deg), current_a=9.0)
    back_nm = -copysign(torque_nm, angle_deg)
    found = ["joint_position" in names_of(monitor, state, torque_nm=back_nm) for _ in range(700)]
    assert found == [found_after is not None and tick >= found_after for tick in range(700)]


@pytest.mark.parametrize(
    ("state", "tick", "limits"),
    [
        ({}, {}, LIMITS),
        ({"closed_loop": False}, {"moving": False}, LIMITS),
        ({}, pushed(0.224), LIMITS),
        ({}, pushed(0.3), JointLimits(torque_nm=1.0)),  # exactly three tenths of the limit
        ({"closed_loop": False}, pushed(0.7, moving=False), LIMITS),
        ({"current_a": 9.0}, pushed(0.94 * FULL_NM), LIMITS),
        ({"current_a": 9.0}, pushed(FULL_NM, may_stand_still=True), LIMITS),  # in a recovery
        ({}, {}, JointLimits(torque_nm=0.0)),
        ({"velocity_rad_s": 25.0}, {}, LIMITS),
        ({"velocity_rad_s": -25.0}, {}, LIMITS),
        *(({}, {"dt_s": dt_s}, LIMITS) for dt_s in (2.0 * PERIOD_S, 2.0 * BOUNDS.fast_s, 1.0)),
        ({"bus_voltage_v": 20.0}, {}, LIMITS),
        ({"bus_voltage_v": nan}, {}, LIMITS),
        *(({"temperature_c": temperature_c}, {}, LIMITS) for temperature_c in (79.99, 0.0, nan, -inf)),
        ({"angle_rad": MARGIN_RAD}, {}, LIMITS),
        ({"angle_rad": -MARGIN_RAD}, {}, LIMITS),
    ],
)
def test_a_joint_within_its_bounds_has_no_fault(state: Changes, tick: Changes, limits: JointLimits) -> None:
    monitor = make_monitor(limits=limits)
    assert not any(names_of(monitor, healthy(**state), **tick) for _ in range(1000))


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ({"bus_voltage_v": 18.0}, "voltage_low"),
        ({"bus_voltage_v": 17.99}, "voltage_under"),
        ({"temperature_c": 89.99}, "motor_overheating"),
        ({"temperature_c": inf}, "motor_hot"),
        ({"current_a": 15.0}, "torque_missing"),
        ({"current_a": -15.0}, "torque_missing"),
    ],
)
def test_a_milder_bound_that_is_passed_is_the_only_fault(state: Changes, expected: str) -> None:
    monitor = make_monitor()
    assert {name for _ in range(60) for name in names_of(monitor, healthy(**state))} == {expected}


@pytest.mark.parametrize(
    ("velocity_rad_s", "expected"),
    [(9.1, set()), (-9.1, set()), (9.0, {"torque_missing"}), (UNKNOWN, {"torque_missing"})],
)
def test_torque_is_not_missing_where_the_motor_s_voltage_is_used_up(velocity_rad_s: float, expected: set[str]) -> None:
    monitor, state = make_monitor(fastest_rad_s=9.0), healthy(velocity_rad_s=velocity_rad_s)
    assert {name for _ in range(60) for name in names_of(monitor, state, **pushed(0.5))} == expected


@pytest.mark.parametrize(
    ("name", "ticks", "state", "tick", "relief", "relieving"),
    [
        ("drive_energised", 75, {}, OFF, {"closed_loop": False}, OFF),
        ("torque_missing", 38, {}, pushed(0.5), {"current_a": 0.5 / TORQUE_CONSTANT_NM_A}, pushed(0.5)),
        ("joint_not_following", 760, {}, pushed(FULL_NM), {}, pushed(0.7)),
        ("joint_current", 2, {"current_a": 16.0}, {}, {}, {}),
        ("joint_velocity", 2, {"velocity_rad_s": 100.0}, {}, {}, {}),
        ("voltage_low", 57, {"bus_voltage_v": 19.9}, {}, {"bus_voltage_v": 20.0}, {}),
        ("voltage_under", 57, {"bus_voltage_v": 17.9}, {}, {"bus_voltage_v": 18.0}, {}),
        ("motor_overheating", 5, {"temperature_c": 85.0}, {"dt_s": 0.03}, {"temperature_c": 79.9}, {"dt_s": 0.03}),
    ],
)
def test_one_good_tick_begins_the_wait_again(
    name: str, ticks: int, state: Changes, tick: Changes, relief: Changes, relieving: Changes
) -> None:
    monitor = make_monitor()
    for _ in range(5):
        assert not any(name in names_of(monitor, healthy(**state), **tick) for _ in range(ticks))
        assert name not in names_of(monitor, healthy(**relief), **relieving)


@pytest.mark.parametrize(
    ("name", "state", "tick", "values"),
    [
        ("torque_missing", {"current_a": 2.0}, pushed(0.7), {"measured_nm": 0.166, "commanded_nm": 0.7}),
        ("joint_current", {"current_a": -16.0}, {}, {"current_a": 16.0, "limit_a": 15.0}),
        ("joint_velocity", {"velocity_rad_s": -30.0}, {}, {"velocity_rad_s": 30.0, "limit_rad_s": 20.0}),
        ("joint_not_following", {"current_a": 9.0}, pushed(0.75), {"stalled_s": 761 / 380.0}),
        ("voltage_under", {"bus_voltage_v": 17.0}, {}, {"voltage_v": 17.0, "least_v": 18.0}),
        ("voltage_low", {"bus_voltage_v": 19.0}, {}, {"voltage_v": 19.0}),
        ("joint_position", {"angle_rad": radians(80.0)}, {}, {"angle_deg": 80.0, "low_deg": -70.0, "high_deg": 70.0}),
    ],
)
def test_a_fault_reports_the_values_that_it_was_found_by(
    name: str, state: Changes, tick: Changes, values: dict[str, float]
) -> None:
    monitor = make_monitor()
    faults = [fault for _ in range(800) for fault in faults_of(monitor, healthy(**state), **tick)]
    assert dict(next(fault for fault in faults if fault.name == name).values) == pytest.approx(values)


def test_a_drive_error_reports_its_flags() -> None:
    (fault,) = faults_of(make_monitor(), healthy(error_flags=0x10))
    assert dict(fault.values) == {"flags": "0x10"}


def test_a_drive_may_stay_in_closed_loop_for_exactly_two_heartbeats() -> None:
    monitor = make_monitor()
    for dt_s in 6 * (0.03,) + (0.2 - sum(6 * (0.03,)),):
        assert not names_of(monitor, healthy(), dt_s=dt_s, **OFF)
    assert names_of(monitor, healthy(), **OFF) == {"drive_energised"}


def test_a_joint_may_be_fast_for_exactly_its_time_less_half_a_tick() -> None:
    monitor = make_monitor(FaultBounds(fast_s=0.01))
    fast = [names_of(monitor, healthy(velocity_rad_s=100.0), dt_s=0.004) for _ in range(3)]
    assert fast == [set(), set(), {"joint_velocity"}]  # after 0.004, 0.008 and 0.012 s


def test_a_joint_is_at_rest_exactly_a_tenth_of_a_second_after_its_last_step_of_thirty_milliradians() -> None:
    monitor = make_monitor()
    ticks = [
        names_of(monitor, healthy(angle_rad=angle_rad, closed_loop=False), dt_s=0.025, **OFF)
        for angle_rad in (0.1, *[0.1301] * 5, 0.16)
    ]
    assert ticks == [set(), *[{"joint_moving"}] * 4, set(), set()]


@pytest.mark.parametrize(
    ("speed_rad_s", "noise_rad_s", "energised", "moves"),
    [(0.5, 0.0, False, True), (-0.5, 0.0, False, True), (0.5, 0.0, True, False), (0.0, 0.5, False, False)],
)
def test_a_moving_joint_is_reported_only_while_the_torque_is_off(
    speed_rad_s: float, noise_rad_s: float, energised: bool, moves: bool
) -> None:
    monitor, random, found = make_monitor(), Random(1), list[bool]()
    for tick in range(200):
        now_s, measured_rad_s = NOW_S + tick * PERIOD_S, speed_rad_s + random.gauss(0.0, noise_rad_s)
        angle_rad = speed_rad_s * tick * PERIOD_S
        state = healthy(now_s, angle_rad=angle_rad, velocity_rad_s=measured_rad_s, closed_loop=False)
        found.append("joint_moving" in names_of(monitor, state, now_s, energised=energised, moving=False))
    assert sum(found) > 150 if moves else not any(found)


def test_an_encoder_may_jump_by_the_configured_angle() -> None:
    for step_rad, expected in ((0.05 - 1e-6, set()), (0.05 + 1e-6, {"encoder_jump"})):
        monitor = make_monitor()
        names_of(monitor, healthy(angle_rad=0.0))
        assert names_of(monitor, healthy(NOW_S + 0.002, angle_rad=step_rad), NOW_S + 0.002) == expected


def test_a_joint_that_moves_follows_and_the_noise_of_a_speed_is_no_motion() -> None:
    monitor, random = make_monitor(), Random(1)
    for tick in range(2000):
        assert not names_of(monitor, healthy(angle_rad=0.05 * (tick // 700), current_a=9.0), torque_nm=FULL_NM)
    monitor = make_monitor()
    noisy = [healthy(velocity_rad_s=random.gauss(0.0, 0.3)) for _ in range(800)]
    assert any("joint_not_following" in names_of(monitor, state, torque_nm=FULL_NM) for state in noisy)


def test_a_current_that_follows_within_ticks_is_not_missed() -> None:
    """The current reported in a tick answers the torque of the tick before."""
    monitor, before_nm = make_monitor(), 0.0
    for tick in range(400):
        now_s, sent_nm = NOW_S + tick * PERIOD_S, 0.7 if tick // 30 % 2 else -0.7
        state = healthy(now_s, current_a=before_nm / 0.083, velocity_rad_s=1.0, angle_rad=0.1 + 1e-3 * (tick % 2))
        assert "torque_missing" not in names_of(monitor, state, now_s, torque_nm=sent_nm)
        before_nm = sent_nm


def test_damping_is_only_where_the_loop_damps() -> None:
    assert TickFacts(0.0, PERIOD_S, True, True, False).damping is False


def test_a_joint_that_rests_exactly_where_its_torque_left_it_has_a_sound_encoder() -> None:
    """The torque fell while the joint was at rest; without torque nothing has to move any more."""
    monitor = make_monitor()
    for tick in range(200):
        now_s, on = NOW_S + tick * PERIOD_S, tick < 12
        found = names_of(monitor, healthy(now_s), now_s, torque_nm=0.7 if tick < 10 else 0.0, energised=on)
        assert "encoder_stuck" not in found


def accelerated(monitor: JointMonitor, ticks: int, **changes: Any) -> set[str]:
    """Return the faults of a joint that speeds up against its torque."""
    found, angle_rad = set[str](), -0.3
    for number in range(ticks):
        speed_rad_s, now_s = 0.5 * number, NOW_S + number * PERIOD_S
        angle_rad += speed_rad_s * PERIOD_S
        state = healthy(now_s, angle_rad=angle_rad, velocity_rad_s=speed_rad_s)
        found |= names_of(monitor, state, now_s, torque_nm=-0.2, **changes)
    return found


@pytest.mark.parametrize("moving", [True, False])
def test_a_joint_that_speeds_up_against_its_torque_is_a_runaway_while_closed_loop_is_expected(moving: bool) -> None:
    assert ("joint_runaway" in accelerated(make_monitor(), 40, moving=moving)) is moving


def test_the_energy_of_a_joint_begins_again_once_torque_is_on() -> None:
    """A joint that was turned by hand without torque has another angle when the torque comes back."""
    monitor = make_monitor()
    for tick in range(32):
        by_hand, now_s = 0 < tick < 31, NOW_S + tick * PERIOD_S
        angle_rad = 0.1 + 10.0 * PERIOD_S * min(tick, 30)
        state = healthy(now_s, angle_rad=angle_rad, velocity_rad_s=10.0 if by_hand else 0.0)
        found = names_of(monitor, state, now_s, moving=not by_hand, torque_nm=-0.2)
    assert angle_rad > 0.8 and not found & {"joint_runaway", "joint_oscillating"}


# heat


def winding_c(measured: DriveState, torque_nm: float = 0.0, bounds: FaultBounds = BOUNDS) -> float:
    """Return the winding's temperature after a minute."""
    monitor = make_monitor(bounds)
    for _ in range(60):
        faults_of(monitor, measured._replace(temperature_c=0.0), dt_s=1.0, torque_nm=torque_nm)
    return monitor.winding.temperature_c


def test_an_old_current_heats_no_longer_and_the_commanded_torque_does_instead() -> None:
    """A drive that is gone keeps its last current for ever."""
    bounds = FaultBounds(silence_s=0.03125)  # exact in binary
    old_s = NOW_S - bounds.silence_s
    for stamp_s, heats in ((old_s, True), (nextafter(old_s, -inf), False)):
        current = healthy(current_a=10.0, current_stamp_s=stamp_s)
        assert (winding_c(current, bounds=bounds) > WINDING.room_c + 20.0) == heats
    gone = healthy(current_a=10.0, current_stamp_s=NOW_S - 1.0)
    assert winding_c(gone, 0.5) == pytest.approx(winding_c(healthy(current_a=0.5 / TORQUE_CONSTANT_NM_A)))
    assert winding_c(gone) == pytest.approx(WINDING.room_c)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_current_beyond_twice_the_largest_is_no_measurement(sign: float) -> None:
    most_a = 2.0 * 1.25 * CURRENT_LIMIT_A
    assert winding_c(healthy(current_a=sign * nextafter(most_a, 0.0))) > WINDING.room_c + 20.0
    assert winding_c(healthy(current_a=sign * most_a)) == pytest.approx(WINDING.room_c)


def test_a_winding_heats_for_the_whole_time_that_a_gap_lasted() -> None:
    """Heat does not depend on the number of samples: one tick of a second heats nearly as much as a hundred short
    ticks.
    """
    long, short = make_monitor(), make_monitor()
    hot = healthy(current_a=10.0, temperature_c=0.0)
    faults_of(long, hot, dt_s=1.0)
    for _ in range(100):
        faults_of(short, hot, dt_s=0.01)
    assert long.winding.temperature_c == pytest.approx(short.winding.temperature_c, rel=0.02)
    assert long.winding.temperature_c > WINDING.room_c + 0.5


@pytest.mark.parametrize(
    ("measured_c", "winding_c", "name", "expected_c"),
    [
        *((measured_c, 79.0, "", nan) for measured_c in (nan, 0.0, 79.0)),
        *((measured_c, 80.5, "winding_overheating", 80.5) for measured_c in (nan, 0.0, 79.0)),
        (nan, 99.0, "winding_hot", 99.0),
        (25.0, 99.0, "winding_hot", 99.0),
        (85.0, 99.0, "winding_hot", 99.0),  # a sensor that is nearly too hot hides no winding that is
        (96.0, 99.0, "motor_hot", 96.0),
    ],
)
def test_a_heat_fault_reports_the_temperature_of_the_sensor_or_of_the_winding_that_shows_it(
    measured_c: float, winding_c: float, name: str, expected_c: float
) -> None:
    monitor = make_monitor()
    for _ in range(60):
        monitor.winding.temperature_c = winding_c
        faults = faults_of(monitor, healthy(temperature_c=measured_c))
    assert [fault.name for fault in faults] == [name][: bool(name)]
    assert not faults or dict(faults[0].values)["temperature_c"] == pytest.approx(expected_c, abs=0.05)  # which cools


def test_one_hot_message_after_a_gap_is_no_fault_and_heats_no_winding() -> None:
    monitor = make_monitor()
    assert names_of(monitor, healthy(temperature_c=200.0), dt_s=0.5) == set()
    assert names_of(monitor, healthy()) == set()


@pytest.mark.parametrize("absurd_c", [inf, 1e38])
def test_one_absurd_temperature_is_over_in_minutes(absurd_c: float) -> None:
    monitor = make_monitor()
    for _ in range(60):
        found = names_of(monitor, healthy(temperature_c=absurd_c))
    assert found == {"motor_hot"}
    assert [names_of(monitor, healthy(), dt_s=1.0) for _ in range(180)][-1] == set()


# a reset begins everything again but the heat


def test_a_reset_forgets_the_angle_and_the_energy_and_does_not_cool_a_winding() -> None:
    monitor = make_monitor(limits=JointLimits(velocity_rad_s=100.0))
    accelerated(monitor, 20)
    monitor.winding.temperature_c = 95.0
    assert monitor.motion.unexplained_j > 0.0
    monitor.reset()
    assert monitor.motion.unexplained_j == 0.0
    now_s = NOW_S + 20 * PERIOD_S
    assert names_of(monitor, healthy(now_s, angle_rad=0.6), now_s, dt_s=0.03) == {"winding_hot"}


def test_after_a_reset_a_joint_counts_as_still_until_it_moves() -> None:
    monitor, moved = make_monitor(), healthy(angle_rad=0.2, closed_loop=False)
    names_of(monitor, healthy(closed_loop=False), **OFF)
    assert "joint_moving" in names_of(monitor, moved, **OFF)
    monitor.reset()
    assert "joint_moving" not in names_of(monitor, moved, **OFF)


# any input

anything = st.floats(allow_nan=True, allow_infinity=True)
drive_states = st.builds(
    DriveState, anything, anything, anything, anything, anything, st.booleans(), st.integers(0, 2**32 - 1), anything,
    anything, anything, anything,
)  # fmt: skip


@given(st.lists(drive_states, min_size=1, max_size=6), st.booleans(), st.booleans(), anything)
def test_no_value_makes_it_fail_and_garbage_is_forgotten_once_the_signals_are_good_again(
    states: list[DriveState], energised: bool, moving: bool, torque_nm: float
) -> None:
    """Only heat and, for one tick, the jump back are left; and its energy, where the torque was large."""
    monitor = make_monitor()
    for tick, state in enumerate(states):
        now_s = NOW_S + tick * PERIOD_S
        for fault in faults_of(monitor, state, now_s, torque_nm, energised=energised, moving=moving):
            assert fault.exact_message()
        assert isfinite(monitor.winding.temperature_c)
    for tick in range(len(states), len(states) + 8):
        now_s = NOW_S + tick * PERIOD_S
        found = names_of(monitor, healthy(now_s), now_s)
    energy = set() if abs(torque_nm) < 0.3 else {"joint_runaway"}  # 0.09 J over the largest step that is no jump
    assert found - energy <= {"winding_hot", "winding_overheating"}
