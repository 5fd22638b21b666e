"""Each check of a joint on both sides of its bound, in ticks from the cause, and what does not trigger it."""

from collections.abc import Callable, Iterable
from math import inf, isfinite, nan, radians
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.faults import FAULT_KINDS, FaultKind, Reaction
from control.monitors.joint_monitor import (
    CURRENT_TICKS,
    MISSING_FRACTION,
    MISSING_S,
    SLOW_SILENCE_S,
    TWO_MESSAGES_S,
    JointMonitor,
)
from control.parameters.fault_bounds import FaultBounds
from control.rate import PERIOD_S
from control.records import NEVER_S, DriveState
from tests.control.monitors.monitored_joint import (
    BOUNDS,
    CURRENT_LIMIT_A,
    HEALTHY,
    JOINT,
    LIMITS,
    NOW_S,
    faults_of,
    make_monitor,
)

MESSAGE_S = 0.002
FAST_TICKS = round(FaultBounds().fast_s * 380.0)
TWO_MESSAGES = round(TWO_MESSAGES_S * 380.0)
BEYOND = 1e-6
SEVERITY = [
    "drive_late",
    "current_stale",
    "current_silent",
    "position_stale",
    "drive_quiet",
    "position_silent",
    "drive_silent",
]


def seen(monitor: JointMonitor, state: DriveState, now_s: float = NOW_S, **changes: Any) -> dict[str, str]:
    """Return the messages of the faults by name."""
    found = faults_of(monitor, state, now_s, **changes)
    assert all(fault.subject == JOINT for fault in found)
    return {fault.name: fault.exact_message() for fault in found}


def names(state: DriveState, **changes: Any) -> set[str]:
    """Return the faults that a new monitor finds in one sample."""
    return set(seen(make_monitor(), state, **changes))


def lasting(state: DriveState, monitor: JointMonitor | None = None) -> set[str]:
    """Return the faults of a sample that lasts for two slow messages, before which there must be none."""
    monitor = monitor or make_monitor()
    before = [seen(monitor, state) for _ in range(TWO_MESSAGES)]
    assert not any(before[:-1])
    return set(seen(monitor, state)) | set(seen(monitor, state))


def fresh(now_s: float, **changes: Any) -> DriveState:
    """Return the state of a drive that has just sent everything."""
    stamps: dict[str, Any] = dict.fromkeys(
        ("angle_stamp_s", "current_stamp_s", "heartbeat_stamp_s", "temperature_stamp_s"), now_s
    )
    return HEALTHY._replace(**(stamps | changes))


def ticks_until(name: str, state_at: Callable[[float], DriveState], longest: int = 1000, **changes: Any) -> int:
    """Return the ticks from the first one after NOW_S, at which the cause begins, to the first with the fault."""
    monitor = make_monitor()
    for tick in range(-20, longest):
        now_s = NOW_S + tick * PERIOD_S
        state = state_at(now_s) if tick > 0 else fresh(now_s)
        if name in seen(monitor, state, now_s, **changes):
            return tick
    raise AssertionError(f"{name} never came")


def last_message_s(now_s: float, ended_s: float, period_s: float, offset_s: float) -> float:
    """Return the stamp of the last cyclic message before the messages ended."""
    until_s = min(now_s, ended_s)
    return NOW_S + offset_s + (until_s - NOW_S - offset_s) // period_s * period_s


def test_a_healthy_drive_shows_no_fault() -> None:
    assert names(HEALTHY) == set()


# silence


@pytest.mark.parametrize(
    ("stamps", "bound_s", "before", "after"),
    [
        (("angle_stamp_s",), BOUNDS.late_s, None, "drive_late"),
        (("current_stamp_s",), BOUNDS.late_s, None, "drive_late"),
        (("angle_stamp_s",), BOUNDS.quiet_s, "drive_late", "position_stale"),
        (("current_stamp_s",), BOUNDS.quiet_s, "drive_late", "current_stale"),
        (("angle_stamp_s", "current_stamp_s"), BOUNDS.quiet_s, "drive_late", "drive_quiet"),
        (("angle_stamp_s",), BOUNDS.silence_s, "position_stale", "position_silent"),
        (("current_stamp_s",), BOUNDS.silence_s, "current_stale", "current_silent"),
        (("angle_stamp_s", "current_stamp_s"), BOUNDS.silence_s, "drive_quiet", "drive_silent"),
        (("heartbeat_stamp_s",), 0.5, None, "heartbeat_silent"),
        (("temperature_stamp_s",), SLOW_SILENCE_S, None, "temperature_silent"),
    ],
)
def test_a_signal_counts_as_gone_from_its_bound_on(
    stamps: tuple[str, ...], bound_s: float, before: str | None, after: str
) -> None:
    def reported(age_s: float) -> set[str]:
        stamped: dict[str, Any] = dict.fromkeys(stamps, NOW_S - age_s)
        return names(HEALTHY._replace(**stamped))

    assert reported(bound_s - BEYOND) == ({before} - {None})
    assert reported(bound_s + BEYOND) == {after}


@given(
    st.floats(0.0, 0.1) | st.sampled_from([inf]),
    st.floats(0.0, 0.1) | st.sampled_from([inf]),
)
def test_the_more_severe_of_two_silences_is_reported_and_more_silence_is_never_milder(
    position_s: float, current_s: float
) -> None:
    def reported(position_age_s: float, current_age_s: float) -> int:
        found = names(HEALTHY._replace(angle_stamp_s=NOW_S - position_age_s, current_stamp_s=NOW_S - current_age_s))
        assert len(found - {"current_silent"}) <= 1
        return max((SEVERITY.index(name) for name in found), default=-1)

    def reaction(index: int) -> Reaction:
        return FAULT_KINDS[SEVERITY[index]].reaction if index >= 0 else Reaction.NONE

    here = reaction(reported(position_s, current_s))
    assert reaction(reported(position_s + 0.003, current_s)) >= here
    assert reaction(reported(position_s, current_s + 0.003)) >= here


@pytest.mark.parametrize("offset_s", [0.0, 0.0003, 0.001, 0.0019])
@pytest.mark.parametrize(
    ("name", "stamps"),
    [
        ("drive_late", ("angle_stamp_s", "current_stamp_s")),
        ("drive_quiet", ("angle_stamp_s", "current_stamp_s")),
        ("drive_silent", ("angle_stamp_s", "current_stamp_s")),
        ("position_stale", ("angle_stamp_s",)),
        ("position_silent", ("angle_stamp_s",)),
        ("current_stale", ("current_stamp_s",)),
        ("current_silent", ("current_stamp_s",)),
    ],
)
def test_silence_is_noticed_within_its_ticks_wherever_between_two_messages_it_began(
    name: str, stamps: tuple[str, ...], offset_s: float
) -> None:
    def state_at(now_s: float) -> DriveState:
        return fresh(now_s, **dict.fromkeys(stamps, last_message_s(now_s, NOW_S, MESSAGE_S, offset_s)))

    earliest = {"drive_late": 2, "drive_quiet": 3, "position_stale": 3, "current_stale": 3}.get(name, 9)
    assert earliest <= ticks_until(name, state_at) <= FAULT_KINDS[name].bound_ticks


@pytest.mark.parametrize(
    ("name", "stamp"), [("heartbeat_silent", "heartbeat_stamp_s"), ("temperature_silent", "temperature_stamp_s")]
)
@pytest.mark.parametrize("offset_s", [0.0, 0.05, 0.099])
def test_slow_signals_that_end_are_noticed_within_their_ticks(name: str, stamp: str, offset_s: float) -> None:
    def state_at(now_s: float) -> DriveState:
        return fresh(now_s, **{stamp: last_message_s(now_s, NOW_S, 0.1, offset_s)})

    assert FAULT_KINDS[name].bound_ticks - 42 <= ticks_until(name, state_at) <= FAULT_KINDS[name].bound_ticks


def test_messages_every_two_milliseconds_are_never_late_at_any_phase_to_the_ticks() -> None:
    for offset in range(20):
        monitor = make_monitor()
        for tick in range(1, 400):
            now_s = NOW_S + tick * PERIOD_S
            stamp_s = last_message_s(now_s, inf, MESSAGE_S, 1e-4 * offset)
            assert not seen(monitor, fresh(now_s, angle_stamp_s=stamp_s, current_stamp_s=stamp_s), now_s)


def test_one_message_that_is_lost_is_at_most_late() -> None:
    for offset in range(20):
        monitor = make_monitor()
        found: set[str] = set()
        for tick in range(1, 40):
            now_s = NOW_S + tick * PERIOD_S
            stamp_s = last_message_s(now_s, inf, MESSAGE_S, 1e-4 * offset)
            if NOW_S + 0.05 <= stamp_s < NOW_S + 0.05 + MESSAGE_S:
                stamp_s -= MESSAGE_S
            found |= set(seen(monitor, fresh(now_s, angle_stamp_s=stamp_s, current_stamp_s=stamp_s), now_s))
        assert found <= {"drive_late"}


def silences(answers_only: bool, missed: int, lost_after: int) -> list[set[str]]:
    """Return the faults of each tick around a gap of the loop; every tick asks, and its answer has the time of the
    question.

    The answer to the last question before the gap is read after it; answers from tick `lost_after` on are lost.
    """
    monitor, asked_s, now_s = make_monitor(answers_only=answers_only), NOW_S, NOW_S
    found = []
    for tick in range(12):
        dt_s = PERIOD_S * (1 + (missed if tick == 3 else 0))
        now_s += dt_s
        state = HEALTHY._replace(
            angle_stamp_s=asked_s, current_stamp_s=asked_s, heartbeat_stamp_s=asked_s, temperature_stamp_s=asked_s
        )
        found.append(set(seen(monitor, state, now_s, dt_s=dt_s)) & set(SEVERITY))
        if tick < lost_after:
            asked_s = now_s
    return found


@pytest.mark.parametrize("missed", [1, 2, 7, 20, 760])
def test_a_drive_that_was_not_asked_is_not_silent(missed: int) -> None:
    assert not any(silences(True, missed, lost_after=99))
    assert any(silences(False, missed, lost_after=99)) is (missed > 1)


@pytest.mark.parametrize("missed", [0, 7, 20])
def test_a_drive_that_does_not_answer_after_a_gap_is_silent_as_soon_as_without_it(missed: int) -> None:
    names_of = silences(True, missed, lost_after=3)
    assert names_of == silences(True, 0, lost_after=3)
    assert names_of[3:7] == [set(), set(), {"drive_late"}, {"drive_quiet"}]


def test_a_drive_that_never_reported_its_temperature_has_no_temperature_fault() -> None:
    assert names(HEALTHY._replace(temperature_c=nan, temperature_stamp_s=NEVER_S)) == set()


def test_silence_is_reported_with_signal_joint_and_time() -> None:
    late = seen(make_monitor(), HEALTHY._replace(current_stamp_s=NOW_S - 0.0201))
    assert late == {"current_stale": "No current came from the left_sweep drive for 20 ms."}
    gone = seen(make_monitor(), HEALTHY._replace(angle_stamp_s=NEVER_S, current_stamp_s=NEVER_S))
    assert gone == {"drive_silent": "No message came from the left_sweep drive at all."}
    tick = seen(make_monitor(), HEALTHY._replace(heartbeat_stamp_s=NEVER_S))
    assert tick == {"heartbeat_silent": "No heartbeat came from the left_sweep drive at all."}


def test_the_older_of_two_late_signals_is_named() -> None:
    message = seen(make_monitor(), HEALTHY._replace(angle_stamp_s=NOW_S - 0.006, current_stamp_s=NOW_S - 0.007))
    assert message == {"drive_late": "No current came from the left_sweep drive for 7 ms."}


# the drive


@pytest.mark.parametrize("flags", [1, 0x10, 0x4000000])
def test_any_error_flag_is_a_fault(flags: int) -> None:
    message = seen(make_monitor(), HEALTHY._replace(error_flags=flags))
    assert message == {"drive_error": f"The left_sweep drive reports error 0x{flags:x}."}


def test_a_drive_out_of_closed_loop_is_a_fault_only_where_it_is_expected_there() -> None:
    idle = HEALTHY._replace(closed_loop=False)
    assert names(idle, moving=True) == {"drive_disarmed"}
    assert names(idle, moving=False) == set()


def test_an_unrequested_closed_loop_is_a_fault_after_the_time_to_obey() -> None:
    monitor = make_monitor()
    unasked = [
        tick for tick in range(200) if "drive_energised" in seen(monitor, HEALTHY, energised=False, moving=False)
    ]
    assert unasked[0] == pytest.approx(0.2 / PERIOD_S, abs=1)
    assert unasked[0] + 38 + 2 <= FaultKind.DRIVE_ENERGISED.bound_ticks  # a heartbeat reports it


def test_the_time_to_obey_begins_again_with_every_obedience() -> None:
    monitor = make_monitor()
    for tick in range(400):
        reported = seen(monitor, HEALTHY._replace(closed_loop=tick % 70 > 0), energised=False, moving=False)
        assert "drive_energised" not in reported


@pytest.mark.parametrize(
    ("voltage_v", "expected"),
    [(24.0, None), (20.0, None), (19.99, "voltage_low"), (18.0, "voltage_low"), (17.99, "voltage_under"), (nan, None)],
)
def test_a_supply_is_low_and_then_too_low_after_two_messages(voltage_v: float, expected: str | None) -> None:
    assert lasting(HEALTHY._replace(bus_voltage_v=voltage_v)) == ({expected} - {None})


# motion


@pytest.mark.parametrize(("edge", "outward"), [(70.0, 1.0), (-70.0, -1.0)])
def test_a_joint_may_be_past_its_range_by_the_margin_and_no_further(edge: float, outward: float) -> None:
    assert names(HEALTHY._replace(angle_rad=radians(edge) - outward * 1e-9)) == set()
    assert names(HEALTHY._replace(angle_rad=radians(edge) + outward * 1e-9)) == {"joint_position"}


def test_out_of_range_is_reported_in_degrees_with_the_range() -> None:
    (message,) = seen(make_monitor(), HEALTHY._replace(angle_rad=radians(80.0))).values()
    assert message == "The left_sweep joint is at 80.0 degrees, outside of -70 to 70."


def test_an_angle_that_is_no_number_is_out_of_range() -> None:
    for angle in (nan, inf, -inf):
        assert "joint_position" in names(HEALTHY._replace(angle_rad=angle))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_is_too_fast_from_a_quarter_over_its_limit_on(sign: float) -> None:
    bound = 1.25 * LIMITS.velocity_rad_s

    def ticks_at(velocity_rad_s: float) -> list[set[str]]:
        monitor = make_monitor()
        return [set(seen(monitor, HEALTHY._replace(velocity_rad_s=sign * velocity_rad_s))) for _ in range(10)]

    assert ticks_at(bound) == [set()] * 10
    fast = [{"joint_velocity"}] * (10 - FAST_TICKS + 1)
    assert ticks_at(bound + BEYOND) == [set()] * (FAST_TICKS - 1) + fast
    assert FaultKind.JOINT_VELOCITY.bound_ticks > FAST_TICKS + 1


def test_two_fast_samples_again_and_again_are_no_fault() -> None:
    monitor = make_monitor()
    for tick in range(100):
        assert not seen(monitor, HEALTHY._replace(velocity_rad_s=100.0 if tick % 3 else 0.0))


def moving_ticks(speed_rad_s: float, noise_rad_s: float = 0.0, energised: bool = False) -> int:
    """Return how many of 200 ticks report a joint with this speed as moving."""
    monitor, random, count = make_monitor(), Random(1), 0
    for tick in range(200):
        now_s = NOW_S + tick * PERIOD_S
        reported_rad_s = speed_rad_s + random.gauss(0.0, noise_rad_s)
        state = fresh(now_s, angle_rad=speed_rad_s * tick * PERIOD_S, velocity_rad_s=reported_rad_s, closed_loop=False)
        count += "joint_moving" in seen(monitor, state, now_s, energised=energised, moving=False)
    return count


def test_a_moving_joint_is_reported_only_while_the_torque_is_off() -> None:
    assert moving_ticks(0.5) > 150
    assert moving_ticks(-0.5) > 150
    assert moving_ticks(0.5, energised=True) == 0


def test_a_joint_at_rest_whose_speed_is_noise_may_be_armed() -> None:
    assert moving_ticks(0.0, noise_rad_s=0.5) == 0


def samples(monitor: JointMonitor, steps: Iterable[tuple[float, float]]) -> list[set[str]]:
    """Return the faults of angles that arrive at times after NOW_S, one in each tick."""
    return [set(seen(monitor, fresh(NOW_S + time_s, angle_rad=angle), NOW_S + time_s)) for time_s, angle in steps]


def test_an_encoder_jumps_beyond_what_its_speed_explains() -> None:
    for step_rad, expected in ((0.05 - BEYOND, set()), (0.05 + BEYOND, {"encoder_jump"})):
        for sign in (1.0, -1.0):
            assert samples(make_monitor(), [(0.0, 0.0), (0.002, sign * step_rad)]) == [set(), expected]


def test_a_jump_is_reported_once_and_the_new_angle_then_counts() -> None:
    found = samples(make_monitor(), [(0.002 * tick, 0.5 * (tick >= 5)) for tick in range(10)])
    assert found == [set()] * 5 + [{"encoder_jump"}] + [set()] * 4


def test_the_first_sample_is_never_a_jump() -> None:
    monitor = make_monitor()
    assert samples(monitor, [(0.0, 1.0)]) == [set()]
    monitor.reset()
    assert samples(monitor, [(0.0, -1.0)]) == [set()]


def test_the_same_message_seen_twice_is_no_jump_and_no_step() -> None:
    monitor = make_monitor()
    samples(monitor, [(0.0, 0.0)])
    for tick in range(1, 3):
        assert not seen(monitor, HEALTHY._replace(angle_rad=0.0), NOW_S + tick * 0.002)


def test_a_stamp_before_the_one_before_makes_no_jump() -> None:
    """A frame without a time is stamped when it is read, which may be after the time of the next frame."""
    assert samples(make_monitor(), [(0.05, 0.1), (0.01, 0.1), (0.012, 0.11)]) == [set(), set(), set()]


def test_a_joint_at_the_velocity_limit_never_jumps() -> None:
    monitor, speed_rad_s = make_monitor(), LIMITS.velocity_rad_s
    for tick in range(30):
        now_s = NOW_S + tick * PERIOD_S
        angle_rad = -0.9 + speed_rad_s * tick * PERIOD_S
        assert not seen(monitor, fresh(now_s, angle_rad=angle_rad, velocity_rad_s=speed_rad_s), now_s)


# load


def stalled_ticks(torque_nm: float, velocity_rad_s: float, excused: bool = False, ticks: int = 900) -> int | None:
    monitor = make_monitor()
    for tick in range(1, ticks):
        state = HEALTHY._replace(velocity_rad_s=velocity_rad_s, angle_rad=0.1 + velocity_rad_s * tick * PERIOD_S)
        if "joint_not_following" in seen(monitor, state, torque_nm=torque_nm, may_stand_still=excused):
            return tick
    return None


def test_a_joint_that_stands_still_at_full_torque_does_not_follow() -> None:
    for torque_nm in (LIMITS.torque_nm, 0.95 * LIMITS.torque_nm + BEYOND, -LIMITS.torque_nm):
        ticks = stalled_ticks(torque_nm, 0.0)
        assert ticks == pytest.approx(760, abs=2)
        assert ticks is not None and ticks <= FaultKind.JOINT_NOT_FOLLOWING.bound_ticks


@pytest.mark.parametrize(
    ("torque_nm", "velocity_rad_s", "excused"),
    [
        (0.94 * LIMITS.torque_nm, 0.0, False),  # not saturated
        (LIMITS.torque_nm, 0.11, False),  # it moves
        (LIMITS.torque_nm, -0.11, False),
        (LIMITS.torque_nm, 0.0, True),  # in a recovery
        (0.0, 0.0, False),
    ],
)
def test_everything_else_follows_or_is_excused(torque_nm: float, velocity_rad_s: float, excused: bool) -> None:
    assert stalled_ticks(torque_nm, velocity_rad_s, excused, 2000) is None


def test_a_move_begins_the_wait_again_and_the_noise_of_a_speed_does_not() -> None:
    monitor, random = make_monitor(), Random(1)
    for tick in range(2000):
        state = HEALTHY._replace(angle_rad=0.05 * (tick // 700))
        assert "joint_not_following" not in seen(monitor, state, torque_nm=LIMITS.torque_nm)
    monitor = make_monitor()
    noisy = [HEALTHY._replace(velocity_rad_s=random.gauss(0.0, 0.3)) for _ in range(800)]
    assert any("joint_not_following" in seen(monitor, state, torque_nm=LIMITS.torque_nm) for state in noisy)


def test_missed_ticks_count_for_as_long_as_they_lasted() -> None:
    monitor = make_monitor()
    found = [
        tick
        for tick in range(1, 200)
        if "joint_not_following" in seen(monitor, HEALTHY, torque_nm=LIMITS.torque_nm, dt_s=10.0 * PERIOD_S)
    ]
    assert found[0] == pytest.approx(76, abs=1)


def test_one_sample_after_a_long_stall_is_no_proof_of_what_lasted() -> None:
    """A daemon that hung for seconds gets one sample."""
    monitor = make_monitor()
    stalled = seen(monitor, HEALTHY, torque_nm=LIMITS.torque_nm, dt_s=3.0)
    assert set(stalled).isdisjoint({"joint_not_following", "torque_missing", "joint_velocity"})


@pytest.mark.parametrize("missed", [1, 5, 9, 200])
def test_a_joint_at_rest_is_not_too_fast_after_missed_ticks(missed: int) -> None:
    assert names(HEALTHY, dt_s=(1 + missed) * PERIOD_S) == set()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motor_takes_too_much_from_a_quarter_over_its_limit_on(sign: float) -> None:
    def ticks_at(current_a: float) -> list[bool]:
        monitor = make_monitor()
        state = HEALTHY._replace(current_a=sign * current_a)
        return ["joint_current" in seen(monitor, state) for _ in range(6)]

    assert ticks_at(1.25 * CURRENT_LIMIT_A) == [False] * 6
    assert ticks_at(1.25 * CURRENT_LIMIT_A + BEYOND) == [False] * (CURRENT_TICKS - 1) + [True] * (7 - CURRENT_TICKS)
    assert FaultKind.JOINT_CURRENT.bound_ticks > CURRENT_TICKS + 1


# heat


@pytest.mark.parametrize(
    ("temperature_c", "expected"),
    [
        (79.99, None),
        (80.0, "motor_overheating"),
        (89.99, "motor_overheating"),
        (90.0, "motor_hot"),
        (200.0, "motor_hot"),
        (inf, "motor_hot"),
        (nan, None),
        (0.0, None),
        (-inf, None),
    ],
)
def test_a_sensor_is_nearly_too_hot_half_way_to_its_bound_and_then_too_hot(
    temperature_c: float, expected: str | None
) -> None:
    assert lasting(HEALTHY._replace(temperature_c=temperature_c)) == ({expected} - {None})


def warm_monitor(winding_c: float) -> JointMonitor:
    monitor = make_monitor()
    monitor.winding.temperature_c = winding_c
    return monitor


@pytest.mark.parametrize("measured_c", [nan, 0.0, 25.0, 79.0])
@pytest.mark.parametrize(
    ("winding_c", "expected"), [(79.0, None), (80.5, "winding_overheating"), (91.0, "winding_hot")]
)
def test_currents_guard_a_motor_whose_sensor_sees_nothing(
    measured_c: float, winding_c: float, expected: str | None
) -> None:
    reported = seen(warm_monitor(winding_c), HEALTHY._replace(temperature_c=measured_c))
    assert set(reported) == ({expected} - {None})


def test_a_winding_that_is_too_hot_is_not_hidden_by_a_sensor_that_is_nearly_so() -> None:
    assert set(seen(warm_monitor(95.0), HEALTHY._replace(temperature_c=85.0))) == {"winding_hot"}


def test_where_both_are_as_hot_the_sensor_is_trusted() -> None:
    monitor = warm_monitor(95.0)
    for _ in range(TWO_MESSAGES + 2):
        reported = seen(monitor, HEALTHY._replace(temperature_c=96.0))
    assert reported == {"motor_hot": "The left_sweep motor has 96 degrees C."}


def test_one_absurd_temperature_is_over_in_minutes() -> None:
    for absurd in (inf, 1e38):
        monitor = make_monitor()
        for _ in range(TWO_MESSAGES + 2):
            reported = seen(monitor, HEALTHY._replace(temperature_c=absurd))
        assert set(reported) == {"motor_hot"}
        ticks = 0
        while seen(monitor, HEALTHY, dt_s=1.0):
            ticks += 1
            assert ticks < 180


def test_a_reset_does_not_cool_a_winding() -> None:
    monitor = warm_monitor(95.0)
    monitor.reset()
    assert set(seen(monitor, HEALTHY)) == {"winding_hot"}


# any input

anything = st.floats(allow_nan=True, allow_infinity=True)
drive_states = st.builds(
    DriveState, anything, anything, anything, anything, anything, st.booleans(), st.integers(0, 2**32 - 1), anything,
    anything, anything, anything,
)  # fmt: skip


@given(st.lists(drive_states, min_size=1, max_size=6), st.booleans(), st.booleans(), anything)
def test_no_value_makes_it_fail_and_every_fault_has_a_message(
    states: list[DriveState], energised: bool, moving: bool, torque_nm: float
) -> None:
    monitor = make_monitor()
    for tick, state in enumerate(states):
        now_s = NOW_S + tick * PERIOD_S
        for name, message in seen(
            monitor, state, now_s, energised=energised, moving=moving, torque_nm=torque_nm
        ).items():
            assert name in FAULT_KINDS
            assert message.startswith(("The left_sweep ", "No ")) and message.endswith((".", "C", "s."))
        assert isfinite(monitor.winding.temperature_c)


@given(st.lists(drive_states, min_size=1, max_size=4))
def test_a_monitor_forgets_garbage_once_the_signals_are_good_again(states: list[DriveState]) -> None:
    """Only heat and, for one tick, the jump back are left."""
    monitor = make_monitor()
    for tick, state in enumerate(states):
        seen(monitor, state, NOW_S + tick * PERIOD_S)
    found: set[str] = set()
    for tick in range(len(states), len(states) + 5):
        now_s = NOW_S + tick * PERIOD_S
        found = set(seen(monitor, fresh(now_s), now_s))
    assert found <= {"winding_hot", "winding_overheating"}


# torque that is not there


def missing_ticks(sent_nm: float, current_a: float, moving: bool = True) -> int | None:
    monitor = make_monitor()
    for tick in range(1, 200):
        state = fresh(NOW_S + tick * PERIOD_S, current_a=current_a)
        if "torque_missing" in seen(monitor, state, NOW_S + tick * PERIOD_S, torque_nm=sent_nm, moving=moving):
            return tick
    return None


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_torque_is_missing_beyond_its_fraction_of_the_limit_and_not_before(sign: float) -> None:
    fraction_nm = MISSING_FRACTION * LIMITS.torque_nm
    assert missing_ticks(sign * (fraction_nm + 1e-6), 0.0) is not None
    assert missing_ticks(sign * (fraction_nm - 1e-6), 0.0) is None
    assert missing_ticks(0.0, sign * (fraction_nm + 1e-6) / 0.083) is not None


def test_a_missing_torque_is_noticed_within_its_ticks() -> None:
    ticks = missing_ticks(0.7, 0.0)
    assert ticks is not None
    assert MISSING_S / PERIOD_S <= ticks <= FaultKind.TORQUE_MISSING.bound_ticks


def test_no_torque_is_missed_of_a_drive_that_is_not_in_closed_loop() -> None:
    assert missing_ticks(0.7, 0.0, moving=False) is None


def test_a_current_that_follows_within_ticks_is_not_missed() -> None:
    """The current reported in a tick answers the torque of the tick before."""
    monitor, before_nm = make_monitor(), 0.0
    for tick in range(400):
        now_s, sent_nm = NOW_S + tick * PERIOD_S, 0.7 if tick // 30 % 2 else -0.7
        state = fresh(now_s, current_a=before_nm / 0.083, velocity_rad_s=1.0, angle_rad=0.1 + 1e-3 * (tick % 2))
        assert "torque_missing" not in seen(monitor, state, now_s, torque_nm=sent_nm)
        before_nm = sent_nm


def test_a_joint_that_rests_exactly_where_its_torque_left_it_has_a_sound_encoder() -> None:
    """The torque fell while the joint was at rest; without torque nothing has to move any more."""
    monitor = make_monitor()

    def stuck(tick: int, torque_nm: float, energised: bool) -> bool:
        now_s = NOW_S + tick * PERIOD_S
        return "encoder_stuck" in seen(monitor, fresh(now_s), now_s, torque_nm=torque_nm, energised=energised)

    assert not any(stuck(tick, 0.7 if tick < 10 else 0.0, energised=True) for tick in range(12))
    assert not any(stuck(tick, 0.0, energised=False) for tick in range(12, 200))
