"""Encoders that jump or stand still, distinguished from joints that are fast, at rest, or held by the mud.

Bounds are pinned from both sides with figures instead of the module's own constants.
"""

from collections.abc import Callable, Iterable
from itertools import accumulate, repeat
from math import cos, inf, nextafter, pi, sin
from random import Random

import pytest

from control.monitors.encoder_monitor import EncoderMonitor
from control.rate import PERIOD_S
from control.records import DriveState

MESSAGE_S = 0.002
JUMP_RAD = 0.05
COUNT_RAD = 2.0 * pi / 16384
RANDOM = Random(1)
Sample = tuple[float, float, float]  # stamp in s, angle in rad, velocity in rad/s


def make_encoder() -> EncoderMonitor:
    return EncoderMonitor("left_sweep", JUMP_RAD)


def found(
    samples: Iterable[Sample], encoder: EncoderMonitor | None = None, torques_nm: Iterable[float] = repeat(0.0)
) -> list[str]:
    """Return the name of each sample's fault, or an empty text."""
    encoder, names = encoder or make_encoder(), []
    for (stamp_s, angle_rad, velocity_rad_s), torque_nm in zip(samples, torques_nm, strict=False):
        fault = encoder.update(DriveState(angle_rad, velocity_rad_s, stamp_s), PERIOD_S, torque_nm)
        names.append(fault.name if fault else "")
    return names


def messages(values: Iterable[tuple[float, float]]) -> list[Sample]:
    """Return angles and velocities as messages every two milliseconds."""
    return [(number * MESSAGE_S, *value) for number, value in enumerate(values)]


def first_stuck(names: list[str]) -> int | None:
    """Return the number of the first sample with the fault, of samples that have no other."""
    assert set(names) <= {"", "encoder_stuck"}
    return names.index("encoder_stuck") if "encoder_stuck" in names else None


# an angle that stays


def noisy(velocity_rad_s: float, count: int) -> list[float]:
    """Return a velocity whose last bits change."""
    return [velocity_rad_s * (1.0 + 1e-9 * (number % 2)) for number in range(count)]


@pytest.mark.parametrize(
    ("gap_s", "velocities_rad_s", "expected"),
    [
        # 30 mrad of the velocity's path, of which a hundredth leaks in 10 ms
        *((0.021, noisy(sign * 1.4, 2), None) for sign in (-1.0, 1.0)),
        *((0.021, noisy(sign * 1.6, 2), 1) for sign in (-1.0, 1.0)),
        (0.025, [1.2] * 2, None),  # exactly
        (0.01, noisy(1.009, 4), None),
        (0.01, noisy(1.011, 4), 3),
        # 20 ms, of a fast angle
        (0.0099, noisy(20.0, 4), 3),
        (0.0101, noisy(20.0, 3), 2),
        (0.02, noisy(20.0, 2), None),  # exactly
        # 0.1 s, of a velocity that repeats to the last bit
        (0.0249, [0.01] * 6, 5),
        (0.0251, [0.01] * 5, 4),
        (0.1, [0.01] * 2, None),  # exactly
        (0.0249, [0.01] * 4 + [nextafter(0.01, inf)] * 4, None),
        # 30 ms, within which two messages belong together
        (0.029, [2.0] * 2, 1),
        (0.031, [2.0] * 2, None),
        # rest: slower than a nanoradian per second, noise about zero, to and fro
        (0.02, [1e-9] * 20, None),
        (0.02, [2e-9] * 20, 6),
        (0.02, [-2e-9] * 20, 6),
        (0.002, [0.0] * 3000, None),
        (0.002, [RANDOM.gauss(0.0, 0.1) for _ in range(10_000)], None),
        (0.01, [2.0 * (-1.0) ** number for number in range(100)], None),
    ],
)
def test_an_angle_may_stay_up_to_its_bounds(gap_s: float, velocities_rad_s: list[float], expected: int | None) -> None:
    samples = [(number * gap_s, 0.3, velocity) for number, velocity in enumerate(velocities_rad_s)]
    assert first_stuck(found(samples)) == expected


def test_a_joint_that_rests_again_at_the_angle_at_which_its_encoder_stood_still_is_sound() -> None:
    names = found([(0.01 * number, 0.3, 0.05 if number < 100 else 1e-5 * number) for number in range(200)])
    assert names[99] == "encoder_stuck" and names[180:] == [""] * 20


def test_a_new_angle_begins_every_wait_again() -> None:
    samples = [(0.1 * turn + 0.02 * number, 0.3 + 1e-4 * turn, 0.3) for turn in range(6) for number in range(4)]
    assert first_stuck(found(samples)) is None


def test_an_angle_that_stays_frozen_after_a_long_gap_is_stuck() -> None:
    samples = [(number * MESSAGE_S + (0.1 if number >= 5 else 0.0), 0.3, 2.0) for number in range(30)]
    names = found(samples)
    assert not any(names[:10]) and names[-1] == "encoder_stuck"


def test_a_slow_joint_of_few_counts_is_not_stuck() -> None:
    """One count of 16384 takes 0.4 s at 1 mrad/s."""
    random = Random(4)
    for speed_rad_s in (0.001, 0.01, 0.1, 3.0):
        angles = (speed_rad_s * number * MESSAGE_S for number in range(3000))
        values = ((round(a / COUNT_RAD) * COUNT_RAD, speed_rad_s + random.gauss(0.0, 1e-4)) for a in angles)
        assert not any(found(messages(values))), speed_rad_s


def test_a_quick_joint_whose_drive_repeats_itself_now_and_then_is_not_stuck() -> None:
    random, values, shown = Random(2), [], (0.0, 2.0 * pi)
    for number in range(3000):
        phase = 2.0 * pi * number * MESSAGE_S
        if random.random() > 0.3:
            shown = (sin(phase), 2.0 * pi * cos(phase))
        values.append(shown)
    assert not any(found(messages(values)))


def test_the_same_message_is_evaluated_once() -> None:
    assert not any(found([(1.0, 0.3, 9.0)] * 1000))


# angle and velocity that stay while the torque changes


@pytest.mark.parametrize(
    ("gap_s", "torques_nm", "expected"),
    [
        # within 50 ms, to a change of 0.4 N·m
        *((0.0124, [0.0, sign * 0.41, *[0.0] * 4], 5) for sign in (-1.0, 1.0)),
        *((0.0126, [0.0, sign * 0.41, *[0.0] * 4], 4) for sign in (-1.0, 1.0)),
        *((0.0125, [0.0, sign * 0.41, *[0.0] * 3], None) for sign in (-1.0, 1.0)),  # exactly its time
        *((0.02, [0.0] * 3 + [sign * 0.4] * 100, None) for sign in (-1.0, 1.0)),  # exactly its size
        # within 10 ms of the change: a flipper that the mud held until then has not moved in the first answer
        (0.0024, [0.0] * 30 + [0.41] * 5, None),
        (0.0024, [0.0] * 30 + [0.41] * 6, 35),
        # the torque of the first sample may have moved the joint to where it is
        (0.02, [0.7] + [0.0] * 100, None),
        (0.02, [0.7, 0.7] + [0.0] * 100, 3),
        # constant, and held by dry friction
        (PERIOD_S, [0.7] * 1000, None),
        (PERIOD_S, [0.06, -0.06] * 500, None),
    ],
)
def test_a_resting_joint_yields_to_a_torque_that_changes(
    gap_s: float, torques_nm: list[float], expected: int | None
) -> None:
    samples = [(number * gap_s, 0.3, 0.0) for number in range(len(torques_nm))]
    assert first_stuck(found(samples, torques_nm=torques_nm)) == expected


@pytest.mark.parametrize(("yields", "names"), [(True, {""}), (False, {"", "encoder_stuck"})])
def test_a_joint_whose_load_follows_its_torque_must_yield_to_a_step(yields: bool, names: set[str]) -> None:
    """Dry friction holds the joint of a body that moves; measured in a simulated walk: 0.9 N·m in 0.1 s."""
    encoder, angle_rad, reported, probes = make_encoder(), 0.3, set(), 0
    for number in range(500):
        torque_nm = 0.45 * sin(9.0 * number * MESSAGE_S)
        if encoder.probed:
            probes += 1
            angle_rad += COUNT_RAD * yields
        reported |= set(found([(number * MESSAGE_S, angle_rad, 0.0)], encoder, [torque_nm]))
    assert reported == names and probes


def test_a_velocity_that_changes_begins_the_wait_for_a_torque_again() -> None:
    samples = [(0.02 * number, 0.3, 1e-12 * (number // 3 % 2)) for number in range(400)]  # each is repeated twice
    assert not any(found(samples, torques_nm=[0.7, 0.0] * 200))


def test_the_torque_of_a_message_that_is_seen_again_is_not_counted() -> None:
    samples = [(0.02 * number, 0.3, 0.0) for number in range(100) for _ in range(2)]
    assert not any(found(samples, torques_nm=[0.0, 0.7] * 100))


# jumps


@pytest.mark.parametrize(
    ("samples", "last"),
    [
        # more than the noise of an encoder
        ([(0.0, 0.0, 0.0), (0.002, 0.05, 0.0)], ""),
        ([(0.0, 0.0, 0.0), (0.002, nextafter(0.05, 1.0), 0.0)], "encoder_jump"),
        ([(0.0, 0.0, 16.0), (0.02, -0.32, 16.0)], "encoder_jump"),  # as far in the other direction
        # over more than 30 ms two velocities give no path
        ([(0.0, 0.0, 0.0), (0.03, 1.0, 0.0)], "encoder_jump"),
        ([(0.0, 0.0, 0.0), (nextafter(0.03, 1.0), 1.0, 0.0)], ""),
        # a stamp that goes back has no path and no time
        ([(1.0, 0.0, 5.0), (0.9, 0.06, 5.0)], ""),
        ([(1.0, 0.0, 5.0), (0.9, 0.07, 5.0)], "encoder_jump"),
        ([(1.0 - 0.05 * number, 0.3, 5.0) for number in range(10)], ""),
        # the first message, wherever it is, and a magnet that slips at rest, once
        (messages([(2.9, 0.0)] * 2), ""),
        (messages([(0.1, 0.0)] * 5 + [(0.2, 0.0)]), "encoder_jump"),
        (messages([(0.1, 0.0)] * 5 + [(0.2, 0.0)] * 2), ""),
    ],
)
def test_a_jump_is_more_than_noise_in_a_time_whose_path_is_known(samples: list[Sample], last: str) -> None:
    *_, name = found(samples)
    assert name == last


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("first", "second"), [(10.0, 20.0), (20.0, 10.0), (-16.0, -16.0)])
def test_the_path_is_that_of_the_mean_of_the_two_velocities(first: float, second: float, sign: float) -> None:
    """A stamp that is a tick late explains the greater velocity times a tick more."""
    slack_rad = JUMP_RAD + max(abs(first), abs(second)) * PERIOD_S
    for beyond_rad, expected in ((-1e-9, ""), (1e-9, "encoder_jump")):
        step_rad = (first + second) / 2.0 * 0.02 + sign * (slack_rad + beyond_rad)
        assert found([(0.0, 0.0, first), (0.02, step_rad, second)]) == ["", expected]


def test_readings_that_jump_about_a_joint_at_rest_are_reported_repeatedly() -> None:
    random = Random(3)
    assert found(messages((random.uniform(-0.1, 0.1), 0.0) for _ in range(200))).count("encoder_jump") > 50


def test_a_jump_reports_the_step_in_degrees_and_the_gap_in_milliseconds() -> None:
    encoder = make_encoder()
    found([(0.0, 0.0, 0.0)], encoder)
    fault = encoder.update(DriveState(-1.0, 0.0, 0.002), PERIOD_S)
    assert fault is not None and fault.subject == "left_sweep"
    assert dict(fault.values) == pytest.approx({"step_deg": 57.29578, "gap_ms": 2.0})


def test_a_jump_of_exactly_its_bound_may_be_a_late_stamp() -> None:
    bound_rad = 0.5 + 1.0 * 0.25 + 1.0 / 64.0  # the bound, a stamp that is late, and the path
    for angle_rad, expected in ((bound_rad, None), (nextafter(bound_rad, inf), "encoder_jump")):
        encoder = EncoderMonitor("left_sweep", 0.5)
        encoder.update(DriveState(0.0, 1.0, 0.0), 0.25)
        fault = encoder.update(DriveState(angle_rad, 1.0, 1.0 / 64.0), 0.25)
        assert (fault and fault.name) == expected


@pytest.mark.parametrize("before", range(98, 105))
def test_a_jump_is_found_wherever_the_sums_of_the_speed_begin_again(before: int) -> None:
    """They do after every 50 messages, but for the first 50."""
    quiet = [(0.3 + COUNT_RAD * (number % 2), 0.0) for number in range(before)]
    assert found(messages([*quiet, (-1.0, 0.0)]))[-1] == "encoder_jump"


@pytest.mark.parametrize(("gap_s", "slips"), [(0.012, True), (0.0121, False)])
def test_the_path_over_a_gap_is_no_slip(gap_s: float, slips: bool) -> None:
    before = [((number - 70) * MESSAGE_S, COUNT_RAD * (number % 2), 0.0) for number in range(71)]
    after = [(gap_s + number * MESSAGE_S, 0.2 + COUNT_RAD * (number % 2), 0.0) for number in range(150)]
    names = found([*before, *after], EncoderMonitor("left_sweep", 0.5))
    assert ("encoder_slips" in names) == slips


@pytest.mark.parametrize(("fastest_rad_s", "slips"), [(inf, True), (9.0, False)])
def test_the_path_of_a_joint_that_is_faster_than_its_drive_can_report_is_no_slip(
    fastest_rad_s: float, slips: bool
) -> None:
    """Speeds that end at 10 rad/s: in every stride the mud throws the joint forth at 12 rad/s, and it returns."""
    speeds_rad_s = ([1.0] * 30 + [12.0] * 30 + [-2.0] * 195) * 6
    angles_rad = accumulate(speed_rad_s * MESSAGE_S for speed_rad_s in speeds_rad_s)
    reported = [min(speed_rad_s, 10.0) for speed_rad_s in speeds_rad_s]
    encoder = EncoderMonitor("left_sweep", 0.5, fastest_rad_s)
    names = found(messages(zip(angles_rad, reported, strict=True)), encoder)
    assert ("encoder_slips" in names) == slips and set(names) <= {"", "encoder_slips"}


@pytest.mark.parametrize("forget", [EncoderMonitor.reset, EncoderMonitor.release])
@pytest.mark.parametrize(("rate_rad_s", "each"), [(0.05, 1250), (2.0, 45)])  # 2.5 s, and less than an interval of sums
def test_a_slip_begins_again_once_torque_was_off(
    forget: Callable[[EncoderMonitor], None], rate_rad_s: float, each: int
) -> None:
    slipping = messages((rate_rad_s * max(number - 51, 0) * MESSAGE_S, 0.0) for number in range(51 + 2 * each))
    assert "encoder_slips" in found(slipping)
    encoder = make_encoder()
    names = found(slipping[: 51 + each], encoder)
    forget(encoder)
    assert not set(names + found(slipping[51 + each :], encoder)) - {""}


@pytest.mark.parametrize(("fastest_rad_s", "is_stuck"), [(inf, True), (9.0, False)])
def test_a_joint_that_creeps_at_less_than_a_code_of_its_speed_is_not_stuck(
    fastest_rad_s: float, is_stuck: bool
) -> None:
    """Of a DM4340P in mud, which turns at 0.0026 rad/s: its codes are 0.0049 rad/s and 0.00038 rad."""
    creeping = messages((0.00038 * (number // 73), 0.0049) for number in range(800))
    names = found(creeping, EncoderMonitor("left_sweep", JUMP_RAD, fastest_rad_s))
    assert ("encoder_stuck" in names) == is_stuck


def test_a_joint_that_rests_without_torque_where_its_reports_froze_is_not_stuck_any_more() -> None:
    encoder, frozen = make_encoder(), messages([(0.3, -0.17)] * 300 + [(0.3, 0.0)] * 10)
    names = []
    for sample in frozen:
        encoder.release()
        names += found([sample], encoder)
    assert set(names[150:300]) == {"encoder_stuck"} and set(names[-9:]) == {""}


def test_a_torque_from_before_it_was_off_is_no_change() -> None:
    encoder, resting = make_encoder(), messages([(0.3, 0.0)] * 100)
    names = found(resting[:50], encoder)
    encoder.release()
    assert not any(names + found(resting[50:], encoder, repeat(0.5)))


def test_reset_forgets_the_last_message() -> None:
    encoder = make_encoder()
    found(messages([(0.3, 0.4)] * 30), encoder)
    encoder.reset()
    assert found([(0.06, -2.0, 0.0)], encoder) == [""]
